"""Recordings in memory: one run, and a set of runs (docs/DATA_FORMAT.md, 1 and 2)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from truing.arrays import FloatArray
from truing.errors import IdentifyError
from truing.recording.axis import AXIS_COLUMNS, Axis, Motion
from truing.recording.baseline import Baseline, RobotGeometry
from truing.recording.frames import preformatted, to_frame

if TYPE_CHECKING:
    from truing.recording.held_load import HeldLoad

Wheel: TypeAlias = Literal["left", "right"]
SpeedSource: TypeAlias = Literal["ticks", "vel", "pos"]
# What says how far a wheel travels per encoder count.
Geometry: TypeAlias = Baseline | RobotGeometry

WHEELS: tuple[Wheel, Wheel] = ("left", "right")
MODES = ("idle", "effort", "velocity")
MINIMUM_ROWS = 20

MOTION_PAIRS: dict[SpeedSource, tuple[str, str]] = {
    "ticks": ("ticks_left", "ticks_right"),
    "vel": ("vel_left_mps", "vel_right_mps"),
    "pos": ("pos_left_m", "pos_right_m"),
}
EFFORT_PAIR = ("effort_left", "effort_right")
REQUIRED_COLUMNS = ("t_s", *EFFORT_PAIR)
COMMAND_PAIR = ("cmd_left", "cmd_right")
# The board's own pose, one from outside the robot, and the yaw rate.
ODOMETRY_COLUMNS = ("x_m", "y_m", "theta_rad")
TRUTH_COLUMNS = ("truth_x_m", "truth_y_m", "truth_theta_rad")
GYRO_COLUMN = "gyro_z_radps"
BATTERY_COLUMN = "battery_v"
OPTIONAL_COLUMNS = (*COMMAND_PAIR, *ODOMETRY_COLUMNS, BATTERY_COLUMN, *TRUTH_COLUMNS, GYRO_COLUMN)
NUMERIC_COLUMNS = frozenset(
    REQUIRED_COLUMNS + OPTIONAL_COLUMNS + tuple(name for pair in MOTION_PAIRS.values() for name in pair)
)

_NUMERIC_OF_AXIS = NUMERIC_COLUMNS | frozenset(AXIS_COLUMNS)


def known_columns(axis: Axis | None) -> frozenset[str]:
    """Columns of numbers that a run knows, in the file's names: of two wheels, or of an axis as well."""
    return NUMERIC_COLUMNS if axis is None else _NUMERIC_OF_AXIS


# A pause this many times the usual sampling interval is a gap: what happened inside it is unknown.
GAP_FACTOR = 3.0


@dataclass(frozen=True, slots=True)
class RunMetadata:
    """How a run came about; kept beside its CSV and never needed to read it.

    `extra` keeps whatever else the file holds, so that reading and writing lose nothing.
    """

    firmware: dict[str, Any] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    plan: dict[str, Any] = field(default_factory=dict)
    seed: int | None = None
    pause_before_s: float | None = None
    extra: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class WheelSpeed:
    """Speed of one wheel at the rim.

    Attributes
    ----------
    values : shape (n,), m/s; row k is the mean over the interval that ends at `t_s[k]`.
    source : the pair of columns that it comes from.
    resolution : one encoder count per row, m/s; 0 where counts are not known.
    """

    values: FloatArray
    source: SpeedSource
    resolution: float


