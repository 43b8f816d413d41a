"""A recording set as arrays: every run end to end, both wheels side by side, and the robot's pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.diagnose.data.joined_runs import JoinedRuns, join_runs
from truing.diagnose.data.motion import (
    best_heading,
    blank_stale,
    elapsed,
    initial_speeds,
    position_step,
    wheel_angles,
    wheel_travels,
)
from truing.diagnose.data.valid_rows import valid_rows, wheel_speeds
from truing.errors import IdentifyError
from truing.model.excitation import STILL_ROWS, Pieces, excitation
from truing.recording.baseline import Baseline
from truing.recording.run import (
    BATTERY_COLUMN,
    COMMAND_PAIR,
    EFFORT_PAIR,
    GYRO_COLUMN,
    MOTION_PAIRS,
    ODOMETRY_COLUMNS,
    TRUTH_COLUMNS,
    WHEELS,
    RecordingSet,
    SpeedSource,
)

# Pose windows of this length, s: an odometry error shows over seconds, a delay of a command over less.
POSE_HORIZON_S, COMMANDED_HORIZON_S = 2.0, 0.25

# Standard gravity, m/s^2.
GRAVITY = 9.80665


@dataclass(frozen=True, slots=True)
class SetData:
    """All runs of a set laid end to end, n rows in all; column 0 is the left wheel, column 1 the right.

    A segment is a stretch without a gap; each starts its own simulation. Rows that share a time stamp
    are one instant: the last of them stands.

    Attributes
    ----------
    names : the runs' names, in the order they were recorded.
    baseline : what the user's simulation knows.
    t_s : shape (n,), s, each run's own device time.
    elapsed_s : shape (n,), s, time since the first row of the first run, runs one right after the other.
    dt_s : shape (n,), s, the interval that ends at the row; the usual interval at a segment's first row.
    run_of_row : shape (n,), index into `names`.
    source_row : shape (n,), the row of the run's file.
    starts : shape (segments + 1,), first row of every segment, and n.
    run_of_segment : shape (segments,).
    interval_s : shape (segments,), s, the usual time between rows.
    effort : shape (n, 2), -1..1, mean over the interval that ends at the row.
    pieces : (left, right): the effort as the simulation sees it, cut where an edge fell inside a row.
    speed_mps : shape (n, 2), m/s, measured, mean over the interval (from the best source there is).
    valid : shape (n, 2), False where a row is not a valid measurement: a jump, a dead wheel.
    stands_for : shape (n, 2), rows of the recording that a row's measurement stands for: more than one
        where the recorder repeated it.
    source : the columns that the speed comes from.
    resolution_mps : one count per row; 0 where counts are not known.
    initial_mps : shape (segments, 2), m/s, speed at each segment's first row: 0 for a start at rest.
    travel_m : shape (n, 2), m, measured wheel travel since the start of the run.
    angle_rad : shape (n, 2), measured wheel angle, running on from run to run as the wheel does that
        nobody touches in between, or None where the wheel's radius is not known.
    origin_rad : shape (n, 2), the angle at which the row's run began, or None.
    recorded_vel_mps : shape (n, 2), the recorder's own speed column, or None.
    position_speed_mps : shape (n, 2), speed from counts or positions, or None.
    command : shape (n, 2), the command as it stands in the file, or None.
    battery_v : shape (n,), or None.
    truth : shape (n, 3), x m, y m, heading rad, from outside the robot (or the odometry of a commanded
        set without such); NaN where there is none.
    odometry : shape (n, 3), the board's own, NaN where there is none.
    gyro_radps : shape (n,), NaN where there is none.
    heading_rad : shape (n,), the best heading there is (zero at the start of a run unless true), or None.
    heading_source : "truth", "gyro", "odometry", "wheels", or "".
    commanded : wheel speeds are not used, and the pose is compared with what the efforts command.
    instant : each row holds the speed at its time, not the mean over its interval.
    sides : the columns that are simulated: both, or the left one that is a single axis.
    """

    names: tuple[str, ...]
    baseline: Baseline
    t_s: FloatArray
    elapsed_s: FloatArray
    dt_s: FloatArray
    run_of_row: IntArray
    source_row: IntArray
    starts: IntArray
    run_of_segment: IntArray
    interval_s: FloatArray
    effort: FloatArray
    pieces: tuple[Pieces, Pieces]
    speed_mps: FloatArray
    valid: BoolArray
    stands_for: FloatArray
    source: SpeedSource
    resolution_mps: float
    initial_mps: FloatArray
    travel_m: FloatArray
    angle_rad: FloatArray | None
    origin_rad: FloatArray | None
    recorded_vel_mps: FloatArray | None
    position_speed_mps: FloatArray | None
    command: FloatArray | None
    battery_v: FloatArray | None
    truth: FloatArray
    odometry: FloatArray
    gyro_radps: FloatArray
    heading_rad: FloatArray | None
    heading_source: str
    modes: tuple[tuple[str, ...] | None, ...] = field(default=())
    commanded: bool = False
    instant: bool = False
    sides: tuple[int, ...] = (0, 1)

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def runs(self) -> int:
        """How many runs there are."""
        return len(self.names)

    @property
    def segments(self) -> int:
        """How many stretches without a gap there are."""
        return len(self.starts) - 1

    @property
    def judged(self) -> BoolArray:
        """Rows on which a model is evaluated, shape (n,): not the initial state of a segment."""
        judged = np.ones(len(self), dtype=bool)
        judged[self.starts[:-1]] = False
        return judged

    @property
    def pose_horizon_s(self) -> float:
        """Length of the pose windows, s."""
        return COMMANDED_HORIZON_S if self.commanded else POSE_HORIZON_S

    @property
    def counted(self) -> BoolArray:
        """Valid rows on which a model of the wheels is evaluated, shape (n, 2)."""
        if self.commanded:
            return np.zeros_like(self.valid)
        return np.asarray(self.valid & self.judged[:, None])

    @property
    def judged_sides(self) -> tuple[int, ...]:
        """The columns with a valid measurement: those that the recordings say anything of.

        A pose that is compared with the commands says something of both.
        """
        found = tuple(w for w in self.sides if self.valid[:, w].any())
        return self.sides if self.commanded else found or self.sides

    @property
    def first(self) -> BoolArray:
        """First rows of segments, shape (n,)."""
        return np.asarray(~self.judged)

    @property
    def top_mps(self) -> float:
        """The larger full-effort speed of the baseline's two wheels, m/s."""
        return max(self.baseline.left.gain_mps, self.baseline.right.gain_mps)

    @property
    def duration_s(self) -> float:
        """Time over the whole set, s."""
        return float(self.elapsed_s[-1])

    @property
    def wheel_radius_m(self) -> float | None:
        """The baseline's wheel radius, m, or None."""
        return None if self.baseline.robot is None else self.baseline.robot.wheel_radius_m

    @property
    def has_truth(self) -> bool:
        """Whether any pose from outside the robot is there."""
        return bool(np.isfinite(self.truth).all(axis=1).sum() > 1)

    @property
    def has_gyro(self) -> bool:
        """Whether a yaw rate is there."""
        return bool(np.isfinite(self.gyro_radps).any())

    @property
    def has_pose(self) -> bool:
        """Whether anything from outside the wheels tells where the robot went or how it turned."""
        return self.has_truth or self.has_gyro

    def rows_of(self, run: int) -> BoolArray:
        """Rows of one run, shape (n,)."""
        return np.asarray(self.run_of_row == run)

    def acceleration_mps2(self) -> FloatArray:
        """Differenced measured speed, shape (n, 2), m/s^2; 0 at a segment's first two rows."""
        steps = np.zeros_like(self.speed_mps)
        steps[1:] = np.diff(self.speed_mps, axis=0) / self.dt_s[1:, None]
        steps[self.first] = 0.0
        steps[1:][self.first[:-1]] = 0.0
        return steps


