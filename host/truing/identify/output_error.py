"""The output-error fit: physical parameters that minimise the free-run simulation error."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.errors import IdentifyError
from truing.identify.signals import WheelSignal, thinned
from truing.identify.structures import FREEDOMS, Structure
from truing.levenberg import Minimum, minimise
from truing.model.wheel import PHYSICS_FIELDS, WheelPhysics, simulate_physics

_POSITION = {name: position for position, name in enumerate(PHYSICS_FIELDS)}
_KEPT_STARTS = 3
_SCOUT_ITERATIONS = 12
_ITERATIONS = 60
# A search ends where the cost falls by less than this share, twice in a row. Of so many rows a share of 1e-5
# moves no parameter by more than a hundredth of its interval.
TOLERANCE, TOLERANCE_OF_MANY, MANY_ROWS = 1e-7, 1e-6, 20_000


@dataclass(frozen=True, slots=True)
class PhysicsFit:
    """A fitted wheel.

    Attributes
    ----------
    physics : the fitted parameters.
    structure : which of them were free.
    initial_mps : shape (segments,), fitted speed at the first row of every segment.
    predicted_mps : shape (n,), free-run simulation.
    minimum : the search's end, in the search's own coordinates (see `Coordinates`).
    coordinates : how those coordinates map to parameters.
    """

    physics: WheelPhysics
    structure: Structure
    initial_mps: FloatArray
    predicted_mps: FloatArray
    minimum: Minimum
    coordinates: Coordinates


@dataclass(frozen=True, slots=True)
class Coordinates:
    """The search's vector: the free parameters (some as logarithms), then the free initial speeds."""

    base: FloatArray
    structure: Structure
    free_initial: IntArray
    lower: FloatArray
    upper: FloatArray
    steps: FloatArray

    @property
    def physical(self) -> int:
        """How many entries are physical parameters."""
        return len(self.structure.free)

    def values(self, theta: FloatArray) -> FloatArray:
        """Physical values (18,) for a search vector."""
        values = self.base.copy()
        for k, name in enumerate(self.structure.free):
            values[_POSITION[name]] = np.exp(theta[k]) if FREEDOMS[name].log else theta[k]
        return values

    def initial(self, theta: FloatArray, segments: int) -> FloatArray:
        """Initial speeds (segments,) for a search vector; a segment that starts at rest has zero."""
        initial = np.zeros(segments)
        initial[self.free_initial] = theta[self.physical :]
        return initial

    def encode(self, values: FloatArray, initial: FloatArray) -> FloatArray:
        """Inverse of `values` and `initial`."""
        head = [
            np.log(max(values[_POSITION[name]], np.exp(self.lower[k])))
            if FREEDOMS[name].log
            else values[_POSITION[name]]
            for k, name in enumerate(self.structure.free)
        ]
        return np.concatenate((np.array(head, dtype=np.float64), initial[self.free_initial]))


def measured_initial(signal: WheelSignal) -> tuple[FloatArray, BoolArray]:
    """Speed at the start of every segment from its first rows, and which segments start at rest.

    A wheel rests when its first rows show no speed above half the resolution of the measurement, or
    above a thousandth of the speeds of the set.
    """
    starts = signal.excitation.starts
    still = max(0.5 * signal.resolution_mps, 1e-3 * signal.scale_mps)
    initial = np.zeros(signal.excitation.segments)
    resting = np.zeros(signal.excitation.segments, dtype=bool)
    for k in range(signal.excitation.segments):
        head = signal.speed_mps[starts[k] : min(starts[k] + 3, starts[k + 1])]
        resting[k] = bool(np.all(np.abs(head[:2]) <= still))
        initial[k] = 0.0 if resting[k] else float(np.mean(head))
    return initial, resting


