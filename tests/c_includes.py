"""What each folder of C may include; ``c_includes.py [ROOT]`` names every include that breaks a rule.

The rules are the table below: a folder, and what its files may include beside the folder's own headers and
the C standard library. An entry is a whole folder or one header. Modules of a folder (``x.c`` with ``x.h``)
do not include each other in a circle, except in the folders of ``CIRCLES``.
"""

import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

CHIPS = ("stm32f405", "stm32g474")
# What each chip's room says to the room that the chips share, which takes that of the chip it is built for.
CHIP_HEADERS = (
    *("adc_port.h", "clock_tree.h", "crystal_port.h", "flash_cells.h", "pin_functions.h", "registers.h"),
    *("reset_flags.h", "usart_port.h"),
)
MAY_INCLUDE: dict[str, tuple[str, ...]] = {
    "protocol/c": (),
    "protocol/vectors": ("protocol/c",),
    "firmware/hal": (),
    "firmware/hal/host": ("firmware/hal",),
    "firmware/core": ("protocol/c", "firmware/hal/hal.h"),
    "firmware/stm32": (
        "firmware/core/controller.h",
        "firmware/hal/hal.h",
        *(f"firmware/{chip}/{header}" for chip in CHIPS for header in CHIP_HEADERS),
    ),
    "firmware/stm32f405": ("firmware/stm32", "firmware/hal/hal.h", "firmware/core/image_slot.h"),
    "firmware/stm32f405/loader": (
        "firmware/core/image_slot.h",
        "firmware/stm32",
        "firmware/stm32f405",
        "protocol/c",
    ),
    "firmware/stm32g474": ("firmware/stm32", "firmware/hal/hal.h"),
    **{f"firmware/{chip}/boards": () for chip in CHIPS},
    "hil_sim/board": ("<unicorn/unicorn.h>",),
    "hil_sim/plant": (),
    "hil_sim/rig": ("hil_sim/board/board.h", "hil_sim/plant/plant.h"),
    "hil_sim/host_robot": (
        "firmware/core/controller.h",
        "firmware/hal/host/hal_host.h",
        "hil_sim/plant/plant.h",
    ),
}
CIRCLES = {
    "hil_sim/board": "an access runs from the CPU over the bus into a peripheral and back as an interrupt",
}
STANDARD = {
    f"<{name}.h>"
    for name in (
        *("assert", "float", "inttypes", "limits", "math", "stdarg", "stdbool", "stddef", "stdint"),
        *("stdio", "stdlib", "string"),
    )
}
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*(?:(<[^>]+>)|"([^"]+)")', re.MULTILINE)
TOP_FOLDERS = ("firmware", "hil_sim", "protocol")


def sources(root: Path) -> list[Path]:
    """Every C file below the checked folders, relative to the root."""
    found = (path for top in TOP_FOLDERS for path in (root / top).rglob("*.[ch]"))
    return sorted(path.relative_to(root) for path in found)


def includes(text: str) -> Iterator[tuple[int, str, bool]]:
    """Line, name and whether it stands in angle brackets, for each include."""
    for match in INCLUDE.finditer(text):
        yield text.count("\n", 0, match.start()) + 1, match[1] or match[2], match[1] is not None


def resolved(name: str, file: Path, by_name: dict[str, list[Path]]) -> list[Path]:
    """The files that a quoted include may mean: that of its own folder or the next above, else all."""
    beside = Path(*_normal((file.parent / name).parts))
    candidates = by_name.get(Path(name).name, [])
    if beside in candidates:
        return [beside]
    above = [folder / name for folder in file.parents if folder / name in candidates]
    if above:
        return above[:1]
    return [path for path in candidates if path.as_posix().endswith("/" + name.lstrip("./"))]


def _normal(parts: tuple[str, ...]) -> list[str]:
    kept: list[str] = []
    for part in parts:
        if part == ".." and kept:
            kept.pop()
        elif part != ".":
            kept.append(part)
    return kept


def circle(edges: dict[str, set[str]]) -> list[str]:
    """Some modules that include each other in a circle, first and last the same; empty: there is none."""
    done: set[str] = set()

    def search(path: list[str]) -> list[str]:
        for other in sorted(edges.get(path[-1], ())):
            if other in path:
                return [*path[path.index(other) :], other]
            if other not in done and (found := search([*path, other])):
                return found
        done.add(path[-1])
        return []

    return next((found for start in sorted(edges) if (found := search([start]))), [])


def violations(root: Path) -> list[str]:
    """One line for each include that breaks a rule, with its file and line."""
    files = sources(root)
    by_name: dict[str, list[Path]] = defaultdict(list)
    for file in files:
        by_name[file.name].append(file)
    wrong: list[str] = []
    edges: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for file in files:
        folder = file.parent.as_posix()
        if folder not in MAY_INCLUDE:
            wrong.append(f"{file}: {folder} has no line in the table of {Path(__file__).name}")
            continue
        allowed = MAY_INCLUDE[folder]
        for line, name, in_angles in includes((root / file).read_text(encoding="utf-8")):
            where = f"{file}:{line}"
            if in_angles:
                if name not in STANDARD and name not in allowed:
                    wrong.append(f"{where}: {name} is not of the C standard library")
                continue
            targets = resolved(name, file, by_name)
            if not targets:
                wrong.append(f'{where}: there is no header "{name}"')
            for target in targets:
                if target.parent == file.parent:
                    edges[folder][file.stem].update({target.stem} - {file.stem})
                elif target.as_posix() not in allowed and target.parent.as_posix() not in allowed:
                    wrong.append(f"{where}: {folder} may not include {target}")
    for folder, modules in edges.items():
        if folder not in CIRCLES and (found := circle(modules)):
            wrong.append(f"{folder}: a circle of includes: {' -> '.join(found)}")
    return wrong


def main() -> int:
    root = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[1]
    wrong = violations(root)
    print("\n".join(wrong) or f"{len(sources(root))} files keep the include rules")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
