"""Paths that the host makes hold on Windows too: joined as paths, of names that its file systems take.

What was not run: no machine with Windows or macOS is at hand; these are checks of source and names.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path, PureWindowsPath

import pytest

# Microsoft, "Naming Files, Paths, and Namespaces"; control characters apart.
FORBIDDEN = re.compile(r'[<>:"|?*\\]')
# Windows' devices, whatever ending follows.
DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{kind}{n}" for kind in ("COM", "LPT") for n in range(1, 10))}
PACKAGES = ("host/truing", "hil_sim/python/hil_sim", "protocol/python/truing_protocol")


def texts(node: ast.expr) -> list[str]:
    """The fixed parts of a string or an f-string."""
    parts = node.values if isinstance(node, ast.JoinedStr) else [node]
    return [part.value for part in parts if isinstance(part, ast.Constant) and isinstance(part.value, str)]


def joined(node: ast.expr) -> bool:
    """Whether an expression puts a path together as text."""
    if isinstance(node, ast.JoinedStr):
        return any("/" in text for text in texts(node))
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return any("/" in text for side in (node.left, node.right) for text in texts(side))
    return False


def faults(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Line and kind of what would not hold."""
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Name(id="Path" | "open"), args=arguments) if any(map(joined, arguments)):
                yield node.lineno, "a path put together as text"
            case ast.BinOp(op=ast.Div(), right=name) if any(map(FORBIDDEN.search, texts(name))):
                yield node.lineno, "a name that Windows does not take"


@pytest.mark.parametrize(
    ("source", "kind"),
    [
        ('Path(folder + "/run.csv")', "text"),
        ('Path(f"{folder}/{name}.csv")', "text"),
        ('folder / f"{hour}:{minute}.csv"', "name"),
        ('folder / "what?.csv"', "name"),
    ],
)
def test_the_rule_finds_what_it_is_for(source: str, kind: str) -> None:
    ((_, found),) = faults(ast.parse(source))
    assert kind in found


@pytest.mark.parametrize("package", PACKAGES)
def test_paths_are_joined_as_paths_from_names_that_windows_takes(root: Path, package: str) -> None:
    found = [
        f"{path.relative_to(root)}:{line}: {kind}"
        for path in sorted((root / package).rglob("*.py"))
        for line, kind in faults(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert not found


@pytest.mark.parametrize("folder", [*PACKAGES, "docs/example"])
def test_windows_can_hold_the_files_that_are_installed(root: Path, folder: str) -> None:
    names = [path.relative_to(root) for path in (root / folder).rglob("*") if "__pycache__" not in path.parts]
    for name in names:
        for part in PureWindowsPath(name).parts:
            assert not FORBIDDEN.search(part), name
            assert part.partition(".")[0].upper() not in DEVICES, name
            assert not part.endswith((".", " ")), name
    assert len({PureWindowsPath(name) for name in names}) == len(names), "names that differ by case alone"
