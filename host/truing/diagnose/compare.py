"""Which of two fits explains the recordings better, by how much, how surely, and whether it matters."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from truing.diagnose.fit import Fit
from truing.diagnose.problem import CLIP, Problem
from truing.model.kernel import FloatArray, IntArray

# Residuals closer together than this share a block: what correlation the whitening leaves stays inside.
BLOCK_S = 2.0


@dataclass(frozen=True, slots=True)
class Advantage:
    """Of one fit over another.

    Attributes
    ----------
    gain : whitened log-likelihood, nats, each free number paid for with half the log of the rows.
    spread : the same without the block of time that speaks for it most: one moment is no evidence.
    times_noise : largest RMS difference of the two simulations, over the noise of that signal.
    """

    gain: float
    spread: float
    times_noise: float


def advantage(problem: Problem, one: Fit, other: Fit) -> Advantage:
    """How much better `one` is than `other`."""
    by_block = block_gains(problem, one, other)
    rows = float((problem.counted > 0.0).sum() + 3.0 * (problem.pose_counted > 0.0).sum())
    price = 0.5 * (one.size - other.size) * math.log(max(rows, 2.0))
    gain = float(by_block.sum()) - price
    return Advantage(gain, gain - max(float(by_block.max()), 0.0), difference(problem, one, other))


def block_gains(problem: Problem, one: Fit, other: Fit) -> FloatArray:
    """Log-likelihood gain of `one` over `other` in each block of time, shape (blocks,)."""
    wheels = 0.5 * (_loss(other.residual.wheels) - _loss(one.residual.wheels)).sum(axis=1)
    block = row_blocks(problem)
    gains = np.bincount(block, wheels, minlength=int(block.max()) + 1)
    if len(problem.pose_counted):
        pose = 0.5 * (_loss(other.residual.pose) - _loss(one.residual.pose)).sum(axis=1)
        where = problem.simulator.pose_runs(POSE_BLOCK_WINDOWS)
        gains = np.concatenate((gains, np.bincount(where, pose)))
    return np.asarray(gains)


POSE_BLOCK_WINDOWS = 2


def row_blocks(problem: Problem) -> IntArray:
    """Block number of each row, shape (n,); a block never spans two runs."""
    data = problem.data
    start = np.repeat(data.t_s[data.starts[:-1]], np.diff(data.starts))
    within = ((data.t_s - start) / BLOCK_S).astype(np.int64)
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
