"""Errors survive the way between processes, whatever they carry, and stand in one file."""

from __future__ import annotations

import ast
import builtins
import pickle
from pathlib import Path

from truing import errors
from truing.errors import FileError, TruingError


def test_an_error_of_a_worker_process_arrives_whole() -> None:
    error = FileError("runs/a.csv", "cannot be read", "Check the path")
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is FileError
    assert (str(copy), copy.path, copy.next_step) == (str(error), error.path, "Check the path")
    assert copy.exit_code == TruingError.exit_code


def test_every_exception_of_the_package_stands_in_one_file(root: Path) -> None:
    defined = vars(builtins) | vars(errors)
    known = {name for name, kind in defined.items() if _is_exception(kind)}
    elsewhere = [
        f"{path.relative_to(root)}: {node.name}"
        for path in (root / "host/truing").rglob("*.py")
        if path.name != "errors.py"
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ClassDef) and known & {ast.unparse(base) for base in node.bases}
    ]
    assert elsewhere == []


def _is_exception(kind: object) -> bool:
    return isinstance(kind, type) and issubclass(kind, BaseException)
