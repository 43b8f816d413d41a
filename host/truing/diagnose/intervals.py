"""95 % intervals of fitted parameters, robust to errors of noise model and equations.

The curvature of the whitened likelihood is valid where noise model and equations hold. Where they do not,
estimates differ between runs and between weightings of slow and fast errors; the sandwich estimator (Liang &
Zeger 1986) over blocks of time and over whole runs, and a refit under white noise, show by how much. The
variances are added: the largest alone covered four true parameters of five in concealed trials. Where the
loss is not quadratic (a time of change, a gap, a limit), the profile of the likelihood sets the end.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.compare import SIGNIFICANT_GAIN, row_blocks
from truing.diagnose.distributions import CHI2_95, NORMAL_975, student_quantile
from truing.diagnose.fit import Fit, fit
from truing.diagnose.problem import Column, Problem
from truing.diagnose.result import EffectParameter

# Runs needed for a variance between runs. Pose windows per cluster: more than any run has.
MIN_RUNS, WHOLE_RUN = 6, 1_000_000
# Iterations of the refit under white noise, of the one without an effect, and of those along a grid.
REFIT_STEPS, WITHOUT_STEPS, GRID_STEPS = 6, 10, 3
# Standard deviations to the end of a 95 % interval; 95 % quantile of chi-squared with one degree of freedom.
QUANTILE = NORMAL_975
# Multiples of the interval at which the profile is evaluated.
PROFILE_STEPS = 2.0 ** np.arange(9)


def covariance(problem: Problem, done: Fit) -> FloatArray:
    """Covariance of the free parameters (p, p): the likelihood's correlations, variances of all sources."""
    flat = done.residual.flat()
    raw = problem.jacobian(done.theta, done.effects, done.columns)
    jacobian = raw * problem.loss_slopes(flat)[:, None]
    scale = np.sqrt(np.maximum(np.sum(jacobian**2, axis=0), 1e-12))
    unit = jacobian / scale
    pulls = problem.judging(done.residual.speeds).pulls(done.columns) / scale
    inverse_information = _inverse_information(
        np.concatenate((unit, np.diag(pulls)[pulls > 0.0])), _at_a_bound(done)
    )
    likelihood = inverse_information * max(_mean_squared_residual(done, flat), 0.25)
    between = _cluster_variances(problem, inverse_information, unit * flat[:, None])
    variances = np.diag(likelihood) + between + (scale * _white_noise_shift(problem, done)) ** 2
    variances = np.maximum(variances, 0.0)  # rounding errors, of a dead wheel's parameters
    identifiable = np.diag(likelihood) > 0.0
    size = np.sqrt(np.where(identifiable, np.diag(likelihood), 1.0))
    correlation = likelihood / np.outer(size, size) + np.diag(np.where(identifiable, 0.0, 1.0))
    unconstrained = np.array(
        [
            0.0 if known else _without_slope(problem, done, column)
            for known, column in zip(identifiable, done.columns, strict=True)
        ]
    )
    widened = np.sqrt(variances) * _profile_widening(
        problem, done, likelihood / np.outer(scale, scale), identifiable
    )
    deviation = np.where(identifiable, widened / scale, unconstrained)
    return np.asarray(correlation * np.outer(deviation, deviation))


def _at_a_bound(done: Fit) -> BoolArray:
    """Free parameters, shape (p,), that ended at a bound."""
    value = np.array([done.theta[column.entries[0]] for column in done.columns])
    lower = np.array([column.lower for column in done.columns])
    upper = np.array([column.upper for column in done.columns])
    return np.asarray((value <= lower) | (value >= upper))


def _inverse_information(unit: FloatArray, at_a_bound: BoolArray) -> FloatArray:
    """Inverse of the information matrix (p, p) for columns of norm 1.

    A parameter that its bound holds does not follow the others: it has no correlation with them and adds no
    uncertainty to theirs (active constraints; Nocedal & Wright 2006, section 12.4). A filter of no length
    beside a delay, say, has the delay's own derivative.
    """
    inverse = np.eye(unit.shape[1])
    free = np.flatnonzero(~at_a_bound)
    block = unit[:, free]
    inverse[np.ix_(free, free)] = np.linalg.pinv(block.T @ block, rcond=1e-10)
    return inverse


def _mean_squared_residual(done: Fit, flat: FloatArray) -> float:
    """Mean squared residual per degree of freedom."""
    return float(flat @ flat) / max(int((flat != 0.0).sum()) - done.size, 1)


