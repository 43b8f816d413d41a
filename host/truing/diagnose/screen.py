"""A first look at every effect: how much of the misfit each could take away, to first order, and from where.

For each starting value of an effect one simulation shows how it would bend the speeds. That shape, scaled,
and the baseline's own derivatives are projected on the residual (a score test at a finite amplitude; Rao
1948). The projection costs one simulation where a fit costs dozens; it decides where fits start, and
which effects are worth one.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.effect import Effect, Parameter
from truing.diagnose.fit import Fit
from truing.diagnose.problem import Problem
from truing.model.kernel import FloatArray

# A first-order answer is believed between these multiples of the trial amplitude.
LEAST_SCALE, LARGEST_SCALE = 0.15, 4.0
SIDES = ("left", "right")


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


def screen(problem: Problem, anchor: Fit, names: list[str], *, keep: int = 2) -> list[Prospect]:
    """Every effect of `names` beside the effects of `anchor`, the most promising first."""
    flat = anchor.residual.flat()
    span = _orthonormal(problem.jacobian(anchor.theta, anchor.effects, anchor.columns))
    found = [_prospect(problem, anchor, name, flat, span, keep) for name in names]
    return sorted(found, key=lambda prospect: -prospect.gain)


def _prospect(
    problem: Problem, anchor: Fit, name: str, flat: FloatArray, span: FloatArray, keep: int
) -> Prospect:
    effect = CATALOGUE[name]
    looks: list[tuple[float, FloatArray]] = []
    for values, directions in trial_points(effect):
        shapes, owners = _shapes(problem, anchor, effect, values, directions)
        scales, gain = _project(flat, span, shapes, [_signed(effect, owner) for owner in owners])
        looks.append((gain, _place(problem, anchor.theta, effect, values, owners, scales)))
    looks.sort(key=lambda look: -look[0])
    return Prospect(name, looks[0][0], tuple(theta for _, theta in looks[:keep]))


def trial_points(effect: Effect) -> list[tuple[dict[str, float], list[tuple[str, ...]]]]:
    """Values of an effect's parameters to try, each with the groups of parameters that scale together.

    Parameters that are scanned or that only shape the effect take all their starting values; amplitudes
    take theirs one after the other. Amplitudes of either sign (sine and cosine, the axes of a slope) are
    linear: one value each, and each a group of its own.
    """
    grid = [p for p in effect.parameters if p.scan or p.nuisance]
    amplitudes = [p for p in effect.parameters if not (p.scan or p.nuisance)]
    kinds: dict[str, list[str]] = {}
    for p in amplitudes:
        kinds.setdefault(_kind(p) if signed(p) else "amplitude", []).append(p.name)
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


def _kind(parameter: Parameter) -> str:
    return "_".join(word for word in parameter.name.split("_") if word not in SIDES) or "side"


def _shapes(
    problem: Problem,
    anchor: Fit,
    effect: Effect,
    values: dict[str, float],
    directions: list[tuple[str, ...]],
) -> tuple[FloatArray, list[tuple[str, ...]]]:
    """Change of the flat residual for each direction, by wheel where the wheels have their own numbers."""
    layout = problem.simulator.layout
    effects = (*anchor.effects, effect.name)
    sided = {p.name: p.wheel for p in effect.parameters}
    columns: list[FloatArray] = []
    owners: list[tuple[str, ...]] = []
    for names in directions:
        theta = anchor.theta.copy()
        for p in effect.parameters:
            on = p.name in names or p.scan or p.nuisance
            theta[layout.index(f"{effect.name}.{p.name}")] = values[p.name] if on else p.off
        moved = problem.residual(theta, effects)
        wheels = anchor.residual.wheels - moved.wheels
        pose = anchor.residual.pose - moved.pose
        wheel_names = {side: tuple(n for n in names if sided[n] == side) for side in SIDES}
        if all(wheel_names.values()) and not pose.any():
            for k, side in enumerate(SIDES):
                only = np.zeros_like(wheels)
                only[:, k] = wheels[:, k]
                columns.append(np.concatenate((only.ravel(), pose.ravel())))
                owners.append(wheel_names[side])
        else:
            columns.append(np.concatenate((wheels.ravel(), pose.ravel())))
            owners.append(names)
    return np.stack(columns, axis=1), owners


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
    owners: list[tuple[str, ...]],
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
