"""A run from columns in memory, checked as a run's CSV is (docs/DATA_FORMAT.md, 2)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import RecordingError
from truing.recording.axis import as_wheels, axis_of, names_of_wheels
from truing.recording.frames import Table, table_columns
from truing.recording.reader import check_header, check_time
from truing.recording.run import MINIMUM_ROWS, MODES, MOTION_PAIRS, Run, known_columns


def run_from_table(table: Table, name: str, *, motion: bool = True) -> Run:
    """A run from a mapping of arrays or a frame, whose columns have the names of a run's.

    Parameters
    ----------
    table : columns of shape (n,); the names that a run does not know are kept and ignored.
    name : of the run; errors begin with it.
    motion : whether wheel motion is required.

    Raises
    ------
    RecordingError
        Naming the run, and where it applies the column and the row.
    """
    path = Path(name)
    raw = table_columns(table)
    axis = axis_of(list(raw))
    names = list(raw) if axis is None else names_of_wheels(list(raw))
    if motion:
        check_header(path, names)
    else:
        check_header(path, list(dict.fromkeys([*names, *MOTION_PAIRS["vel"]])))
    shapes = {column: np.shape(values) for column, values in raw.items()}
    rows = shapes["t_s"]
    for column, shape in shapes.items():
        if len(shape) != 1 or shape != rows:
            raise RecordingError(path, f"shape {shape} where t_s has {rows}", column=column)
    if rows[0] < MINIMUM_ROWS:
        raise RecordingError(path, f"only {rows[0]} rows of data; at least {MINIMUM_ROWS} are needed")
    columns: dict[str, FloatArray] = {}
    text: dict[str, tuple[str, ...]] = {}
    mode: tuple[str, ...] | None = None
    for column, values in raw.items():
        if column == "mode":
            mode = _modes(path, values)
        elif column in known_columns(axis):
            columns[column] = _numbers(path, column, values)
        elif values.dtype.kind in "iufb":
            columns[column] = values.astype(np.float64)
        else:
            text[column] = tuple(map(str, values))
    check_time(path, columns["t_s"])
    if axis is not None:
        columns = as_wheels(columns)
        return Run(name, columns, mode, text, tuple(columns), axis=axis)
    return Run(name, columns, mode, text, tuple(raw))


def _numbers(path: Path, column: str, values: Any) -> FloatArray:
    if values.dtype.kind not in "iufbO":
        raise RecordingError(path, f"holds {values.dtype}, not numbers", column=column)
    try:
        numbers = values.astype(np.float64)
    except (TypeError, ValueError):
        row = next(number for number, value in enumerate(values, start=1) if not _is_number(value))
        raise RecordingError(path, f"{values[row - 1]!r} is not a number", column=column, row=row) from None
    bad = np.flatnonzero(~np.isfinite(numbers))
    if bad.size:
        raise RecordingError(
            path,
            f"{values[bad[0]]} is not a finite number",
            column=column,
            row=int(bad[0]) + 1,
            next_step="Drop the rows without a value; a gap in t_s is read as a gap",
        )
    return np.asarray(numbers, dtype=np.float64)


def _is_number(value: object) -> bool:
    try:
        float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return False
    return True


def _modes(path: Path, values: Any) -> tuple[str, ...]:
    modes = tuple(map(str, values))
    for row, value in enumerate(modes, start=1):
        if value not in MODES:
            raise RecordingError(
                path, f"{value!r} is not a mode (idle, effort or velocity)", column="mode", row=row
            )
    return modes