@dataclass(frozen=True, slots=True)
class Run:
    """One run: columns of equal length n, sorted by time.

    Attributes
    ----------
    name : the file's name without `.csv`; it orders the runs of a set.
    columns : every column that holds numbers, by its name in the file, each of shape (n,).
    mode : `idle`, `effort` or `velocity` per row, or None when the file does not say.
    text_columns : unknown columns that do not hold numbers, as they stand.
    order : all column names in the file's order.
    axis : where it is one motor or axis: both sides hold its numbers (see `recording.axis`).
    instant : its speeds were read at the rows' times, not averaged over the rows (`identify.row_sampling`).
    """

    name: str
    columns: dict[str, FloatArray]
    mode: tuple[str, ...] | None = None
    text_columns: dict[str, tuple[str, ...]] = field(default_factory=dict)
    order: tuple[str, ...] = ()
    path: Path | None = None
    metadata: RunMetadata | None = None
    warnings: tuple[str, ...] = ()
    axis: Axis | None = None
    instant: bool = False

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def t_s(self) -> FloatArray:
        """Device time, shape (n,), s; it never decreases."""
        return self.columns["t_s"]

    @property
    def duration_s(self) -> float:
        """Time from the first row to the last, s."""
        return float(self.t_s[-1] - self.t_s[0])

    @property
    def interval_s(self) -> float:
        """The usual time between rows (median), s."""
        steps = np.diff(self.t_s)
        steps = steps[steps > 0.0]
        return float(np.median(steps)) if steps.size else 0.0

    @property
    def rate_hz(self) -> float:
        """The usual sampling rate, Hz, to six digits; times may be rounded: 33, 33, 34 ms are 30 Hz."""
        steps, usual = np.diff(self.t_s), self.interval_s
        regular = steps[(steps > 0.5 * usual) & (steps < 1.5 * usual)]
        return float(f"{1.0 / float(regular.mean()):.6g}") if regular.size else 0.0

    def of_axis(self, axis: Axis) -> Run:
        """The run taken as one axis: the left wheel's columns stand for the right one's too."""
        columns = dict(self.columns)
        pairs = (EFFORT_PAIR, COMMAND_PAIR, *MOTION_PAIRS.values())
        for left, right in pairs:
            if left in columns:
                columns[right] = columns[left]
        pose = {*ODOMETRY_COLUMNS, *TRUTH_COLUMNS, GYRO_COLUMN}
        kept = {name: values for name, values in columns.items() if name not in pose}
        return replace(self, columns=kept, order=tuple(kept), axis=axis)

    def to_dict(self) -> dict[str, FloatArray]:
        """The columns that hold numbers, each of shape (n,), by name: what any frame library takes."""
        return dict(self.columns)

    def to_frame(self) -> Any:
        """The columns that hold numbers as a pandas (else polars) frame of n rows.

        Raises
        ------
        TruingError
            Neither library is installed.
        """
        return to_frame(self.columns)

    def __str__(self) -> str:
        rate = f"{self.rate_hz:.4g} Hz"
        return f"{self.name}: {len(self)} rows, {self.duration_s:.4g} s at {rate}"

    def gaps(self) -> NDArray[np.intp]:
        """Rows (index into the arrays) that come right after a gap, in order."""
        return np.flatnonzero(np.diff(self.t_s) > GAP_FACTOR * self.interval_s) + 1

    def effort(self, wheel: Wheel) -> FloatArray:
        """Applied effort, shape (n,), -1..1, mean over the interval that ends at each row."""
        return self.columns[f"effort_{wheel}"]

    def command(self, wheel: Wheel) -> FloatArray | None:
        """The command, shape (n,), effort fraction or m/s as `mode` says, or None."""
        return self.columns.get(f"cmd_{wheel}")

    def has_pair(self, source: SpeedSource) -> bool:
        """Whether both columns of a motion pair are there."""
        return all(name in self.columns for name in MOTION_PAIRS[source])

    def pose(self) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """On-board odometry x (m), y (m), theta (rad), each of shape (n,), or None."""
        if not all(name in self.columns for name in ODOMETRY_COLUMNS):
            return None
        x_m, y_m, theta_rad = (self.columns[name] for name in ODOMETRY_COLUMNS)
        return x_m, y_m, theta_rad

    def travel(self, wheel: Wheel, baseline: Geometry | None) -> FloatArray | None:
        """Wheel travel at the rim since the first row, shape (n,), m.

        From counts (with the baseline's radius and counts per revolution), else from positions,
        else from the integrated speed.
        """
        scale = None if baseline is None else baseline.metres_per_count
        if self.has_pair("ticks") and scale is not None:
            travel = self.columns[f"ticks_{wheel}"] * scale
        elif self.has_pair("pos"):
            travel = self.columns[f"pos_{wheel}_m"]
        elif self.has_pair("vel"):
            steps = np.diff(self.t_s, prepend=self.t_s[0])
            travel = np.cumsum(self.columns[f"vel_{wheel}_mps"] * steps)
        else:
            return None
        from_start: FloatArray = travel - travel[0]
        return from_start

    def speed(self, wheel: Wheel, baseline: Geometry | None = None) -> WheelSpeed:
        """Wheel speed from the best source that the run has.

        Counts come first: they are exact, and no filter has touched them. Then the speed that
        the recorder reports. Differenced positions come last: recorders that log both tend to
        repeat or reset positions, which turns into spikes (measured on real recordings).
        """
        scale = None if baseline is None else baseline.metres_per_count
        if self.has_pair("ticks") and scale is not None:
            values = _difference(self.t_s, self.columns[f"ticks_{wheel}"] * scale)
            return WheelSpeed(values, "ticks", scale * self.rate_hz)
        if self.has_pair("vel"):
            values = self.columns[f"vel_{wheel}_mps"]
            return WheelSpeed(values, "vel", 0.0)
        if self.has_pair("pos"):
            travel = self.columns[f"pos_{wheel}_m"]
            return WheelSpeed(_difference(self.t_s, travel), "pos", 0.0)
        raise IdentifyError(
            f"{self.path or self.name}: it has encoder counts only, and nothing says how far one count is",
            "Give --counts-per-rev and --wheel-radius (truing.read: counts_per_rev, wheel_radius_m), or "
            "--model a baseline.toml whose [robot] has both",
        )