def set_data(
    recordings: RecordingSet,
    *,
    commanded: bool = False,
    repeated: Sequence[BoolArray] | None = None,
) -> SetData:
    """Arrays of a recording set.

    Parameters
    ----------
    repeated : per run (n, 2), rows that are no new measurement of a wheel (`recorder.repeated_rows`).
    commanded : the pose is compared with the commands, wheel speeds are not used.

    Raises
    ------
    IdentifyError
        No baseline, no run, runs that give their speed in different ways, nothing but gaps.
    """
    baseline = recordings.baseline
    if baseline is None:
        raise IdentifyError(
            f"{recordings.name}: there is no baseline to compare with", "Give --model a baseline.toml"
        )
    source = _speed_source(recordings, baseline)
    instant = source == "vel" and all(run.instant for run in recordings.runs)
    joined = join_runs(recordings.runs)
    runs, starts, interval_s = joined.runs, joined.starts, joined.interval_s
    t_s = joined.join([run.t_s for run in runs])
    dt_s = joined.intervals(t_s)
    effort = joined.pair(EFFORT_PAIR)
    assert effort is not None
    measured = [wheel_speeds(run, baseline) for run in runs]
    speed = joined.join([np.stack(pair, axis=1) for pair in measured])
    travel = joined.join([wheel_travels(run, baseline) for run in runs])
    angle, origin = wheel_angles(joined, baseline)
    sides = tuple(WHEELS.index(wheel) for wheel in recordings.wheels)
    positions = _positions(joined, baseline, travel)
    truth, odometry = _poses(joined, travel, commanded, recordings.name)
    gyro = joined.column(GYRO_COLUMN)
    heading, heading_source = best_heading(joined, truth, gyro, odometry, travel, baseline, dt_s)
    return SetData(
        names=tuple(run.name for run in runs),
        baseline=baseline,
        t_s=t_s,
        elapsed_s=elapsed(joined),
        dt_s=dt_s,
        run_of_row=joined.run_of_row,
        source_row=joined.source_row,
        starts=starts,
        run_of_segment=joined.run_of_segment,
        interval_s=interval_s,
        effort=effort,
        pieces=held_pieces(t_s, effort, starts, interval_s),
        speed_mps=speed,
        valid=_valid(joined, baseline, measured, repeated) & np.isin((0, 1), sides),
        stands_for=_rows_of_measurements(joined, repeated),
        source=source,
        resolution_mps=_resolution(joined, baseline, source, travel),
        initial_mps=initial_speeds(t_s, effort, speed, starts, baseline, instant=instant),
        travel_m=travel,
        angle_rad=angle,
        origin_rad=origin,
        recorded_vel_mps=joined.pair(MOTION_PAIRS["vel"]),
        position_speed_mps=None if positions is None else joined.rates(positions, dt_s),
        command=joined.pair(COMMAND_PAIR),
        battery_v=joined.column(BATTERY_COLUMN),
        truth=truth,
        odometry=odometry,
        gyro_radps=np.full(len(t_s), np.nan) if gyro is None else gyro,
        heading_rad=heading,
        heading_source=heading_source,
        modes=tuple(run.mode for run in runs),
        commanded=commanded,
        instant=instant,
        sides=sides,
    )