def _cluster_variances(
    problem: Problem, inverse_information: FloatArray, contributions: FloatArray
) -> FloatArray:
    """Sandwich variances (p,): the larger of blocks of time and, of enough runs, whole runs."""
    between = [_sandwich(inverse_information, contributions, _clusters(problem, row_blocks(problem), 1))]
    if problem.data.runs >= MIN_RUNS:
        runs = problem.data.run_of_row.astype(np.int64)
        between.append(_sandwich(inverse_information, contributions, _clusters(problem, runs, WHOLE_RUN)))
    return np.asarray(np.max(between, axis=0))


def _white_noise_shift(problem: Problem, done: Fit) -> FloatArray:
    """Change of the parameters (p,) under white noise, such that the interval reaches the other estimate.

    Both weightings give the same estimate where the equations hold.
    """
    plain = replace(problem.noise, lags=np.zeros_like(problem.noise.lags), sigma=problem.noise.rms)
    other = fit(problem.with_noise(plain), done.effects, done.theta, iterations=REFIT_STEPS)
    entries = [column.entries[0] for column in done.columns]
    return np.asarray((other.theta[entries] - done.theta[entries]) / QUANTILE)


def _profile_widening(
    problem: Problem, done: Fit, likelihood: FloatArray, identifiable: BoolArray
) -> FloatArray:
    """Ratio of the profile likelihood's interval to that from the curvature, per parameter (p,), 1 or more.

    The other parameters follow along the likelihood's correlations.
    """
    widening = np.ones(done.size)
    for k, column in enumerate(done.columns):
        if not column.effect or not identifiable[k]:
            continue
        along = likelihood[:, k] / likelihood[k, k]
        end = QUANTILE * math.sqrt(float(likelihood[k, k]))
        both = [_profile_reach(problem, done, k, way * end * along) for way in (-1.0, 1.0)]
        widening[k] = max(*both, 1.0)
    return widening


def _profile_reach(problem: Problem, done: Fit, k: int, step: FloatArray) -> float:
    """Multiple of `step` (p,) at which the loss exceeds its 95 % limit, or parameter k its bound."""
    reached = 0.0
    limit = CHI2_95 * _mean_squared_residual(done, done.residual.flat())
    for times in PROFILE_STEPS:
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


def _without_slope(problem: Problem, done: Fit, column: Column) -> float:
    """Standard deviation of a parameter at which the error has no slope.

    One that is taken from a grid may lie anywhere between the next values on both sides that the likelihood
    rules out; another one (of a dead wheel) anywhere within its bounds.
    """
    _, _, name = column.name.partition(".")
    known = CATALOGUE[column.effect].parameters if column.effect else ()
    grid = next((p.starts for p in known if p.name == name and p.fixed), ())
    if not grid:
        return 0.25 * (column.upper - column.lower)
    value = done.theta[column.entries[0]]
    above = [one for one in sorted(grid) if one > value]
    below = [one for one in sorted(grid, reverse=True) if one < value]
    ends = (_first_ruled_out(problem, done, column, below), _first_ruled_out(problem, done, column, above))
    reach = max(
        value - (column.lower if ends[0] is None else ends[0]),
        (column.upper if ends[1] is None else ends[1]) - value,
    )
    return float(reach) / QUANTILE


def _first_ruled_out(problem: Problem, done: Fit, column: Column, values: list[float]) -> float | None:
    """The first of these values of a parameter that the likelihood rules out, the others refitted."""
    limit = CHI2_95 * _mean_squared_residual(done, done.residual.flat())
    for value in values:
        start = done.theta.copy()
        start[list(column.entries)] = value
        if fit(problem, done.effects, start, iterations=GRID_STEPS).cost - done.cost > limit:
            return value
    return None


def _clusters(problem: Problem, rows: IntArray, windows: int) -> IntArray:
    """Cluster number of each entry of the flat residual; pose windows have clusters of their own."""
    wheels = np.repeat(rows, 2)
    if not len(problem.pose_counted):
        return wheels
    poses = np.repeat(problem.simulator.pose_runs(windows), 3) + int(wheels.max()) + 1
    return np.concatenate((wheels, poses))