def fit_physics(
    signal: WheelSignal,
    structure: Structure,
    *,
    base: WheelPhysics | None = None,
    start: WheelPhysics | None = None,
    initial_mps: FloatArray | None = None,
    iterations: int = _ITERATIONS,
) -> PhysicsFit:
    """Fit the free parameters and each segment's initial speed; every run counts the same.

    Parameters
    ----------
    base : values of the parameters that are not free.
    start : where to search from; without it the search starts from the best points of a grid over
        time constant, delay and friction, the gain at each solved by least squares.
    initial_mps : shape (segments,), where the initial speeds are searched from; None: from the first rows.
    """
    if np.ptp(signal.excitation.effort) == 0.0:
        raise IdentifyError("the effort never changes, so that nothing can be identified from it")
    if np.ptp(signal.speed_mps) == 0.0:
        raise IdentifyError("the measured speed never changes: check the encoder, and that the wheel turned")
    coordinates = _coordinates(signal, structure, base)
    initial = measured_initial(signal)[0] if initial_mps is None else initial_mps
    # Of a fast log fewer rows lead to the neighbourhood of the minimum; all of them decide where it is.
    fewer = thinned(signal) if start is None else None
    search = _Search(signal if fewer is None else fewer, coordinates)
    if start is not None:
        starts = [coordinates.encode(start.to_vector(), initial)]
    else:
        starts = search.grid(initial)
    best: Minimum | None = None
    if len(starts) > 1:
        scouts = [search.run(theta, _SCOUT_ITERATIONS) for theta in starts]
        best = min(scouts, key=lambda end: end.cost)
        starts = [best.theta]
    end = search.run(starts[0], iterations)
    if best is not None and best.cost < end.cost:
        end = best
    if fewer is not None:
        end = _Search(signal, coordinates).run(end.theta, iterations)
    values = coordinates.values(end.theta)
    fitted_initial = coordinates.initial(end.theta, signal.excitation.segments)
    predicted = simulate_physics(values, signal.excitation, fitted_initial).speed_mps
    return PhysicsFit(
        WheelPhysics.from_vector(values), structure, fitted_initial, predicted, end, coordinates
    )


def sensitivities(signal: WheelSignal, fit: PhysicsFit) -> FloatArray:
    """Derivatives of the weighted residuals by the search's coordinates, where it ended, shape (n, p)."""
    return _Search(signal, fit.coordinates).jacobian(fit.minimum.theta, fit.minimum.residual)


def fit_nested(signal: WheelSignal, structure: Structure, inner: PhysicsFit) -> PhysicsFit:
    """Fit a richer structure from the fitted simpler one: the new parameters start at several values."""
    fewer = thinned(signal)
    if fewer is None:
        return _nested(signal, structure, inner)
    found = _nested(fewer, structure, inner)
    start, initial = found.physics, found.initial_mps
    return fit_physics(signal, structure, start=start, base=inner.physics, initial_mps=initial)


def _nested(signal: WheelSignal, structure: Structure, inner: PhysicsFit) -> PhysicsFit:
    new = [name for name in structure.free if name not in inner.structure.free]
    best: PhysicsFit | None = None
    # Where the excess fades with speed it acts on moving wheels too, and slopes show the way.
    fades = "stribeck_mps" in structure.free
    starts = [
        FREEDOMS[name].starts[1:4:2] if name == "breakaway_excess" and fades else FREEDOMS[name].starts
        for name in new
    ]
    choices = list(itertools.product(*starts))
    for values in choices:
        begin = replace(inner.physics, **dict(zip(new, values, strict=True)))
        # Of several starts only the most promising is followed to its end.
        iterations = _SCOUT_ITERATIONS if len(choices) > 1 else _ITERATIONS
        fit = fit_physics(signal, structure, start=begin, base=inner.physics, iterations=iterations)
        if best is None or fit.minimum.cost < best.minimum.cost:
            best = fit
    assert best is not None
    if not best.minimum.converged and len(choices) > 1:
        start, initial = best.physics, best.initial_mps
        best = fit_physics(signal, structure, start=start, base=inner.physics, initial_mps=initial)
    if "breakaway_excess" in new and not fades:
        best = _scan_breakaway(signal, structure, best)
    return best


def _scan_breakaway(signal: WheelSignal, structure: Structure, best: PhysicsFit) -> PhysicsFit:
    """Walk the breakaway friction in ever smaller steps: the cost is a staircase in it."""
    step = 0.5 * max(best.physics.breakaway_excess, 0.01)
    while step > 5e-4:
        improved = False
        for value in (best.physics.breakaway_excess - step, best.physics.breakaway_excess + step):
            if value < 0.0:
                continue
            begin = replace(best.physics, breakaway_excess=value)
            fit = fit_physics(signal, structure, start=begin, base=best.physics)
            if fit.minimum.cost < (1.0 - 1e-6) * best.minimum.cost:
                best, improved = fit, True
        if not improved:
            step *= 0.5
    return best


