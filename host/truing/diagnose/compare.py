"""Which of two fits explains the recordings better, by how much, how surely, and whether it matters."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from truing.diagnose.fit import Fit
from truing.diagnose.problem import CLIP, Problem
from truing.model.kernel import FloatArray, IntArray

# An advantage is sure beyond this many nats, also without the moment that speaks for it most. With 27
# effects of up to four numbers tried, 10 nats come by chance less than once in a thousand sets.
SURE_GAIN = 10.0
# Residuals closer together than this share a block: what correlation the whitening leaves stays inside.
BLOCK_S = 2.0
# A knock against the robot fills a few whitened rows: two neighbours of this length hold it.
MOMENT_S = 0.5
# A knock or a slip that no encoder sees may fall on the border of two windows of the pose.
POSE_BLOCK_WINDOWS = 2


@dataclass(frozen=True, slots=True)
class Advantage:
    """Of one fit over another.

    Attributes
    ----------
    gain : whitened log-likelihood, nats, each free number paid for with half the log of the rows.
    spread : the same without the second that speaks for it most: one moment is no evidence.
    times_noise : largest RMS difference of the two simulations, over the noise of that signal.
    """

    gain: float
    spread: float
    times_noise: float


def advantage(problem: Problem, one: Fit, other: Fit) -> Advantage:
    """How much better `one` is than `other`."""
    wheels, pose = moment_gains(problem, one, other)
    rows = float((problem.counted > 0.0).sum() + 3.0 * (problem.pose_counted > 0.0).sum())
    price = 0.5 * (one.size - other.size) * math.log(max(rows, 2.0))
    told = problem.evidence(one.effects) - problem.evidence(other.effects)
    gain = float(wheels.sum() + pose.sum()) - price + told
    moment = max(float((wheels[1:] + wheels[:-1]).max(initial=0.0)), float(pose.max(initial=0.0)))
    return Advantage(gain, gain - moment, difference(problem, one, other))


def moment_gains(problem: Problem, one: Fit, other: Fit) -> tuple[FloatArray, FloatArray]:
    """Log-likelihood gain of `one` over `other`: of the wheels by moment, of the pose by pair of windows."""
    rows, windows = _gains(one, other)
    wheels = np.bincount(row_blocks(problem, MOMENT_S), rows)
    if not len(problem.pose_counted):
        return wheels.astype(float), np.zeros(0)
    pose = np.bincount(problem.simulator.pose_runs(POSE_BLOCK_WINDOWS), windows)
    return wheels.astype(float), pose.astype(float)


def run_gains(problem: Problem, one: Fit, other: Fit) -> FloatArray:
    """Log-likelihood gain of `one` over `other` in each run, shape (runs,), wheels and pose together."""
    runs = problem.data.runs
    rows, windows = _gains(one, other)
    gains = np.bincount(problem.data.run_of_row, rows, runs)
    if len(problem.pose_counted):
        gains += np.bincount(problem.simulator.windows(problem.data.pose_horizon_s).run, windows, runs)
    return np.asarray(gains, dtype=np.float64)


def _gains(one: Fit, other: Fit) -> tuple[FloatArray, FloatArray]:
    """Log-likelihood gain of `one` over `other` in each row (n,) and each window of the pose (m,)."""
    a, b = one.residual, other.residual
    rows, windows = _loss(b.wheels) - _loss(a.wheels), _loss(b.pose) - _loss(a.pose)
    return 0.5 * rows.sum(axis=1), 0.5 * windows.sum(axis=1)


def row_blocks(problem: Problem, length_s: float = BLOCK_S) -> IntArray:
    """Block number of each row, shape (n,); a block never spans two runs."""
    data = problem.data
    start = np.repeat(data.t_s[data.starts[:-1]], np.diff(data.starts))
    within = ((data.t_s - start) / length_s).astype(np.int64)
    segment = np.repeat(np.arange(len(data.starts) - 1), np.diff(data.starts))
    _, number = np.unique(segment * 1_000_000 + within, return_inverse=True)
    return np.asarray(number, dtype=np.int64)


def difference(problem: Problem, one: Fit, other: Fit) -> float:
    """RMS difference of two simulations over the noise, in the signal where it is largest."""
    return float(max(differences(problem, one, other)))


def differences(problem: Problem, one: Fit, other: Fit) -> tuple[float, float, float]:
    """RMS difference over noise of left speed, right speed, and pose (its most affected component)."""
    out = [0.0, 0.0, 0.0]
    gap = one.residual.speeds - other.residual.speeds
    for wheel in range(2):
        weight = problem.counted[:, wheel]
        total = max(float(weight.sum()), 1.0)
        out[wheel] = math.sqrt(float(weight @ gap[:, wheel] ** 2) / total) / float(problem.noise.rms[wheel])
    if len(problem.pose_counted):
        apart = one.residual.pose - other.residual.pose
        seen = max(float((problem.pose_counted > 0.0).sum()), 1.0)
        out[2] = float(np.sqrt(np.max(np.sum(apart**2, axis=0)) / seen))
    return out[0], out[1], out[2]


def _loss(e: FloatArray) -> FloatArray:
    size = np.abs(e)
    return np.where(size > CLIP, 2.0 * CLIP * size - CLIP**2, e**2)
