"""A run as an MCAP file that Foxglove opens: signals, pose and robot over the run's own time."""

from __future__ import annotations

import io
from pathlib import Path

from truing.errors import OutputError
from truing.extras import require
from truing.recording.axis import axis_names
from truing.recording.baseline import RobotGeometry
from truing.recording.run import ODOMETRY_COLUMNS, TRUTH_COLUMNS, WHEELS, RecordingSet, Run
from truing.recording.writer import replace_file

from .channels import Channels

SUFFIX = ".mcap"
# Unit by how a column's name ends; counts and efforts have names of their own.
_UNITS = {"_mps": "m/s", "_m": "m", "_rad": "rad", "_radps": "rad/s", "_v": "V", "_s": "s"}


def unit_of(column: str) -> str:
    """The unit that a column's name says; "" where it says none."""
    if column.startswith("effort_"):
        return "fraction of full effort"
    if column.startswith("ticks_"):
        return "counts"
    if column.startswith("cmd_"):
        return "effort or m/s, as mode says"
    return next((unit for ending, unit in _UNITS.items() if column.endswith(ending)), "")


def write_set(recordings: RecordingSet, out: str | Path) -> tuple[Path, ...]:
    """Write each run of a set: into the folder `out`, or, where it is one run, to the file `out`."""
    out = Path(out)
    if out.suffix.lower() == SUFFIX and not out.is_dir():
        if len(recordings) != 1:
            raise OutputError(
                out, f"is one file, and {recordings.name} has {len(recordings)} runs", "Give a folder"
            )
        return (write_mcap(recordings.runs[0], out, recordings.robot),)
    return tuple(write_mcap(run, out / f"{run.name}{SUFFIX}", recordings.robot) for run in recordings)


def write_mcap(run: Run, path: str | Path, robot: RobotGeometry | None = None) -> Path:
    """Write one run; the file's clock is the run's `t_s`, so that runs of a set lie over each other.

    Where a run has counts and the robot's geometry is known, `vel_left_mps` and `vel_right_mps` are there
    even if the run has no such columns: they are the speeds that everything else here computes with.
    """
    require("foxglove")
    import foxglove
    from foxglove.mcap import MCAPWriteOptions

    columns = dict(run.columns)
    for wheel in WHEELS:
        if f"vel_{wheel}_mps" not in columns and robot is not None and robot.metres_per_count is not None:
            columns[f"vel_{wheel}_mps"] = run.speed(wheel, robot).values
    shown = (
        dict(zip(columns, columns, strict=True)) if run.axis is None else axis_names(list(columns), run.axis)
    )
    rows = {shown[name]: columns[name].tolist() for name in shown}
    texts = dict(run.text_columns) | ({} if run.mode is None else {"mode": run.mode})
    file = io.BytesIO()
    context = foxglove.Context()
    # One thread: the bytes then depend on the run alone.
    with foxglove.open_mcap(file, context=context, writer_options=MCAPWriteOptions(compression_threads=0)):
        channels = Channels(
            context,
            {name: unit_of(name) for name in rows} | dict.fromkeys(texts, ""),
            None if robot is None else robot.wheelbase_m,
        )
        has_pose, has_outside = (
            all(name in rows for name in pose) for pose in (ODOMETRY_COLUMNS, TRUTH_COLUMNS)
        )
        for row, t_s in enumerate(rows["t_s"]):
            time_ns = round(1e9 * t_s)
            values = {name: column[row] for name, column in rows.items()}
            channels.signals(time_ns, values | {name: column[row] for name, column in texts.items()})
            if has_pose:
                channels.pose(time_ns, *(values[name] for name in ODOMETRY_COLUMNS))
                if row == 0:
                    channels.robot(time_ns)
            if has_outside:
                channels.outside_pose(time_ns, *(values[name] for name in TRUTH_COLUMNS))
    replace_file(path, file.getvalue())
    return Path(path)
