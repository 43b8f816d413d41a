"""Turns the board's integer records into a run as docs/DATA_FORMAT.md defines it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from truing.arrays import FloatArray
from truing.recording.run import (
    BATTERY_COLUMN,
    COMMAND_PAIR,
    EFFORT_PAIR,
    MOTION_PAIRS,
    ODOMETRY_COLUMNS,
    Run,
    RunMetadata,
)
from truing_protocol import Mode

# Column of a run: field of the record, and how many of its units make one of the column's.
_SCALED = {
    "t_s": ("t_ms", 1e3),
    "effort_left": ("effort_left", 1e4),
    "effort_right": ("effort_right", 1e4),
    "ticks_left": ("counts_left", 1.0),
    "ticks_right": ("counts_right", 1.0),
    "vel_left_mps": ("speed_left", 1e3),
    "vel_right_mps": ("speed_right", 1e3),
    "x_m": ("x_mm", 1e3),
    "y_m": ("y_mm", 1e3),
    "theta_rad": ("theta_e4", 1e4),
    "battery_v": ("battery_10mv", 1e2),
    "segment": ("segment", 1.0),
    "faults": ("faults", 1.0),
}
LOG_COLUMNS = (
    "t_s",
    "mode",
    *COMMAND_PAIR,
    *EFFORT_PAIR,
    *MOTION_PAIRS["ticks"],
    *MOTION_PAIRS["vel"],
    *ODOMETRY_COLUMNS,
    BATTERY_COLUMN,
    "segment",
    "faults",
)


def run_from_records(records: npt.NDArray[np.void], name: str, metadata: RunMetadata | None = None) -> Run:
    """Return the run that a log's records are.

    Parameters
    ----------
    records : shape (n,), dtype `truing_protocol.LOG_RECORD_DTYPE`.

    Time, counts and pose are taken relative to the first record, which is the log's own start
    unless the ring has overwritten it.
    """
    columns: dict[str, FloatArray] = {}
    for column, (field, per_unit) in _SCALED.items():
        columns[column] = records[field].astype(np.float64) / per_unit
    if len(records):
        for column in ("t_s", "ticks_left", "ticks_right"):
            # Differences of the integers, so that the columns stay exact.
            field, per_unit = _SCALED[column]
            values = records[field].astype(np.int64)
            columns[column] = (values - values[0]) / per_unit
    mode = tuple(Mode(value).name.lower() for value in records["mode"].tolist())
    is_velocity = records["mode"] == Mode.VELOCITY
    for side in ("left", "right"):
        raw = records[f"cmd_{side}"].astype(np.float64)
        columns[f"cmd_{side}"] = np.where(is_velocity, raw / 1e3, raw / 1e4)
    return Run(name=name, columns=columns, mode=mode, order=LOG_COLUMNS, metadata=metadata)
