"""A recording set as arrays: every run end to end, both wheels side by side, and the robot's pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.diagnose.data.valid_rows import carried_over, valid_rows
from truing.errors import IdentifyError
from truing.model.excitation import STILL_ROWS, Pieces, excitation
from truing.recording.baseline import Baseline
from truing.recording.run import MOTION_PAIRS, WHEELS, RecordingSet, Run, SpeedSource

# Rows of the shortest segment: fewer hold an initial state and no information about a model.
MINIMUM_SEGMENT_ROWS = 4

# A segment whose first rows are slower than this share of full speed starts at rest.
AT_REST_SHARE = 0.01

# Positions with finer steps than this, m, are not made from counts.
MIN_POSITION_STEP_M = 1e-5

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
    baseline: Baseline | None = None,
    *,
    commanded: bool = False,
    repeated: Sequence[BoolArray] | None = None,
) -> SetData:
    """Arrays of a recording set.

    Parameters
    ----------
    baseline : what the user's simulation knows; the set's own where None.
    repeated : per run (n, 2), rows that are no new measurement of a wheel (`recorder.repeated_rows`).
    commanded : the pose is compared with the commands, wheel speeds are not used.

    Raises
    ------
    IdentifyError
        No baseline, no run, runs that give their speed in different ways, nothing but gaps.
    """
    baseline = recordings.baseline if baseline is None else baseline
    if baseline is None:
        raise IdentifyError(
            f"{recordings.name}: there is no baseline to compare with", "Give --model a baseline.toml"
        )
    if not recordings.runs:
        raise IdentifyError(f"{recordings.name}: there is no run to diagnose")
    cuts = [_cut(run) for run in recordings.runs]
    sources = {run.speed("left", baseline).source for run in recordings.runs}
    if len(sources) > 1:
        raise IdentifyError(f"the runs give their speed in different ways ({', '.join(sorted(sources))})")
    source = sources.pop()
    runs = recordings.runs
    if not any(rows for rows in cuts):
        raise IdentifyError("the runs hold nothing but gaps")

    rows_of_run = [np.concatenate(pieces) if pieces else np.zeros(0, np.int64) for pieces in cuts]
    lengths = [len(piece) for pieces in cuts for piece in pieces]
    starts = np.concatenate(([0], np.cumsum(lengths))).astype(np.int64)
    run_of_segment = np.repeat(np.arange(len(runs)), [len(pieces) for pieces in cuts]).astype(np.int64)

    def column(name: str) -> FloatArray | None:
        if not all(name in run.columns for run in runs):
            return None
        return _join([run.columns[name] for run in runs], rows_of_run)

    def pair(names: tuple[str, str]) -> FloatArray | None:
        columns = [column(name) for name in names]
        if columns[0] is None or columns[1] is None:
            return None
        return np.ascontiguousarray(np.stack([columns[0], columns[1]], axis=1))

    def both(values: list[tuple[FloatArray, FloatArray]]) -> FloatArray:
        return np.ascontiguousarray(
            np.stack([_join([item[w] for item in values], rows_of_run) for w in (0, 1)], axis=1)
        )

    t_s = _join([run.t_s for run in runs], rows_of_run)
    run_of_row = np.repeat(np.arange(len(runs)), [len(rows) for rows in rows_of_run]).astype(np.int64)
    interval_s = np.array([runs[k].interval_s for k in run_of_segment])
    dt_s = np.empty_like(t_s)
    dt_s[1:] = np.diff(t_s)
    dt_s[starts[:-1]] = interval_s
    effort = pair(("effort_left", "effort_right"))
    assert effort is not None
    speeds = [tuple(run.speed(wheel, baseline) for wheel in WHEELS) for run in runs]
    values = [(left.values, right.values) for left, right in speeds]
    speed = both(values)
    travel = both([_travels(run, baseline) for run in runs])
    radius = None if baseline.robot is None else baseline.robot.wheel_radius_m
    angle, origin = (None, None) if radius is None else _angles(runs, baseline, rows_of_run, radius)
    scale = baseline.metres_per_count
    positions: FloatArray | None = None
    if all(run.has_pair("ticks") for run in runs) and scale is not None:
        positions = travel
    elif all(run.has_pair("pos") for run in runs):
        positions = pair(MOTION_PAIRS["pos"])
    truth = _pose(runs, rows_of_run, ("truth_x_m", "truth_y_m", "truth_theta_rad"))
    _blank_stale(truth, travel, starts)
    odometry = _pose(runs, rows_of_run, ("x_m", "y_m", "theta_rad"))
    if commanded and not np.isfinite(truth).all(axis=1).any():
        truth = odometry.copy()
        if not np.isfinite(truth).all(axis=1).any():
            raise IdentifyError(
                f"{recordings.name}: there is no pose to compare with the commands",
                "Log truth_x_m, truth_y_m, truth_theta_rad, or the odometry as x_m, y_m, theta_rad",
            )
    valid = valid_rows(runs, baseline, values)
    if repeated is not None:
        valid = [mask & ~rows for mask, rows in zip(valid, repeated, strict=True)]
    gyro = column("gyro_z_radps")
    gyro_radps = np.full(len(t_s), np.nan) if gyro is None else gyro
    heading, heading_source = _heading(truth, gyro, odometry, travel, baseline, starts, dt_s)
    return SetData(
        names=tuple(run.name for run in runs),
        baseline=baseline,
        t_s=t_s,
        elapsed_s=_elapsed(runs, rows_of_run),
        dt_s=dt_s,
        run_of_row=run_of_row,
        source_row=np.concatenate(rows_of_run).astype(np.int64),
        starts=starts,
        run_of_segment=run_of_segment,
        interval_s=interval_s,
        effort=effort,
        pieces=held_pieces(t_s, effort, starts, interval_s),
        speed_mps=speed,
        valid=np.concatenate([mask[keep] for mask, keep in zip(valid, rows_of_run, strict=True)]),
        source=source,
        resolution_mps=max(
            float(np.median([item.resolution for both_ in speeds for item in both_])),
            _position_step(travel, starts) / float(np.median(interval_s)) if source == "pos" else 0.0,
        ),
        initial_mps=_initial(t_s, effort, speed, starts, baseline),
        travel_m=travel,
        angle_rad=angle,
        origin_rad=origin,
        recorded_vel_mps=pair(MOTION_PAIRS["vel"]),
        position_speed_mps=None if positions is None else _speed_of(positions, starts, dt_s),
        command=pair(("cmd_left", "cmd_right")),
        battery_v=column("battery_v"),
        truth=truth,
        odometry=odometry,
        gyro_radps=gyro_radps,
        heading_rad=heading,
        heading_source=heading_source,
        modes=tuple(run.mode for run in runs),
        commanded=commanded,
    )


def _position_step(travel: FloatArray, starts: IntArray) -> float:
    """Resolution of positions made from counts (n, 2), m; 0 where there is none."""
    steps = np.abs(np.diff(travel, axis=0))
    steps[starts[1:-1] - 1] = 0.0
    steps = steps[steps > MIN_POSITION_STEP_M]
    if not len(steps):
        return 0.0
    step = float(np.min(steps))
    deviation = np.abs(steps / step - np.round(steps / step))
    return step if float(np.percentile(deviation, 90)) < 0.05 else 0.0


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


def _cut(run: Run) -> list[IntArray]:
    """The rows of a run's segments: gaps cut, repeated time stamps merged, scraps left out."""
    keep = np.append(np.diff(run.t_s) > 0.0, True)
    after_gap = np.zeros(len(run), dtype=bool)
    after_gap[run.gaps()] = True
    rows = np.flatnonzero(keep).astype(np.int64)
    # A gap before a repeated stamp belongs to the row of that stamp that stands.
    gap_of_row = np.add.reduceat(after_gap, np.concatenate(([0], rows[:-1] + 1))) > 0
    bounds = [0, *np.flatnonzero(gap_of_row).tolist(), len(rows)]
    return [rows[a:b] for a, b in pairwise(bounds) if b - a >= MINIMUM_SEGMENT_ROWS]


