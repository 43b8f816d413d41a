"""Comparison of two fits: penalised log-likelihood ratio, its robust form, and the size of the difference."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.diagnose.fit import Fit
from truing.diagnose.problem import CLIP, Problem

# A gain is significant beyond this many nats, also without its largest block. With 27 effects of up to four
# parameters tested, 10 nats occur by chance in fewer than one set in a thousand.
SIGNIFICANT_GAIN = 10.0
# Block length, s, of the block-wise statistics: correlation that whitening leaves stays within a block.
BLOCK_S = 2.0
# An impact on the robot affects a few whitened rows: two neighbouring blocks of this length contain it.
SHORT_BLOCK_S = 0.5
# An impact or a slip that no encoder shows may fall on the border of two pose windows.
POSE_BLOCK_WINDOWS = 2


@dataclass(frozen=True, slots=True)
class Comparison:
    """One fit compared with another.

    Attributes
    ----------
    gain : log-likelihood gain, nats, less half the log of the rows per free parameter (as in BIC).
    robust_gain : the same without the second that contributes most.
    times_noise : largest RMS difference of the two simulations over the noise RMS of that signal.
    """

    gain: float
    robust_gain: float
    times_noise: float


def compare_fits(problem: Problem, one: Fit, other: Fit) -> Comparison:
    """Compare `one` with `other`; positive gains favour `one`."""
    wheels, pose = block_gains(problem, one, other)
    rows = float((problem.counted > 0.0).sum() + 3.0 * (problem.pose_counted > 0.0).sum())
    penalty = 0.5 * (one.size - other.size) * math.log(max(rows, 2.0))
    direct = problem.evidence(one.effects) - problem.evidence(other.effects)
    gain = float(wheels.sum() + pose.sum()) - penalty + direct
    largest_block = max(float((wheels[1:] + wheels[:-1]).max(initial=0.0)), float(pose.max(initial=0.0)))
    return Comparison(gain, gain - largest_block, largest_difference(problem, one, other))


def block_gains(problem: Problem, one: Fit, other: Fit) -> tuple[FloatArray, FloatArray]:
    """Log-likelihood gain of `one` over `other` by short block of rows, and by pair of pose windows."""
    rows, windows = _gains(one, other)
    wheels = np.bincount(row_blocks(problem, SHORT_BLOCK_S), rows)
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
    """Log-likelihood gain of `one` over `other` in each row (n,) and each pose window (m,)."""
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


def largest_difference(problem: Problem, one: Fit, other: Fit) -> float:
    """RMS difference of two simulations over the noise RMS, in the signal where it is largest."""
    return float(max(differences(problem, one, other)))


def differences(problem: Problem, one: Fit, other: Fit) -> tuple[float, float, float]:
    """RMS difference over noise RMS of left speed, right speed, and the most affected pose component.

    A speed's noise is that of means over some time, not of single rows.
    """
    out = [0.0, 0.0, 0.0]
    gap = one.residual.speeds - other.residual.speeds
    for wheel in range(2):
        weight = problem.counted[:, wheel]
        total = max(float(weight.sum()), 1.0)
        out[wheel] = math.sqrt(float(weight @ gap[:, wheel] ** 2) / total) / float(
            problem.noise.compared[wheel]
        )
    if len(problem.pose_counted):
        pose_gap = one.residual.pose - other.residual.pose
        windows = max(float((problem.pose_counted > 0.0).sum()), 1.0)
        out[2] = float(np.sqrt(np.max(np.sum(pose_gap**2, axis=0)) / windows))
    return out[0], out[1], out[2]


def _loss(e: FloatArray) -> FloatArray:
    size = np.abs(e)
    return np.where(size > CLIP, 2.0 * CLIP * size - CLIP**2, e**2)
