"""What a set's motion is known to be beside its measured columns: angles, initial speeds, heading, time."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.diagnose.data.joined_runs import JoinedRuns
from truing.diagnose.data.valid_rows import carried_over
from truing.recording.baseline import Baseline
from truing.recording.run import Run

# A segment whose first rows are slower than this share of full speed starts at rest.
AT_REST_SHARE = 0.01

# Positions with finer steps than this, m, are not made from counts.
MIN_POSITION_STEP_M = 1e-5


def wheel_travels(run: Run, baseline: Baseline) -> FloatArray:
    """Measured travel of both wheels since the start of the run, shape (n, 2), m."""
    left, right = run.travel("left", baseline), run.travel("right", baseline)
    assert left is not None  # a run without any motion pair is refused when it is read
    assert right is not None
    return np.stack([left, right], axis=1)


def wheel_angles(joined: JoinedRuns, baseline: Baseline) -> tuple[FloatArray | None, FloatArray | None]:
    """Wheel angles running on from run to run, and where each run began, both (n, 2), rad; or None."""
    radius = None if baseline.robot is None else baseline.robot.wheel_radius_m
    if radius is None:
        return None, None
    angles, origins = [], []
    at = np.zeros(2)
    for run in joined.runs:
        angle = wheel_travels(run, baseline) / radius
        angles.append(at + angle)
        origins.append(np.broadcast_to(at, angle.shape))
        at = at + angle[-1]
    return joined.join(angles), joined.join(origins)


def position_step(travel: FloatArray, starts: IntArray) -> float:
    """Resolution of positions made from counts (n, 2), m; 0 where there is none."""
    steps = np.abs(np.diff(travel, axis=0))
    steps[starts[1:-1] - 1] = 0.0
    steps = steps[steps > MIN_POSITION_STEP_M]
    if not len(steps):
        return 0.0
    step = float(np.min(steps))
    deviation = np.abs(steps / step - np.round(steps / step))
    return step if float(np.percentile(deviation, 90)) < 0.05 else 0.0


def blank_stale(truth: FloatArray, travel: FloatArray, starts: IntArray) -> None:
    """Remove reference poses that only repeat the row before while the wheels moved (in place).

    A camera slower than the log holds its last pose, and a file that knows the end point alone has to
    fill its cells with something.
    """
    if not np.isfinite(truth).any():
        return
    for a, b in pairwise(starts):
        held = a
        for k in range(a + 1, b):
            if np.array_equal(truth[k], truth[held]):
                if np.abs(travel[k] - travel[held]).max() > 1e-3:
                    truth[k] = np.nan
            elif np.isfinite(truth[k]).all():
                held = k


def elapsed(joined: JoinedRuns) -> FloatArray:
    """Time since the set's first row, shape (n,), s; a known pause before a run is kept."""
    parts = []
    now = 0.0
    for index, (run, keep) in enumerate(zip(joined.runs, joined.rows, strict=True)):
        pause = None if run.metadata is None else run.metadata.pause_before_s
        if index:
            now += run.interval_s if pause is None else max(pause, 0.0)
        parts.append(now + run.t_s[keep] - run.t_s[0])
        now += run.duration_s
    return np.concatenate(parts)


def initial_speeds(
    t_s: FloatArray,
    effort: FloatArray,
    speed: FloatArray,
    starts: IntArray,
    baseline: Baseline,
    *,
    instant: bool = False,
) -> FloatArray:
    """Speed at the first row of every segment, shape (segments, 2), m/s; `instant`: as that row says."""
    initial = np.zeros((len(starts) - 1, 2))
    gains = np.array([baseline.left.gain_mps, baseline.right.gain_mps])
    for k, (a, b) in enumerate(pairwise(starts)):
        rows = speed[a : min(a + 3, b)]
        moving = np.abs(rows).min(axis=0) > AT_REST_SHARE * gains
        # Row 0 of a run repeats row 1 where speed is differenced: extrapolate from rows 1 and 2.
        at_start = rows[0]
        if not instant and len(rows) > 2:
            at_start = rows[1] - _half_row(t_s, effort, rows, a, baseline)
        initial[k] = np.where(moving, at_start, 0.0)
        for wheel in np.flatnonzero(~moving):
            here = slice(a, b)
            row = carried_over(t_s[here], effort[here, wheel], speed[here, wheel], gains[wheel])
            if row is not None:
                initial[k, wheel] = speed[a + row, wheel]
    return initial


def _half_row(
    t_s: FloatArray, effort: FloatArray, rows: FloatArray, first: int, baseline: Baseline
) -> FloatArray:
    """Change of speed from the start of a segment's row 1 to its middle, shape (2,), m/s.

    Half of that from row 1 to row 2; less what a change of effort between these adds to it, where that makes
    it smaller: a robot that answers late has not yet seen that change.
    """
    change = 0.5 * (rows[2] - rows[1])
    slopes = np.array([wheel.gain_mps / wheel.time_constant_s for wheel in (baseline.left, baseline.right)])
    added = 0.25 * (t_s[first + 2] - t_s[first + 1]) * slopes * (effort[first + 2] - effort[first + 1])
    return np.where(np.abs(change - added) < np.abs(change), change - added, change)


def best_heading(
    joined: JoinedRuns,
    truth: FloatArray,
    gyro: FloatArray | None,
    odometry: FloatArray,
    travel: FloatArray,
    baseline: Baseline,
    dt_s: FloatArray,
) -> tuple[FloatArray | None, str]:
    """The heading that gravity acts along: truth first, then the gyro, the board's odometry, the wheels."""
    if np.isfinite(truth[:, 2]).all():
        return np.ascontiguousarray(truth[:, 2]), "truth"
    if gyro is not None:
        return _from_zero(gyro * dt_s, joined.starts), "gyro"
    if np.isfinite(odometry[:, 2]).all():
        return np.ascontiguousarray(odometry[:, 2]), "odometry"
    if baseline.wheelbase_m is None:
        return None, ""
    turned = np.zeros(len(travel))
    turned[1:] = np.diff(travel[:, 1] - travel[:, 0]) / baseline.wheelbase_m
    turned[joined.starts[:-1]] = 0.0
    return _from_zero(turned, joined.starts), "wheels"


def _from_zero(turned: FloatArray, starts: IntArray) -> FloatArray:
    heading = np.empty_like(turned)
    for a, b in pairwise(starts):
        heading[a:b] = np.cumsum(turned[a:b]) - turned[a]
    return heading
