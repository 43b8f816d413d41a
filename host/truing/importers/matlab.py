"""MATLAB .mat files (up to version 7): vectors by the names of a run's columns or through a mapping."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import RecordingError
from truing.recording.run import NUMERIC_COLUMNS

from .foreign import Finding, ForeignTest, ImportOptions
from .mapped_csv import find_mapping
from .mapping import Mapping, Source, apply
from .tables import columns_of, read_table

KIND = "MATLAB .mat"


def matches(path: Path, head: bytes) -> bool:
    """Whether the file is called so or says so itself."""
    return path.suffix.lower() == ".mat" or head.startswith(b"MATLAB")


def read(path: Path, options: ImportOptions) -> tuple[list[ForeignTest], list[Finding]]:
    """The vectors of the longest common length; matrices and scalars are left aside."""
    table = read_vectors(path)
    if options.mapping is None and _is_own(table):
        own = {name: Source(name) for name in table if name in NUMERIC_COLUMNS}
        return apply(Mapping(path, own), table, path), []
    mapping = find_mapping(path, options)
    if options.pose is not None:
        return apply(mapping, columns_of(read_table(path, options.pose)), path), []
    return apply(mapping, table, path), []


def has_own_columns(path: Path) -> bool:
    """Whether the vectors have the names of a run's columns, so that no mapping is needed."""
    return _is_own(read_vectors(path))


def _is_own(table: dict[str, FloatArray]) -> bool:
    return {"t_s", "effort_left", "effort_right"} <= table.keys()


def read_vectors(path: Path) -> dict[str, FloatArray]:
    """Every numeric vector of the longest length, shape (n,); struct fields as `name.field`."""
    import scipy.io

    try:
        data = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)
    except NotImplementedError:
        raise RecordingError(
            path, "a version 7.3 .mat file", next_step="In MATLAB, save it with the option -v7"
        ) from None
    except Exception as error:
        # A damaged file makes scipy's reader fail in many ways, each with an exception of its own.
        raise RecordingError(path, f"not readable as a .mat file, damaged or cut off: {error}") from None
    vectors: dict[str, np.ndarray[Any, Any]] = {}
    for name, value in data.items():
        if not name.startswith("__"):
            _collect(vectors, name, value)
    if not vectors:
        raise RecordingError(path, "holds no numeric vector")
    length = max(len(vector) for vector in vectors.values())
    return {name: vector for name, vector in vectors.items() if len(vector) == length}


def _collect(vectors: dict[str, np.ndarray[Any, Any]], name: str, value: Any) -> None:
    if isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "fiu" and value.size > 1:
        vectors[name] = value.astype(np.float64)
    for part in getattr(value, "_fieldnames", ()):
        _collect(vectors, f"{name}.{part}", getattr(value, part))