def _coordinates(signal: WheelSignal, structure: Structure, base: WheelPhysics | None) -> Coordinates:
    _, resting = measured_initial(signal)
    free_initial = np.flatnonzero(~resting).astype(np.int64)
    top = 3.0 * float(np.max(np.abs(signal.speed_mps))) + 1e-6
    lower, upper, steps = [], [], []
    for name in structure.free:
        freedom = FREEDOMS[name]
        lower.append(np.log(freedom.lower) if freedom.log else freedom.lower)
        upper.append(np.log(freedom.upper) if freedom.log else freedom.upper)
        steps.append(freedom.step)
    return Coordinates(
        (base or WheelPhysics(1.0, 0.1)).to_vector(),
        structure,
        free_initial,
        np.array(lower + [-top] * len(free_initial)),
        np.array(upper + [top] * len(free_initial)),
        np.array(steps),
    )


class _Search:
    """Weighted residuals and their derivatives for one signal."""

    def __init__(self, signal: WheelSignal, coordinates: Coordinates) -> None:
        self.signal = signal
        self.coordinates = coordinates
        self.weights = signal.weights()
        segment_of_row = np.repeat(np.arange(signal.excitation.segments), np.diff(signal.excitation.starts))
        self.masks = [segment_of_row == k for k in coordinates.free_initial]

    def simulate(self, theta: FloatArray) -> FloatArray:
        c, excitation = self.coordinates, self.signal.excitation
        initial = c.initial(theta, excitation.segments)
        return simulate_physics(c.values(theta), excitation, initial).speed_mps

    def residual(self, theta: FloatArray) -> FloatArray:
        return self.weights * (self.simulate(theta) - self.signal.speed_mps)

    def jacobian(self, theta: FloatArray, residual: FloatArray) -> FloatArray:
        """Forward differences; segments are independent, so that one run serves all initial speeds."""
        c = self.coordinates
        result = np.zeros((len(residual), len(theta)))
        for k in range(c.physical):
            step = float(c.steps[k]) * max(1.0, abs(float(theta[k])))
            if theta[k] + step > c.upper[k]:
                step = -step
            moved = theta.copy()
            moved[k] += step
            result[:, k] = (self.residual(moved) - residual) / step
        if self.masks:
            step = 1e-6 * max(1.0, float(np.max(np.abs(theta[c.physical :]))))
            moved = theta.copy()
            moved[c.physical :] += step
            change = (self.residual(moved) - residual) / step
            for k, mask in enumerate(self.masks):
                result[mask, c.physical + k] = change[mask]
        return result

    def run(self, theta: FloatArray, iterations: int) -> Minimum:
        c = self.coordinates
        tolerance = TOLERANCE if len(self.signal) < MANY_ROWS else TOLERANCE_OF_MANY
        return minimise(
            self.residual, self.jacobian, theta, c.lower, c.upper, iterations=iterations, tolerance=tolerance
        )

    def grid(self, initial: FloatArray) -> list[FloatArray]:
        """The best few points of a coarse grid, the gain at each by least squares.

        With friction in effort units the speed is proportional to the gain, so that one simulation
        at unit gain is enough for a point.
        """
        c, signal = self.coordinates, self.signal
        scale = float(np.percentile(np.abs(signal.speed_mps), 98.0)) / max(
            float(np.percentile(np.abs(signal.excitation.effort), 98.0)), 1e-9
        )
        weighted = self.weights * signal.speed_mps
        points: list[tuple[float, FloatArray]] = []
        names = [name for name in c.structure.free if name != "gain_mps"]
        top_effort = float(np.max(np.abs(signal.excitation.effort)))
        choices = [
            [value for value in FREEDOMS[name].starts if name != "friction" or value < 0.7 * top_effort]
            for name in names
        ]
        for chosen in itertools.product(*choices):
            values = c.base.copy()
            for name, value in zip(names, chosen, strict=True):
                values[_POSITION[name]] = value
            gain_free = "gain_mps" in c.structure.free
            if gain_free:
                values[_POSITION["gain_mps"]] = scale
            response = self.weights * simulate_physics(values, signal.excitation, initial).speed_mps
            if gain_free:
                energy = float(response @ response)
                factor = float(response @ weighted) / energy if energy > 0.0 else 1.0
                values[_POSITION["gain_mps"]] = scale * factor
                response *= factor
            difference = response - weighted
            points.append((float(difference @ difference), c.encode(values, initial)))
        points.sort(key=lambda point: point[0])
        return [theta for _, theta in points[:_KEPT_STARTS]]
