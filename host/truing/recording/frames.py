"""Columns of any table in memory, of a frame library or not, and columns as a frame again."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from html import escape
from typing import Any, TypeAlias

import numpy as np

from truing.arrays import FloatArray
from truing.errors import TruingError

# A mapping of arrays, a structured array, or a frame: whatever has named columns and `table[name]`.
Table: TypeAlias = Any
_LIBRARIES = ("pandas", "polars")


def is_table(value: object) -> bool:
    """Whether a value has named columns: a mapping of arrays, a frame, a structured array."""
    if isinstance(value, Mapping):
        return bool(value) and not any(is_table(column) for column in value.values())
    return _names(value) is not None


def table_columns(table: Table) -> dict[str, Any]:
    """The columns of a table by name, each as an array of shape (n,) of whatever type it holds."""
    names = list(table) if isinstance(table, Mapping) else _names(table)
    assert names is not None
    return {str(name): np.asarray(table[name]) for name in names}


def to_frame(columns: Mapping[str, FloatArray]) -> Any:
    """Columns of shape (n,) as a pandas frame, or as a polars frame where pandas is not installed.

    Raises
    ------
    TruingError
        Neither library is installed.
    """
    for library in _LIBRARIES:
        try:
            return importlib.import_module(library).DataFrame(dict(columns))
        except ImportError:
            continue
    raise TruingError(
        "a frame needs pandas or polars, and neither is installed",
        "pip install pandas; or take the arrays themselves with to_dict()",
    )


def preformatted(text: str) -> str:
    """Text as HTML that keeps its lines, for notebooks."""
    return f"<pre>{escape(text)}</pre>"


def _names(table: object) -> list[Any] | None:
    fields = getattr(getattr(table, "dtype", None), "names", None)
    if fields:
        return list(fields)
    columns = getattr(table, "columns", None)
    if columns is None or callable(columns) or not hasattr(table, "__getitem__"):
        return None
    return list(columns)