def _join(columns: Sequence[FloatArray], rows: Sequence[IntArray]) -> FloatArray:
    joined = np.concatenate([column[keep] for column, keep in zip(columns, rows, strict=True)])
    return np.ascontiguousarray(joined, dtype=np.float64)


def _travels(run: Run, baseline: Baseline) -> tuple[FloatArray, FloatArray]:
    left, right = run.travel("left", baseline), run.travel("right", baseline)
    assert left is not None  # a run without any motion pair is refused when it is read
    assert right is not None
    return left, right


def _angles(
    runs: Sequence[Run], baseline: Baseline, rows: Sequence[IntArray], radius: float
) -> tuple[FloatArray, FloatArray]:
    """Wheel angles running on from run to run, and where each run began, both of shape (n, 2)."""
    angles, origins = [], []
    at = np.zeros(2)
    for run, keep in zip(runs, rows, strict=True):
        angle = np.stack(_travels(run, baseline), axis=1) / radius
        angles.append(at + angle[keep])
        origins.append(np.broadcast_to(at, (len(keep), 2)).copy())
        at = at + angle[-1]
    return np.ascontiguousarray(np.concatenate(angles)), np.ascontiguousarray(np.concatenate(origins))


def _pose(runs: Sequence[Run], rows: Sequence[IntArray], names: tuple[str, str, str]) -> FloatArray:
    """A pose of every row, shape (n, 3); NaN in runs that lack it; the heading made continuous."""
    poses = []
    for run, keep in zip(runs, rows, strict=True):
        pose = np.full((len(run), 3), np.nan)
        for k, name in enumerate(names):
            if name in run.columns:
                pose[:, k] = run.columns[name]
        known = np.isfinite(pose[:, 2])
        pose[known, 2] = np.unwrap(pose[known, 2])
        poses.append(pose[keep])
    return np.ascontiguousarray(np.concatenate(poses))


