"""The structs and functions that Python reads from the C headers are those that the C compiler sees."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

from hil_sim import native
from hil_sim.c_headers import Headers

HEADERS = ("hil_sim/rig/can_bus.h", "hil_sim/host_robot/host_robot.h")


def compiled_layout(root: Path, tmp_path: Path) -> dict[str, int]:
    """Size of each struct, offset and size of each field in one number, and each constant."""
    lines = []
    for tag, struct in native.HEADERS.structs.items():
        lines.append(f'printf("{tag} %zu\\n", sizeof(struct {tag}));')
        for field in struct._fields_:
            name = f"struct {tag}, {field[0]}"
            size = f"sizeof(((struct {tag} *)0)->{field[0]})"
            lines.append(f'printf("{tag}.{field[0]} %zu\\n", offsetof({name}) * 100000 + {size});')
    lines.extend(f'printf("{name} %zu\\n", (size_t){name});' for name in native.HEADERS.constants)
    source = tmp_path / "layout.c"
    includes = ["<stddef.h>", "<stdio.h>", *(f'"{root / header}"' for header in HEADERS)]
    head = "\n".join(f"#include {each}" for each in includes)
    body = "\n".join(lines)
    source.write_text(f"{head}\nint main(void)\n{{\n{body}\n}}\n")
    program = tmp_path / "layout"
    subprocess.run(["cc", "-std=c11", source, "-o", program], check=True, timeout=60)
    said = subprocess.run([program], check=True, capture_output=True, text=True, timeout=60).stdout
    return {name: int(number) for name, number in (line.split() for line in said.splitlines())}


def test_every_struct_and_constant_is_what_the_compiler_makes_of_it(root: Path, tmp_path: Path) -> None:
    ours: dict[str, int] = dict(native.HEADERS.constants)
    for tag, struct in native.HEADERS.structs.items():
        ours[tag] = ctypes.sizeof(struct)
        for field in struct._fields_:
            place = getattr(struct, field[0])
            ours[f"{tag}.{field[0]}"] = place.offset * 100000 + ctypes.sizeof(field[1])
    assert len(native.HEADERS.structs) > 20
    assert ours == compiled_layout(root, tmp_path)


def test_every_function_of_the_headers_is_exported(native_library: Path) -> None:
    libraries = [native.load(native_library), native.load(native.HOST_ROBOT_LIBRARY)]
    for name in native.HEADERS.functions:
        assert any(hasattr(library, name) for library in libraries), name


def test_a_dataclass_that_is_not_the_struct_is_refused_as_it_is_declared() -> None:
    with pytest.raises(TypeError, match="struct can_bus_totals has"):

        @native.mirror("can_bus_totals")
        @dataclass(frozen=True)
        class Totals:
            frames: int
            damaged: int
            bits: int
            unacknowledged: int


def test_a_header_of_another_form_is_refused(tmp_path: Path) -> None:
    header = tmp_path / "odd.h"
    header.write_text("struct a { struct { int b; } c; };\n")
    with pytest.raises(ValueError, match="cannot read"):
        Headers(header)
