"""A table of any kind of file, with a pose from a second file beside it where there is one."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import RecordingError

from .mapping import LONGEST_POSE_GAP_S
from .text_table import TextTable, read_text_table

# What a pose's columns are called in the joined table: `column_guess` knows them as measured from outside.
POSE_NAMES = {"x": "truth x", "y": "truth y", "heading": "truth heading"}

# A larger file is read each time, and its table is not kept in memory.
_KEPT_BYTES = 30_000_000


def read_table(path: Path, pose: Path | None = None) -> TextTable:
    """The table of a text or .mat file.

    Parameters
    ----------
    pose : a table of time and pose on the same clock; its columns are interpolated to the rows of `path`.

    Raises
    ------
    RecordingError : a file is no table, or the two share no time; names the file.
    """
    table = _read(path)
    return table if pose is None else _with_pose(table, _read(pose))


def columns_of(table: TextTable) -> dict[str, Any]:
    """All columns by name, as `mapping.apply` takes them."""
    return {**table.numbers, **table.texts}


def _read(path: Path) -> TextTable:
    """A file's table; the last ones are kept: proposal, preview and import read the same file."""
    try:
        seen = path.stat()
    except OSError:
        return _read_file(path)
    if seen.st_size > _KEPT_BYTES:
        return _read_file(path)
    return _read_once(path, seen.st_mtime_ns, seen.st_size, seen.st_ino)


@lru_cache(maxsize=4)
def _read_once(path: Path, *_state: int) -> TextTable:
    """The same as `_read_file` while time, size and place of the file are the same; nobody may change it."""
    table = _read_file(path)
    for values in table.numbers.values():
        values.flags.writeable = False
    return table


def _read_file(path: Path) -> TextTable:
    from . import matlab

    if path.suffix.lower() != ".mat":
        return read_text_table(path)
    vectors = matlab.read_vectors(path)
    rows = len(next(iter(vectors.values())))
    return TextTable(path, vectors, {}, {}, tuple(range(1, rows + 1)))


def _with_pose(table: TextTable, pose: TextTable) -> TextTable:
    from .column_guess import guess_columns

    clocks = [
        next((column.name for column in guess_columns(one) if column.kind == "time"), None)
        for one in (table, pose)
    ]
    found = {column.kind: column.name for column in reversed(guess_columns(pose))}
    if clocks[0] is None or clocks[1] is None or not {"x", "y"} <= found.keys():
        lacking = pose if clocks[0] is not None else table
        raise RecordingError(
            lacking.path,
            f"no time and pose in its columns: {', '.join(lacking.names)}",
            next_step="Both files need a column of time, that of the pose also x and y (and heading)",
        )
    at, seen = table.numbers[clocks[0]], pose.numbers[clocks[1]]
    joined = {
        name: _between(at, seen, pose.numbers[found[kind]], turns=kind == "heading")
        for kind, name in POSE_NAMES.items()
        if kind in found
    }
    known = np.isfinite(joined[POSE_NAMES["x"]])
    if not known.any():
        raise RecordingError(
            pose.path,
            f"shares no time with {table.path.name}: {seen[0]:g} to {seen[-1]:g}, {at[0]:g} to {at[-1]:g}",
            next_step="Both files must be on the same clock, in the same unit",
        )
    inside = np.flatnonzero(known)
    rows = slice(int(inside[0]), int(inside[-1]) + 1)
    units = {name: pose.units.get(found[kind], "") for kind, name in POSE_NAMES.items() if kind in found}
    unseen = int(np.sum(~known[rows]))
    note = f"pose of {pose.path.name}: {unseen} of {known[rows].size} rows lie in gaps of more than "
    note += f"{LONGEST_POSE_GAP_S:g} s"
    return replace(
        table,
        numbers={name: values[rows] for name, values in (table.numbers | joined).items()},
        texts={name: cells[rows] for name, cells in table.texts.items()},
        units=table.units | {name: unit for name, unit in units.items() if unit},
        lines=table.lines[rows],
        notes=(*table.notes, note),
    )


def _between(at: FloatArray, seen: FloatArray, values: FloatArray, *, turns: bool) -> FloatArray:
    """A pose's values at other times, shape (n,); NaN between samples that lie too far apart."""
    known = np.isfinite(values) & np.isfinite(seen)
    seen, values = seen[known], values[known]
    if seen.size < 2:
        return np.full_like(at, np.nan)
    after = np.clip(np.searchsorted(seen, at), 1, len(seen) - 1)
    found = np.interp(at, seen, np.unwrap(values) if turns else values, left=np.nan, right=np.nan)
    return np.where(seen[after] - seen[after - 1] <= LONGEST_POSE_GAP_S, found, np.nan)