def _speed_source(recordings: RecordingSet, baseline: Baseline) -> SpeedSource:
    """The columns that every run's speed comes from."""
    if not recordings.runs:
        raise IdentifyError(f"{recordings.name}: there is no run to diagnose")
    sources = {run.speed("left", baseline).source for run in recordings.runs}
    if len(sources) > 1:
        raise IdentifyError(f"the runs give their speed in different ways ({', '.join(sorted(sources))})")
    return sources.pop()


def _positions(joined: JoinedRuns, baseline: Baseline, travel: FloatArray) -> FloatArray | None:
    """Positions from counts, or as they were recorded, shape (n, 2), m."""
    if all(run.has_pair("ticks") for run in joined.runs) and baseline.metres_per_count is not None:
        return travel
    if all(run.has_pair("pos") for run in joined.runs):
        return joined.pair(MOTION_PAIRS["pos"])
    return None


def _poses(
    joined: JoinedRuns, travel: FloatArray, commanded: bool, name: str
) -> tuple[FloatArray, FloatArray]:
    """Reference pose and odometry of every row, both of shape (n, 3)."""
    truth = joined.pose(TRUTH_COLUMNS)
    blank_stale(truth, travel, joined.starts)
    odometry = joined.pose(ODOMETRY_COLUMNS)
    if commanded and not np.isfinite(truth).all(axis=1).any():
        truth = odometry.copy()
        if not np.isfinite(truth).all(axis=1).any():
            raise IdentifyError(
                f"{name}: there is no pose to compare with the commands",
                "Log truth_x_m, truth_y_m, truth_theta_rad, or the odometry as x_m, y_m, theta_rad",
            )
    return truth, odometry