def _blank_stale(truth: FloatArray, travel: FloatArray, starts: IntArray) -> None:
    """Remove reference poses that only repeat the row before while the wheels moved (in place).

    A camera slower than the log holds its last pose, and a file that knows the end point alone has to
    fill its cells with something.
    """
    for a, b in pairwise(starts):
        held = a
        for k in range(a + 1, b):
            if np.array_equal(truth[k], truth[held]):
                if np.abs(travel[k] - travel[held]).max() > 1e-3:
                    truth[k] = np.nan
            elif np.isfinite(truth[k]).all():
                held = k


def _elapsed(runs: Sequence[Run], rows: Sequence[IntArray]) -> FloatArray:
    """Time since the set's first row, shape (n,), s; a known pause before a run is kept."""
    parts = []
    now = 0.0
    for index, (run, keep) in enumerate(zip(runs, rows, strict=True)):
        pause = None if run.metadata is None else run.metadata.pause_before_s
        if index:
            now += run.interval_s if pause is None else max(pause, 0.0)
        parts.append(now + run.t_s[keep] - run.t_s[0])
        now += run.duration_s
    return np.concatenate(parts)


def _initial(
    t_s: FloatArray, effort: FloatArray, speed: FloatArray, starts: IntArray, baseline: Baseline
) -> FloatArray:
    """Speed at the first row of every segment, shape (segments, 2), m/s."""
    initial = np.zeros((len(starts) - 1, 2))
    gains = np.array([baseline.left.gain_mps, baseline.right.gain_mps])
    for k, (a, b) in enumerate(pairwise(starts)):
        rows = speed[a : min(a + 3, b)]
        moving = np.abs(rows).min(axis=0) > AT_REST_SHARE * gains
        # Row 0 of a run repeats row 1 where speed is differenced: extrapolate from rows 1 and 2.
        at_start = 1.5 * rows[1] - 0.5 * rows[2] if len(rows) > 2 else rows[0]
        initial[k] = np.where(moving, at_start, 0.0)
        for wheel in np.flatnonzero(~moving):
            here = slice(a, b)
            row = carried_over(t_s[here], effort[here, wheel], speed[here, wheel], gains[wheel])
            if row is not None:
                initial[k, wheel] = speed[a + row, wheel]
    return initial


def _speed_of(travel: FloatArray, starts: IntArray, dt_s: FloatArray) -> FloatArray:
    speed = np.zeros_like(travel)
    speed[1:] = np.diff(travel, axis=0) / dt_s[1:, None]
    first = starts[:-1]
    speed[first] = speed[first + 1]
    return speed


def _heading(
    truth: FloatArray,
    gyro: FloatArray | None,
    odometry: FloatArray,
    travel: FloatArray,
    baseline: Baseline,
    starts: IntArray,
    dt_s: FloatArray,
) -> tuple[FloatArray | None, str]:
    """The heading that gravity acts along: truth first, then the gyro, the board's odometry, the wheels."""
    if np.isfinite(truth[:, 2]).all():
        return np.ascontiguousarray(truth[:, 2]), "truth"
    first = starts[:-1]
    if gyro is not None:
        turned = gyro * dt_s
        return _from_zero(turned, starts), "gyro"
    if np.isfinite(odometry[:, 2]).all():
        return np.ascontiguousarray(odometry[:, 2]), "odometry"
    if baseline.wheelbase_m is None:
        return None, ""
    turned = np.zeros(len(travel))
    turned[1:] = np.diff(travel[:, 1] - travel[:, 0]) / baseline.wheelbase_m
    turned[first] = 0.0
    return _from_zero(turned, starts), "wheels"


def _from_zero(turned: FloatArray, starts: IntArray) -> FloatArray:
    heading = np.empty_like(turned)
    for a, b in pairwise(starts):
        heading[a:b] = np.cumsum(turned[a:b]) - turned[a]
    return heading
