"""The regression of WPILib's SysId: acceleration on speed, effort and the sign of speed.

    dv/dt = alpha v + beta u + gamma sign(v),    kS = -gamma / beta, kV = -alpha / beta, kA = 1 / beta

What SysId 2023 does to its recordings first is done here too: efforts get the sign of the speed; slow
ramps lose their rows without effort or below the motion threshold; steps lose what comes before their
largest acceleration and after acceleration has sunk into its noise; acceleration is a central difference
over three rows, and rows where it is exactly zero are left out. (Source: wpilibsuite/sysid, files
FilteringUtils.cpp, FeedforwardAnalysis.cpp; WPILib documentation, "Analyzing Data".)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from truing.arrays import BoolArray, FloatArray
from truing.errors import PeerFailedError
from truing.studies.real.peers.first_order_wheel import FirstOrderWheel
from truing.studies.real.peers.peer import Peer, WheelModel
from truing.studies.real.peers.wheel_runs import WheelRun

# SysId's defaults, in the recording's own unit per second, and s.
MOTION_THRESHOLD = 0.2
NOISE_WINDOW_ROWS = 9
LATER_S, LONGEST_STEP_S = 1.0, 10.0
# A run whose effort stays near its top for most of the time that it is driven is a step.
NEAR_TOP, MOST = 0.9, 0.5


def fit_sysid(runs: Sequence[WheelRun], near: WheelModel | None = None) -> WheelModel:
    """Least squares over all prepared rows; `near` is not used."""
    del near
    prepared = [_prepared(run) for run in runs if len(run) > NOISE_WINDOW_ROWS]
    rows = np.concatenate([speed_effort for speed_effort, _ in prepared]) if prepared else np.zeros((0, 2))
    if len(rows) < 3:
        raise PeerFailedError("its trimming leaves no rows")
    acceleration = np.concatenate([values for _, values in prepared])
    matrix = np.column_stack([rows[:, 0], rows[:, 1], np.copysign(1.0, rows[:, 0])])
    alpha, beta, gamma = np.linalg.lstsq(matrix, acceleration, rcond=None)[0]
    if alpha >= 0.0 or beta <= 0.0:
        raise PeerFailedError("its regression gives a negative kV or kA")
    gain, tau, friction = -beta / alpha, -1.0 / alpha, max(-gamma / beta, 0.0)
    return FirstOrderWheel(np.array([gain, gain, tau, friction, friction, 0.0, 0.0]))


def _prepared(run: WheelRun) -> tuple[FloatArray, FloatArray]:
    """Speed and effort, shape (k, 2), and acceleration, shape (k,), m/s^2, of the rows that are kept."""
    t, speed = run.t_s, run.speed_mps
    effort = np.copysign(run.effort, speed)
    is_step = _is_step(effort)
    keep = np.isfinite(speed)
    if not is_step:
        keep = (np.abs(effort) > 0.0) & (np.abs(speed) >= MOTION_THRESHOLD)
        t, speed, effort = t[keep], speed[keep], effort[keep]
    if len(t) < NOISE_WINDOW_ROWS:
        return np.zeros((0, 2)), np.zeros(0)
    acceleration = np.zeros(len(t))
    acceleration[1:-1] = (speed[2:] - speed[:-2]) / (2.0 * float(np.mean(np.diff(t))))
    used = _step_rows(t, effort, acceleration) if is_step else np.ones(len(t), dtype=np.bool_)
    used &= acceleration != 0.0
    return np.column_stack([speed, effort])[used], acceleration[used]


def _is_step(effort: FloatArray) -> bool:
    size = np.abs(effort)
    driven = size > 0.0
    return bool(driven.any() and np.mean(size[driven] > NEAR_TOP * size.max()) > MOST)


def _step_rows(t_s: FloatArray, effort: FloatArray, acceleration: FloatArray) -> BoolArray:
    """Rows of a step from its largest acceleration to when acceleration has sunk into its noise."""
    first = int(np.argmax(np.abs(acceleration)))
    driven = np.flatnonzero(np.abs(effort) > 0.0)
    lead = t_s[first] - t_s[driven[0]] if len(driven) else 0.0
    tail = acceleration[first:]
    floor = _noise_floor(tail)
    loud = np.flatnonzero(np.abs(tail) > floor)
    last = t_s[first + loud[-1]] - t_s[first] if len(loud) else LONGEST_STEP_S
    duration = min(last + lead + LATER_S, LONGEST_STEP_S)
    rows = np.arange(len(t_s))
    return np.asarray((rows >= first) & (t_s - t_s[first] + lead <= duration))


def _noise_floor(values: FloatArray) -> float:
    """RMS of values (n,) about their moving average."""
    if len(values) < NOISE_WINDOW_ROWS:
        return 0.0
    window = np.ones(NOISE_WINDOW_ROWS) / NOISE_WINDOW_ROWS
    mean = np.convolve(values, window, mode="valid")
    half = NOISE_WINDOW_ROWS // 2
    return float(np.sqrt(np.mean((values[half : half + len(mean)] - mean) ** 2)))


SYSID = Peer("sysid", "SysId", fit_sysid)
