"""95 % intervals of fitted numbers: what the noise allows, and what the blocks of time themselves show.

Two covariances, the wider of which counts for each number: the curvature of the whitened likelihood, which
is right where the noise model is; and the sandwich over blocks of time (Liang & Zeger 1986), which needs no
noise model but enough blocks.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from truing.diagnose.compare import row_blocks
from truing.diagnose.fit import Fit
from truing.diagnose.problem import CLIP, Problem
from truing.diagnose.result import EffectParameter
from truing.model.kernel import FloatArray


def covariance(problem: Problem, done: Fit) -> FloatArray:
    """Of the free numbers, shape (p, p); each variance the wider of the two."""
    flat = done.residual.flat()
    raw = problem.jacobian(done.theta, done.effects, done.columns)
    jacobian = raw * (CLIP / np.maximum(np.abs(flat), CLIP))[:, None]
    scale = np.sqrt(np.maximum(np.sum(jacobian**2, axis=0), 1e-12))
    unit = jacobian / scale
    bread = np.linalg.pinv(unit.T @ unit, rcond=1e-10)
    rows = np.repeat(row_blocks(problem), 2)
    block = rows
    if len(problem.pose_counted):
        windows = np.repeat(problem.simulator.pose_runs(1), 3) + rows.max() + 1
        block = np.concatenate((rows, windows))
    scores = np.zeros((int(block.max()) + 1, len(scale)))
    np.add.at(scores, block, unit * flat[:, None])
    used = np.flatnonzero(np.any(scores != 0.0, axis=1))
    count = max(len(used), 2)
    sandwich = bread @ (scores.T @ scores) @ bread * (count / (count - 1.0))
    variance = float(flat @ flat) / max(int((flat != 0.0).sum()) - len(scale), 1)
    likelihood = bread * max(variance, 0.25)
    wider = np.sqrt(np.maximum(np.diag(sandwich), np.diag(likelihood)))
    told = np.diag(likelihood) > 0.0
    size = np.sqrt(np.where(told, np.diag(likelihood), 1.0))
    correlation = likelihood / np.outer(size, size) + np.diag(np.where(told, 0.0, 1.0))
    # A number that no signal depends on (of a wheel that is dead) may be anything within its bounds.
    anything = np.array([0.25 * (column.upper - column.lower) for column in done.columns])
    deviation = np.where(told, wider / scale, anything)
    return np.asarray(correlation * np.outer(deviation, deviation))


def effect_parameters(
    problem: Problem, done: Fit, name: str, spread: FloatArray
) -> dict[str, EffectParameter]:
    """The contract's parameters of one effect with their intervals (delta method)."""
    simulator = problem.simulator
    units = simulator.units(name)
    quantile = float(stats.norm.ppf(0.975))
    centre = simulator.report(name, done.theta)
    slopes: dict[str, FloatArray] = {key: np.zeros(done.size) for key in centre}
    for k, column in enumerate(done.columns):
        step = max(0.1 * float(np.sqrt(max(spread[k, k], 0.0))), 1e-7)
        moved = done.theta.copy()
        moved[list(column.entries)] += step
        for key, value in simulator.report(name, moved).items():
            slopes[key][k] = (value - centre[key]) / step
    out = {}
    for key, value in centre.items():
        variance = float(slopes[key] @ spread @ slopes[key])
        half = quantile * math.sqrt(max(variance, 0.0))
        out[key] = EffectParameter(value, (value - half, value + half), units.get(key, "1"))
    return out
