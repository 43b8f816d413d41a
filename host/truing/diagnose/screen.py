"""A first look at every effect: how much of the misfit each could take away, to first order, and from where.

For each starting value of an effect one simulation shows how it would bend the speeds. That shape, scaled,
and the baseline's own derivatives are projected on the residual (a score test at a finite amplitude; Rao
1948). The projection costs one simulation where a fit costs dozens; it decides where fits start, and
which effects are worth one.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.effect import Effect, Parameter
from truing.diagnose.fit import Fit
from truing.diagnose.problem import Problem
from truing.model.kernel import FloatArray

# A first-order answer is believed between these multiples of the trial amplitude.
LEAST_SCALE, LARGEST_SCALE = 0.15, 4.0
# A second start is worth a try when it promises this share of what the first does.
LEAST_OF_BEST = 0.6
SIDES = ("left", "right")


@dataclass(frozen=True, slots=True)
class Look:
    """How an effect at one set of starting values bends what the refitted baseline says.

    Attributes
    ----------
    values : the effect's parameters.
    owners : names of the parameters that scale together, one group for each shape.
    speeds : shape (n, 2, owners), m/s.
    pose : shape (m, 3, owners), m, m, rad.
    """

    values: dict[str, float]
    owners: tuple[tuple[str, ...], ...]
    speeds: FloatArray
    pose: FloatArray


@dataclass(frozen=True, slots=True)
class Prospect:
    """One effect, before it is fitted.

    Attributes
    ----------
    gain : log-likelihood that the first-order answer promises, nats.
    starts : simulator vectors to fit from, the most promising first.
    """

    name: str
    gain: float
    starts: tuple[FloatArray, ...]


Looks = dict[str, tuple[Look, ...]]


def looks_of(problem: Problem, base: Fit, names: Sequence[str]) -> Looks:
    """Simulate every effect of `names` at its starting values beside the refitted baseline."""
    still = problem.raw_pose(base.theta, base.effects)
    return {
        name: tuple(
            _look(problem, base, still, CATALOGUE[name], values, groups)
            for values, groups in trial_points(CATALOGUE[name])
        )
        for name in names
    }


def screen(problem: Problem, anchor: Fit, looks: Looks, *, keep: int = 2) -> list[Prospect]:
    """Every effect that was looked at beside the effects of `anchor`, the most promising first.

    The shapes are those beside the baseline, whatever the anchor: only what the anchor already explains,
    and what its own numbers could, is taken off.
    """
    flat = anchor.residual.flat()
    span = _orthonormal(problem.jacobian(anchor.theta, anchor.effects, anchor.columns))
    found = [
        _prospect(problem, anchor, name, ways, flat, span, keep)
        for name, ways in looks.items()
        if name not in anchor.effects
    ]
    return sorted(found, key=lambda prospect: -prospect.gain)


def _prospect(
    problem: Problem,
    anchor: Fit,
    name: str,
    ways: tuple[Look, ...],
    flat: FloatArray,
    span: FloatArray,
    keep: int,
) -> Prospect:
    effect = CATALOGUE[name]
    found: list[tuple[float, FloatArray]] = []
    for look in ways:
        shapes = problem.flattened(look.speeds, look.pose)
        scales, gain = _project(flat, span, shapes, [_signed(effect, owner) for owner in look.owners])
        found.append((gain, _place(problem, anchor.theta, effect, look.values, look.owners, scales)))
    found.sort(key=lambda one: -one[0])
    good = [theta for gain, theta in found[:keep] if gain >= LEAST_OF_BEST * found[0][0]]
    return Prospect(name, found[0][0] + problem.evidence((name,)), tuple(good))


def trial_points(effect: Effect) -> list[tuple[dict[str, float], list[tuple[str, ...]]]]:
    """Values of an effect's parameters to try, each with the groups of parameters that scale together.

    Parameters that are scanned or that only shape the effect take all their starting values; amplitudes
    take theirs one after the other. Amplitudes of either sign (sine and cosine, the axes of a slope) are
    linear: one value each, and each a group of its own. In the pose the wheels do not part by themselves:
    there each wheel's number is a group of its own.
    """
    grid = [p for p in effect.parameters if p.scan or p.nuisance]
    amplitudes = [p for p in effect.parameters if not (p.scan or p.nuisance)]
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
    """Whether an amplitude may lie on either side of nothing."""
    return parameter.lower < parameter.off < parameter.upper


def _signed(effect: Effect, owner: tuple[str, ...]) -> bool:
    return all(signed(p) for p in effect.parameters if p.name in owner)


def _group(effect: Effect, parameter: Parameter) -> str:
    if effect.domain != "wheel" and parameter.wheel is not None:
        return parameter.name
    return _kind(parameter) if signed(parameter) else "amplitude"


def _kind(parameter: Parameter) -> str:
    return "_".join(word for word in parameter.name.split("_") if word not in SIDES) or "side"


def _look(
    problem: Problem,
    base: Fit,
    still: FloatArray,
    effect: Effect,
    values: dict[str, float],
    groups: list[tuple[str, ...]],
) -> Look:
    """One shape for each group of parameters, by wheel where the wheels have their own numbers."""
    layout = problem.simulator.layout
    effects = (*base.effects, effect.name)
    sided = {p.name: p.wheel for p in effect.parameters}
    speeds: list[FloatArray] = []
    poses: list[FloatArray] = []
    owners: list[tuple[str, ...]] = []
    for names in groups:
        theta = base.theta.copy()
        for p in effect.parameters:
            on = p.name in names or p.scan or p.nuisance
            theta[layout.index(f"{effect.name}.{p.name}")] = values[p.name] if on else p.off
        bent = problem.simulator.speeds(theta, problem.masks(effects)) - base.residual.speeds
        in_pose = problem.data.commanded or effect.domain != "wheel"
        moved = still - problem.raw_pose(theta, effects) if in_pose else np.zeros_like(still)
        by_wheel = {side: tuple(n for n in names if sided[n] == side) for side in SIDES}
        if all(by_wheel.values()) and not moved.any():
            for wheel, side in enumerate(SIDES):
                only = np.zeros_like(bent)
                only[:, wheel] = bent[:, wheel]
                speeds.append(only)
                poses.append(moved)
                owners.append(by_wheel[side])
        else:
            speeds.append(bent)
            poses.append(moved)
            owners.append(names)
    return Look(values, tuple(owners), np.stack(speeds, axis=-1), np.stack(poses, axis=-1))


def _orthonormal(columns: FloatArray) -> FloatArray:
    scale = np.sqrt(np.sum(columns**2, axis=0))
    used = columns[:, scale > 0.0] / scale[scale > 0.0]
    q, r = np.linalg.qr(used)
    return np.asarray(q[:, np.abs(np.diag(r)) > 1e-8])


def _project(
    flat: FloatArray, span: FloatArray, shapes: FloatArray, signs: list[bool]
) -> tuple[FloatArray, float]:
    """Best scale of each shape beside the span (none below zero unless signed), and the gain in nats."""
    rest = shapes - span @ (span.T @ shapes)
    target = flat - span @ (span.T @ flat)
    active = list(np.flatnonzero(np.sum(rest**2, axis=0) > 1e-9))
    scales = np.zeros(shapes.shape[1])
    while active:
        part = rest[:, active]
        gram = part.T @ part
        solution = np.linalg.solve(gram + 1e-9 * np.trace(gram) * np.eye(len(active)), part.T @ target)
        worst = min(range(len(active)), key=lambda k: 0.0 if signs[active[k]] else solution[k])
        if solution[worst] < 0.0 and not signs[active[worst]]:
            active.pop(worst)
            continue
        scales[active] = solution
        left = target - part @ solution
        return scales, 0.5 * float(target @ target - left @ left)
    return scales, 0.0


def _place(
    problem: Problem,
    theta: FloatArray,
    effect: Effect,
    values: dict[str, float],
    owners: tuple[tuple[str, ...], ...],
    scales: FloatArray,
) -> FloatArray:
    """The vector to fit from: amplitudes at their projected size, within reason."""
    layout = problem.simulator.layout
    start = theta.copy()
    scale_of = {name: float(scale) for names, scale in zip(owners, scales, strict=True) for name in names}
    for p in effect.parameters:
        value = values[p.name]
        if p.name in scale_of and not p.scan:
            scale = scale_of[p.name]
            low = -LARGEST_SCALE if signed(p) else LEAST_SCALE
            value = p.off + float(np.clip(scale, low, LARGEST_SCALE)) * (value - p.off)
        start[layout.index(f"{effect.name}.{p.name}")] = float(np.clip(value, p.lower, p.upper))
    return start