def _sandwich(inverse_information: FloatArray, contributions: FloatArray, cluster: IntArray) -> FloatArray:
    """Sandwich variances (p,) from clusters, with Student's t correction for their number."""
    scores = np.zeros((int(cluster.max()) + 1, contributions.shape[1]))
    np.add.at(scores, cluster, contributions)
    count = max(int(np.any(scores != 0.0, axis=1).sum()), 2)
    widened = (student_quantile(0.975, count - 1) / QUANTILE) ** 2 * count / (count - 1.0)
    return np.asarray(np.diag(inverse_information @ (scores.T @ scores) @ inverse_information) * widened)


def not_different_from_absent(problem: Problem, done: Fit, spread: FloatArray) -> list[str]:
    """Effects of a fit of which every parameter's interval contains its value without the effect."""
    simulator = problem.simulator
    absent = simulator.start()
    out = []
    for name in done.effects:
        shaping = {p.name for p in CATALOGUE[name].parameters if p.nuisance or (p.log and p.scan)}
        off = simulator.report(name, absent)
        found = effect_parameters(problem, done, name, spread)
        changes = any(value.value != off[key] for key, value in found.items() if key not in shaping)
        if changes and problem.evidence((name,)) > 0.0:
            continue  # two recorded signals show it without any model of the robot
        if all(
            value.ci95[0] <= off[key] <= value.ci95[1] for key, value in found.items() if key not in shaping
        ):
            out.append(name)
    return out


def effect_parameters(
    problem: Problem, done: Fit, name: str, parameter_covariance: FloatArray
) -> dict[str, EffectParameter]:
    """The reported parameters of one effect with their intervals (delta method)."""
    simulator = problem.simulator
    units = simulator.units(name)
    centre = simulator.report(name, done.theta)
    slopes: dict[str, FloatArray] = {key: np.zeros(done.size) for key in centre}
    for k, column in enumerate(done.columns):
        step = max(0.1 * float(np.sqrt(max(parameter_covariance[k, k], 0.0))), 1e-7)
        moved = done.theta.copy()
        moved[list(column.entries)] += step
        for key, value in simulator.report(name, moved).items():
            slopes[key][k] = (value - centre[key]) / step
    idle = idle_parameters(done, name)
    out = {}
    for key, value in centre.items():
        if key in idle:
            continue
        variance = float(slopes[key] @ parameter_covariance @ slopes[key])
        half = QUANTILE * math.sqrt(max(variance, 0.0))
        ends = _possible(simulator.range_of(name, key), value, half)
        out[key] = EffectParameter(value, ends, units.get(key, "1"))
    return _clear_of_absent(problem, done, name, out)


def idle_parameters(done: Fit, name: str) -> frozenset[str]:
    """Parameters of an effect that a fit leaves off: it lacks what they need beside them, or is not plain."""
    free = {column.name for column in done.columns}
    return frozenset(
        p.name for p in CATALOGUE[name].parameters if (p.beside or p.plain) and f"{name}.{p.name}" not in free
    )


def _clear_of_absent(
    problem: Problem, done: Fit, name: str, found: dict[str, EffectParameter]
) -> dict[str, EffectParameter]:
    """The interval of an effect's one parameter, cut where the likelihood rules out that it is absent.

    Two lags in series are exchangeable: where they are about equal the likelihood is flat in their
    difference, to the second order, and the curvature's interval is as wide as one likes. The loss without
    the effect then sets the end, by a fourth-order parabola from the flat bottom.
    """
    absent = problem.simulator.report(name, problem.simulator.start())
    refining = {p.name for p in CATALOGUE[name].parameters if p.plain}
    key, value = next(iter(found.items()))
    low, high = value.ci95
    if len(found.keys() - refining) > 1 or name not in done.effects or not low <= absent[key] <= high:
        return found
    rest = tuple(each for each in done.effects if each != name)
    without = fit(problem, rest, done.theta, iterations=WITHOUT_STEPS)
    lost = (without.cost - done.cost) / max(_mean_squared_residual(done, done.residual.flat()), 1e-12)
    if lost < 2.0 * SIGNIFICANT_GAIN:
        return found
    reach = abs(value.value - absent[key]) * (CHI2_95 / lost) ** 0.25
    ends = (value.value - reach, high) if absent[key] < value.value else (low, value.value + reach)
    return found | {key: replace(value, ci95=ends)}


def _possible(ends: tuple[float, float], value: float, half: float) -> tuple[float, float]:
    """The interval value +- half within `ends`, what the parameter can physically be."""
    return min(max(value - half, ends[0]), value), max(min(value + half, ends[1]), value)