@dataclass(frozen=True, slots=True)
class RecordingSet:
    """Runs of one robot in the order they were recorded, with the baseline beside them, if any.

    Attributes
    ----------
    geometry : of the robot where it was given without a baseline, or to correct one.
    held_load : what was taken out of the efforts of an axis that holds a load (see `recording.held_load`).
    """

    name: str
    runs: tuple[Run, ...]
    baseline: Baseline | None = None
    path: Path | None = None
    geometry: RobotGeometry | None = None
    held_load: HeldLoad | None = None

    @property
    def robot(self) -> RobotGeometry | None:
        """The robot's geometry as given, else as the baseline has it, or None."""
        if self.geometry is not None or self.baseline is None:
            return self.geometry
        return self.baseline.robot

    def __str__(self) -> str:
        total = sum(run.duration_s for run in self.runs)
        count = "1 run" if len(self) == 1 else f"{len(self)} runs"
        known = "with a baseline" if self.baseline is not None else "without a baseline"
        return "\n".join(
            [f"{self.name}: {count}, {total:.4g} s, {known}", *(f"  {run}" for run in self.runs)]
        )

    def _repr_html_(self) -> str:
        return preformatted(str(self))

    def with_geometry(self, given: RobotGeometry) -> RecordingSet:
        """The same runs of a robot with these numbers; what is not given stays as it is known."""
        robot = given.or_else(self.robot)
        baseline = None if self.baseline is None else replace(self.baseline, robot=robot)
        return replace(self, geometry=robot, baseline=baseline)

    def __iter__(self) -> Iterator[Run]:
        return iter(self.runs)

    def __len__(self) -> int:
        return len(self.runs)

    @property
    def axis(self) -> Axis | None:
        """The single axis that all runs are of, or None."""
        found = {run.axis for run in self.runs}
        return next(iter(found)) if len(found) == 1 else None

    @property
    def wheels(self) -> tuple[Wheel, ...]:
        """The wheels to compute: both, or the left one that stands for a single axis."""
        return WHEELS if self.axis is None else WHEELS[:1]

    def of_axis(self, motion: Motion | None) -> RecordingSet:
        """The same runs taken as one motor or axis, whose numbers are the left wheel's; None: as they are."""
        if motion is None:
            return self
        return replace(self, runs=tuple(run.of_axis(Axis(motion)) for run in self.runs))

    @property
    def is_from_board(self) -> bool:
        """Whether a board of ours recorded it: its logs carry the firmware's version."""
        return any(run.metadata is not None and bool(run.metadata.firmware) for run in self.runs)

    def without_pose(self) -> RecordingSet:
        """The same runs without the signals from outside the wheels."""
        outside = (*TRUTH_COLUMNS, GYRO_COLUMN)
        return replace(
            self,
            runs=tuple(
                replace(run, columns={n: v for n, v in run.columns.items() if n not in outside})
                for run in self.runs
            ),
        )


def _difference(t_s: FloatArray, travel: FloatArray) -> FloatArray:
    """Mean speed per interval, shape (n,); row 0 repeats row 1.

    Rows with the same time stamp share the speed of the interval that ends there.
    """
    last_of_time = np.flatnonzero(np.append(np.diff(t_s) > 0.0, True))
    times = t_s[last_of_time]
    if times.size < 2:
        return np.zeros_like(t_s)
    with np.errstate(over="ignore"):
        speed = np.diff(travel[last_of_time]) / np.diff(times)
    speed = np.concatenate((speed[:1], speed))
    return speed[np.searchsorted(times, t_s)]