def _valid(
    joined: JoinedRuns,
    baseline: Baseline,
    speeds: Sequence[tuple[FloatArray, FloatArray]],
    repeated: Sequence[BoolArray] | None,
) -> BoolArray:
    valid = valid_rows(joined.runs, baseline, speeds)
    if repeated is not None:
        valid = [mask & ~rows for mask, rows in zip(valid, repeated, strict=True)]
    return np.concatenate([mask[keep] for mask, keep in zip(valid, joined.rows, strict=True)])


def _rows_of_measurements(joined: JoinedRuns, repeated: Sequence[BoolArray] | None) -> FloatArray:
    """The time from each measurement of a wheel to the next over the usual interval, shape (n, 2)."""
    if repeated is None:
        return np.ones((len(joined.run_of_row), 2))
    usual_s = float(np.median([run.interval_s for run in joined.runs]))
    out = []
    for run, held in zip(joined.runs, repeated, strict=True):
        until_next = np.diff(run.t_s, append=run.t_s[-1] + run.interval_s)
        until_next[run.gaps() - 1] = run.interval_s
        row = np.arange(len(run))
        last = [np.maximum.accumulate(np.where(held[:, wheel], 0, row)) for wheel in (0, 1)]
        out.append(np.stack([np.bincount(at, until_next, len(run)) for at in last], axis=1) / usual_s)
    return joined.join(out)


def read_at_rows(data: SetData) -> SetData:
    """The set with speeds that were read at the rows' times, instead of averaged over their intervals."""
    initial = initial_speeds(data.t_s, data.effort, data.speed_mps, data.starts, data.baseline, instant=True)
    return replace(data, instant=True, initial_mps=initial)


def _resolution(joined: JoinedRuns, baseline: Baseline, source: SpeedSource, travel: FloatArray) -> float:
    """One count per row, m/s; 0 where counts are not known."""
    counts = [run.speed(wheel, baseline).resolution for run in joined.runs for wheel in WHEELS]
    step = position_step(travel, joined.starts) if source == "pos" else 0.0
    return max(float(np.median(counts)), step / float(np.median(joined.interval_s)))


def held_pieces(
    t_s: FloatArray,
    effort: FloatArray,
    starts: IntArray,
    interval_s: FloatArray,
    min_level_rows: int = STILL_ROWS,
) -> tuple[Pieces, Pieces]:
    """Each wheel's effort as the simulation sees it: held over a row, cut where an edge fell inside one.

    An edge lies between levels that last at least `min_level_rows`.
    """
    no_supply = np.zeros(len(t_s))
    left, right = (
        excitation(
            t_s, np.ascontiguousarray(effort[:, w]), no_supply, starts, interval_s, min_level_rows
        ).pieces
        for w in (0, 1)
    )
    return left, right
