"""95 % intervals of fitted numbers: what the noise allows, and what the blocks of time themselves show.

The curvature of the whitened likelihood is right where noise model and equation are; the sandwich (Liang &
Zeger 1986) over blocks of time and over whole runs shows where they are not, once there are enough of them:
then each run asks for another number, and so does another weight of slow errors beside fast ones. What these
say is added up: the larger alone held four true numbers of five in concealed trials. And a misfit that is no
parabola (a moment, a gap, a limit) is walked along until the noise forbids the next step.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy import stats

from truing.diagnose.compare import row_blocks
from truing.diagnose.data import BoolArray
from truing.diagnose.fit import Fit, fit
from truing.diagnose.problem import CLIP, Problem
from truing.diagnose.result import EffectParameter
from truing.model.kernel import FloatArray, IntArray

# So many runs tell how far runs differ. Pose windows in one cluster: more than any run has.
LEAST_RUNS, WHOLE_RUN = 6, 1_000_000
# The numbers under another weight are near: so many steps find them.
PLAIN_STEPS = 6
# A 95 % interval ends at so many standard deviations; chance makes so many times a row's misfit beyond it.
QUANTILE, CHANCE = float(stats.norm.ppf(0.975)), float(stats.chi2.ppf(0.95, 1))
# A number is walked outward in steps that double, from its interval's end to so many times as far.
WALK = 2.0 ** np.arange(9)


def covariance(problem: Problem, done: Fit) -> FloatArray:
    """Of the free numbers, shape (p, p): correlations of the likelihood, variances of all that is known."""
    flat = done.residual.flat()
    raw = problem.jacobian(done.theta, done.effects, done.columns)
    jacobian = raw * (CLIP / np.maximum(np.abs(flat), CLIP))[:, None]
    scale = np.sqrt(np.maximum(np.sum(jacobian**2, axis=0), 1e-12))
    unit = jacobian / scale
    bread = np.linalg.pinv(unit.T @ unit, rcond=1e-10)
    likelihood = bread * max(_row_misfit(done, flat), 0.25)
    between = _between(problem, bread, unit * flat[:, None])
    variances = np.diag(likelihood) + between + (scale * _moved(problem, done)) ** 2
    variances = np.maximum(variances, 0.0)  # of a dead wheel's numbers only rounding is left
    told = np.diag(likelihood) > 0.0
    size = np.sqrt(np.where(told, np.diag(likelihood), 1.0))
    correlation = likelihood / np.outer(size, size) + np.diag(np.where(told, 0.0, 1.0))
    # A number that no signal depends on (of a wheel that is dead) may be anything within its bounds.
    anything = np.array([0.25 * (column.upper - column.lower) for column in done.columns])
    wider = np.sqrt(variances) * _no_parabola(problem, done, likelihood / np.outer(scale, scale), told)
    deviation = np.where(told, wider / scale, anything)
    return np.asarray(correlation * np.outer(deviation, deviation))


def _row_misfit(done: Fit, flat: FloatArray) -> float:
    """Squared residual per row that counts, of one that the numbers do not follow."""
    return float(flat @ flat) / max(int((flat != 0.0).sum()) - done.size, 1)


def _between(problem: Problem, bread: FloatArray, pieces: FloatArray) -> FloatArray:
    """Variances (p,) that blocks of time show or, of enough runs, whole runs: the larger."""
    between = [_sandwich(bread, pieces, _clusters(problem, row_blocks(problem), 1))]
    if problem.data.runs >= LEAST_RUNS:
        runs = problem.data.run_of_row.astype(np.int64)
        between.append(_sandwich(bread, pieces, _clusters(problem, runs, WHOLE_RUN)))
    return np.asarray(np.max(between, axis=0))


def _moved(problem: Problem, done: Fit) -> FloatArray:
    """How far, in standard deviations' units (p,), the numbers go when the noise is taken for white.

    Both weights find the same numbers where the equation holds; where it is only near the robot, the interval
    reaches as far as the other.
    """
    plain = replace(problem.noise, lags=np.zeros_like(problem.noise.lags), sigma=problem.noise.rms)
    other = fit(problem.with_noise(plain), done.effects, done.theta, iterations=PLAIN_STEPS)
    entries = [column.entries[0] for column in done.columns]
    return np.asarray((other.theta[entries] - done.theta[entries]) / QUANTILE)


def _no_parabola(problem: Problem, done: Fit, likelihood: FloatArray, told: BoolArray) -> FloatArray:
    """By how much farther than its curvature says each of the effects' numbers may go, shape (p,), 1 or more.

    The other numbers go along as the likelihood's correlations say.
    """
    farther = np.ones(done.size)
    for k, column in enumerate(done.columns):
        if "." not in column.name or not told[k]:
            continue
        along = likelihood[:, k] / likelihood[k, k]
        end = QUANTILE * math.sqrt(float(likelihood[k, k]))
        both = [_walk(problem, done, k, way * end * along) for way in (-1.0, 1.0)]
        farther[k] = max(*both, 1.0)
    return farther


def _walk(problem: Problem, done: Fit, k: int, step: FloatArray) -> float:
    """How many times `step` (p,) the numbers may move: until chance allows no more misfit, or k's bound."""
    reached = 0.0
    limit = CHANCE * _row_misfit(done, done.residual.flat())
    for times in WALK:
        theta = done.theta.copy()
        for column, change in zip(done.columns, times * step, strict=True):
            theta[list(column.entries)] = np.clip(
                theta[column.entries[0]] + change, column.lower, column.upper
            )
        flat = problem.residual(theta, done.effects).flat()
        grown = float(flat @ flat) - done.cost
        if grown > limit:
            return float(max(reached, times * math.sqrt(limit / grown)))
        reached = float(times)
        if theta[done.columns[k].entries[0]] in (done.columns[k].lower, done.columns[k].upper):
            break
    return reached


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
    wider = (stats.t.ppf(0.975, count - 1) / QUANTILE) ** 2 * count / (count - 1.0)
    return np.asarray(np.diag(bread @ (scores.T @ scores) @ bread) * wider)


def effect_parameters(
    problem: Problem, done: Fit, name: str, spread: FloatArray
) -> dict[str, EffectParameter]:
    """The contract's parameters of one effect with their intervals (delta method)."""
    simulator = problem.simulator
    units = simulator.units(name)
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
        half = QUANTILE * math.sqrt(max(variance, 0.0))
        out[key] = EffectParameter(value, (value - half, value + half), units.get(key, "1"))
    return out
