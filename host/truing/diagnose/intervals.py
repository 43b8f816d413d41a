"""95 % intervals of fitted numbers: what the noise allows, and what the blocks of time themselves show.

Three covariances, the widest of which counts for each number: the curvature of the whitened likelihood, which
is right where the noise model is; and the sandwich (Liang & Zeger 1986) over blocks of time and over whole
runs, which needs no noise model but enough of them. Runs also show where an equation is only near the robot:
then each run asks for another number, and so does another weight of slow errors beside fast ones.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy import stats

from truing.diagnose.compare import row_blocks
from truing.diagnose.fit import Fit, fit
from truing.diagnose.problem import CLIP, Problem
from truing.diagnose.result import EffectParameter
from truing.model.kernel import FloatArray, IntArray

# So many runs tell how far runs differ. Pose windows in one cluster: more than any run has.
LEAST_RUNS, WHOLE_RUN = 6, 1_000_000
# The numbers under another weight are near: so many steps find them.
PLAIN_STEPS = 6


def covariance(problem: Problem, done: Fit) -> FloatArray:
    """Of the free numbers, shape (p, p); the widest variances and the other weight's distance."""
    flat = done.residual.flat()
    raw = problem.jacobian(done.theta, done.effects, done.columns)
    jacobian = raw * (CLIP / np.maximum(np.abs(flat), CLIP))[:, None]
    scale = np.sqrt(np.maximum(np.sum(jacobian**2, axis=0), 1e-12))
    unit = jacobian / scale
    bread = np.linalg.pinv(unit.T @ unit, rcond=1e-10)
    pieces = unit * flat[:, None]
    between = [_sandwich(bread, pieces, _clusters(problem, row_blocks(problem), 1))]
    if problem.data.runs >= LEAST_RUNS:
        runs = problem.data.run_of_row.astype(np.int64)
        between.append(_sandwich(bread, pieces, _clusters(problem, runs, WHOLE_RUN)))
    variance = float(flat @ flat) / max(int((flat != 0.0).sum()) - len(scale), 1)
    likelihood = bread * max(variance, 0.25)
    wider = np.sqrt(np.max([*between, np.diag(likelihood)], axis=0) + (scale * _moved(problem, done)) ** 2)
    told = np.diag(likelihood) > 0.0
    size = np.sqrt(np.where(told, np.diag(likelihood), 1.0))
    correlation = likelihood / np.outer(size, size) + np.diag(np.where(told, 0.0, 1.0))
    # A number that no signal depends on (of a wheel that is dead) may be anything within its bounds.
    anything = np.array([0.25 * (column.upper - column.lower) for column in done.columns])
    deviation = np.where(told, wider / scale, anything)
    return np.asarray(correlation * np.outer(deviation, deviation))


def _moved(problem: Problem, done: Fit) -> FloatArray:
    """How far, in standard deviations' units (p,), the numbers go when the noise is taken for white.

    Both weights find the same numbers where the equation holds; where it is only near the robot, the interval
    reaches as far as the other.
    """
    plain = replace(problem.noise, lags=np.zeros_like(problem.noise.lags), sigma=problem.noise.rms)
    other = fit(problem.with_noise(plain), done.effects, done.theta, iterations=PLAIN_STEPS)
    entries = [column.entries[0] for column in done.columns]
    return np.asarray((other.theta[entries] - done.theta[entries]) / stats.norm.ppf(0.975))


def _clusters(problem: Problem, rows: IntArray, windows: int) -> IntArray:
    """Cluster number of each entry of the flat residual; pose windows have clusters of their own."""
    wheels = np.repeat(rows, 2)
    if not len(problem.pose_counted):
        return wheels
    poses = np.repeat(problem.simulator.pose_runs(windows), 3) + int(wheels.max()) + 1
    return np.concatenate((wheels, poses))


def _sandwich(bread: FloatArray, pieces: FloatArray, cluster: IntArray) -> FloatArray:
    """Variances (p,) from what clusters ask for; widened for their number as Student's t is."""
    scores = np.zeros((int(cluster.max()) + 1, pieces.shape[1]))
    np.add.at(scores, cluster, pieces)
    count = max(int(np.any(scores != 0.0, axis=1).sum()), 2)
    wider = (stats.t.ppf(0.975, count - 1) / stats.norm.ppf(0.975)) ** 2 * count / (count - 1.0)
    return np.asarray(np.diag(bread @ (scores.T @ scores) @ bread) * wider)


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
