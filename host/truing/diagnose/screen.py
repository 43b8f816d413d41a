"""Score tests: to first order, how much of the residual each effect could explain, and at which amplitude.

For each starting value of an effect one simulation (a probe) gives the change of the signals. That shape,
scaled, and the baseline's own derivatives are projected on the residual (a score test at a finite
amplitude; Rao 1948). The projection costs one simulation where a fit costs dozens; it selects the effects
to fit and their starting values.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.effect import SIDES, Effect, Parameter
from truing.diagnose.fit import Fit
from truing.diagnose.problem import Problem, is_identifiable

# The first-order amplitude is limited to these multiples of the probe's amplitude.
MIN_SCALE, MAX_SCALE = 0.15, 4.0
# A scanned parameter starts at the probe's own value: starts are compared with shapes scaled by this at most.
MAX_SCANNED_SCALE = 1.5
# Further starting values are used if their predicted gain is this share of the best one's.
MIN_SHARE_OF_BEST = 0.6


@dataclass(frozen=True, slots=True)
class Probe:
    """Change of the refitted baseline's signals by an effect at one set of starting values.

    Attributes
    ----------
    values : the effect's parameters.
    groups : names of the parameters that scale together, one group per shape.
    speeds : shape (n, 2, groups), m/s.
    pose : shape (m, 3, groups), m, m, rad.
    """

    values: dict[str, float]
    groups: tuple[tuple[str, ...], ...]
    speeds: FloatArray
    pose: FloatArray


@dataclass(frozen=True, slots=True)
class Candidate:
    """The score test of one effect.

    Attributes
    ----------
    gain : predicted log-likelihood gain, first order, nats.
    starts : simulator vectors to fit from, best first.
    """

    name: str
    gain: float
    starts: tuple[FloatArray, ...]


Probes = dict[str, tuple[Probe, ...]]


def simulate_probes(problem: Problem, base: Fit, names: Sequence[str]) -> Probes:
    """Simulate every effect of `names` at its starting values, added to the refitted baseline."""
    base_pose = problem.raw_pose(base.theta, base.effects)
    return {
        name: tuple(
            _probe(problem, base, base_pose, CATALOGUE[name], values, groups)
            for values, groups in trial_points(CATALOGUE[name])
        )
        for name in names
    }


def rank_candidates(problem: Problem, anchor: Fit, probes: Probes, *, keep: int = 2) -> list[Candidate]:
    """Score test of every probed effect that `anchor` lacks, largest predicted gain first.

    The shapes are those beside the baseline, whatever the anchor; they are made orthogonal to the
    anchor's own derivatives.
    """
    flat = anchor.residual.flat()
    span = _orthonormal(problem.jacobian(anchor.theta, anchor.effects, anchor.columns))
    found = [
        _score_test(problem, anchor, name, probes, flat, span, keep)
        for name, probes in probes.items()
        if name not in anchor.effects
    ]
    return sorted(found, key=lambda candidate: -candidate.gain)


def _score_test(
    problem: Problem,
    anchor: Fit,
    name: str,
    probes: tuple[Probe, ...],
    flat: FloatArray,
    span: FloatArray,
    keep: int,
) -> Candidate:
    effect = CATALOGUE[name]
    scanned = {p.name for p in effect.parameters if p.scan}
    target = flat - span @ (span.T @ flat)
    gains: list[float] = []
    found: list[tuple[float, FloatArray]] = []
    for probe in probes:
        shapes = problem.flattened(probe.speeds, probe.pose)
        shapes -= span @ (span.T @ shapes)
        scales = _project(target, shapes, [_signed(effect, group) for group in probe.groups])
        gains.append(_gain(target, shapes @ scales))
        fixed = [scanned.issuperset(group) for group in probe.groups]
        near = np.where(fixed, np.clip(scales, 1.0 / MAX_SCANNED_SCALE, MAX_SCANNED_SCALE), scales)
        start = _start_vector(problem, anchor, effect, probe, scales)
        found.append((_gain(target, shapes @ near), start))
    found.sort(key=lambda entry: -entry[0])
    good = [theta for gain, theta in found[1:keep] if gain >= MIN_SHARE_OF_BEST * found[0][0] > 0.0]
    return Candidate(name, max(gains) + problem.evidence((name,)), (found[0][1], *good))


def trial_points(effect: Effect) -> list[tuple[dict[str, float], list[tuple[str, ...]]]]:
    """Parameter values to probe, each with the groups of parameters that scale together.

    Scanned and nuisance parameters take all combinations of their starting values; amplitudes take theirs
    in turn. Amplitudes of either sign (sine and cosine, the axes of a slope) are linear: one value each,
    each its own group. The pose does not separate the wheels: there each wheel's parameter is its own
    group.
    """
    grid = [p for p in effect.parameters if p.scan or p.nuisance]
    amplitudes = [p for p in effect.parameters if not (p.scan or p.nuisance or p.plain)]
    kinds: dict[str, list[str]] = {}
    for p in amplitudes:
        kinds.setdefault(_group(effect, p), []).append(p.name)
    groups = [tuple(names) for names in kinds.values()] or [tuple(p.name for p in grid if p.scan)]
    depth = max((len(p.starts) for p in amplitudes if not signed(p)), default=1)
    points = []
    for combination in itertools.product(*(p.starts for p in grid)):
        for level in range(depth):
            values = {p.name: value for p, value in zip(grid, combination, strict=True)}
            values |= {p.name: p.starts[min(level, len(p.starts) - 1)] for p in amplitudes}
            points.append((values, groups))
    return points


def signed(parameter: Parameter) -> bool:
    """Whether an amplitude may have either sign."""
    return parameter.lower < parameter.off < parameter.upper


def _signed(effect: Effect, group: tuple[str, ...]) -> bool:
    return all(signed(p) for p in effect.parameters if p.name in group)


def _group(effect: Effect, parameter: Parameter) -> str:
    if effect.domain != "wheel" and parameter.wheel is not None:
        return parameter.name
    return _kind(parameter) if signed(parameter) else "amplitude"


def _kind(parameter: Parameter) -> str:
    return "_".join(word for word in parameter.name.split("_") if word not in SIDES) or "side"


def _probe(
    problem: Problem,
    base: Fit,
    base_pose: FloatArray,
    effect: Effect,
    values: dict[str, float],
    groups: list[tuple[str, ...]],
) -> Probe:
    """One shape per group of parameters, per wheel where the wheels have parameters of their own."""
    layout = problem.simulator.layout
    effects = (*problem.base_effects, *base.effects, effect.name)
    sided = {p.name: p.wheel for p in effect.parameters}
    speeds: list[FloatArray] = []
    poses: list[FloatArray] = []
    probe_groups: list[tuple[str, ...]] = []
    for names in groups:
        theta = base.theta.copy()
        for p in effect.parameters:
            on = (p.name in names or p.scan or p.nuisance) and is_identifiable(p, problem.data, effects)
            theta[layout.index(f"{effect.name}.{p.name}")] = values[p.name] if on else p.off
        speed_change = problem.simulator.speeds(theta, problem.masks(effects)) - base.residual.speeds
        in_pose = problem.data.commanded or effect.domain != "wheel"
        pose_change = base_pose - problem.raw_pose(theta, effects) if in_pose else np.zeros_like(base_pose)
        by_wheel = {side: tuple(n for n in names if sided[n] == side) for side in SIDES}
        if all(by_wheel.values()) and not pose_change.any():
            for wheel, side in enumerate(SIDES):
                only = np.zeros_like(speed_change)
                only[:, wheel] = speed_change[:, wheel]
                speeds.append(only)
                poses.append(pose_change)
                probe_groups.append(by_wheel[side])
        else:
            speeds.append(speed_change)
            poses.append(pose_change)
            probe_groups.append(names)
    return Probe(values, tuple(probe_groups), np.stack(speeds, axis=-1), np.stack(poses, axis=-1))


def _orthonormal(columns: FloatArray) -> FloatArray:
    scale = np.sqrt(np.sum(columns**2, axis=0))
    used = columns[:, scale > 0.0] / scale[scale > 0.0]
    q, r = np.linalg.qr(used)
    return np.asarray(q[:, np.abs(np.diag(r)) > 1e-8])


def _gain(target: FloatArray, explained: FloatArray) -> float:
    """Log-likelihood gain of what a shape explains of the residual, nats."""
    left = target - explained
    return 0.5 * float(target @ target - left @ left)


def _project(target: FloatArray, shapes: FloatArray, signs: list[bool]) -> FloatArray:
    """Least-squares scale of each shape (non-negative unless signed)."""
    active = list(np.flatnonzero(np.sum(shapes**2, axis=0) > 1e-9))
    scales = np.zeros(shapes.shape[1])
    while active:
        part = shapes[:, active]
        gram = part.T @ part
        solution = np.linalg.solve(gram + 1e-9 * np.trace(gram) * np.eye(len(active)), part.T @ target)
        worst = min(range(len(active)), key=lambda k: 0.0 if signs[active[k]] else solution[k])
        if solution[worst] < 0.0 and not signs[active[worst]]:
            active.pop(worst)
            continue
        scales[active] = solution
        break
    return scales


def _start_vector(
    problem: Problem,
    anchor: Fit,
    effect: Effect,
    probe: Probe,
    scales: FloatArray,
) -> FloatArray:
    """Starting vector: amplitudes at their projected size, limited."""
    layout = problem.simulator.layout
    effects = (*problem.base_effects, *anchor.effects, effect.name)
    start, values = anchor.theta.copy(), probe.values
    scale_of = {
        name: float(scale) for names, scale in zip(probe.groups, scales, strict=True) for name in names
    }
    for p in effect.parameters:
        value = values.get(p.name, p.off)
        if p.name in scale_of and not p.scan:
            scale = scale_of[p.name]
            low = -MAX_SCALE if signed(p) else MIN_SCALE
            value = p.off + float(np.clip(scale, low, MAX_SCALE)) * (value - p.off)
        if not is_identifiable(p, problem.data, effects):
            value = p.off
        start[layout.index(f"{effect.name}.{p.name}")] = float(np.clip(value, p.lower, p.upper))
    return start
