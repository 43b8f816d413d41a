"""One wheel's physics from runs: fit, intervals, and the error on runs that the fit never saw."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import IdentifyError
from truing.identify.identifiable import LARGEST_RATIO, TIME_CONSTANT, why_no_time_constant
from truing.identify.model_error import FreeRunError, free_run_error
from truing.identify.output_error import (
    PhysicsFit,
    fit_nested,
    fit_physics,
    measured_initial,
    sensitivities,
)
from truing.identify.quantity import Quantity
from truing.identify.signals import WheelSignal, shown_resolution, wheel_signal
from truing.identify.structures import DELAY, FREEDOMS, Structure
from truing.identify.structures import structure as structure_named
from truing.identify.uncertainty import half_widths, rounding_half_widths
from truing.model.wheel import PHYSICS_FIELDS, WheelPhysics, simulate_physics
from truing.recording.run import Geometry, Run, Wheel

UNITS: dict[str, str] = {
    "gain_mps": "m/s",
    "time_constant_s": "s",
    "delay_s": "s",
    "friction": "effort",
    "breakaway_excess": "effort",
    "stribeck_mps": "m/s",
    "drag": "effort/(m/s)^2",
    "offset": "effort",
    "lag_s": "s",
    "recorder_lag_s": "s",
    "recorder_window_s": "s",
}
RATIO = "ratio"
# What only a changing speed shows.
DYNAMIC = (TIME_CONSTANT, "delay_s")
MANY_RUNS = 6
# Rows that are averaged before the residual's memory is modelled, as a share of the time constant.
BLOCK_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class WheelFit:
    """A fitted wheel, what pins it down, and how well it simulates.

    Attributes
    ----------
    parameters : the free parameters, each with its 95 % interval or why there is none.
    free_run : simulation error on the runs that were fitted.
    held_out : the same with every run left out of the fit in turn; None when it was not asked for.
    search : where the search ended, for whoever goes on from there.
    notes : what a user should know before using the numbers.
    """

    wheel: Wheel
    structure: Structure
    physics: WheelPhysics
    parameters: dict[str, Quantity]
    free_run: FreeRunError
    held_out: FreeRunError | None
    signal: WheelSignal = field(repr=False)
    search: PhysicsFit = field(repr=False)
    notes: tuple[str, ...] = ()

    @property
    def predicted_mps(self) -> FloatArray:
        """The simulation, row by row of `signal`, shape (n,)."""
        return self.search.predicted_mps

    def with_intervals(self) -> WheelFit:
        """The same fit with its parameters' intervals, which take longer than the fit itself."""
        parameters, notes = _quantities(self.signal, self.search, True)
        return replace(self, parameters=parameters, notes=tuple(notes))

    def with_runs_left_out(self, shared: SharedFits) -> WheelFit:
        """The same fit, judged on every run that is left out of it in turn, where there are several."""
        if self.signal.runs < 2:
            return self
        try:
            return replace(self, held_out=leave_one_run_out(shared, self.structure, self.search))
        except IdentifyError as error:
            return replace(self, notes=(*self.notes, _no_run_left_out(error)))

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "wheel": self.wheel,
            "model": "grey_box",
            "structure": self.structure.name,
            "parameters": {name: quantity.to_json() for name, quantity in self.parameters.items()},
            "free_run": self.free_run.to_json(),
            "free_run_held_out": None if self.held_out is None else self.held_out.to_json(),
            "notes": list(self.notes),
        }


def fit_wheel(
    runs: Sequence[Run],
    side: Wheel,
    structure: Structure | str = DELAY,
    baseline: Geometry | None = None,
    *,
    hold_out: bool = True,
    intervals: bool = True,
    nested: PhysicsFit | None = None,
    shared: SharedFits | None = None,
) -> WheelFit:
    """Fit one wheel's physics to all runs together, every run with the same weight.

    Parameters
    ----------
    structure : which parameters are free, or the name of such a choice (see `structures`).
    baseline : what turns counts into travel.
    hold_out : also leave out every run in turn (needs two runs or more).
    intervals : also find the parameters' 95 % intervals.
    nested : the search's end of a simpler structure for the same runs.
    shared : of the same runs and wheel, where several structures are fitted.
    """
    if isinstance(structure, str):
        structure = structure_named(structure)
    shared = shared or SharedFits(wheel_signal(runs, side, baseline))
    signal = shared.signal
    fit = fit_structure(shared, structure, nested)
    by_run = signal.rms_by_run(fit.predicted_mps - signal.speed_mps)
    parameters, notes = _quantities(signal, fit, intervals)
    found = WheelFit(
        side,
        structure,
        fit.physics,
        parameters,
        free_run_error(signal.names, by_run, signal.scale_mps),
        None,
        signal,
        fit,
        tuple(notes),
    )
    return found.with_runs_left_out(shared) if hold_out else found


def _no_run_left_out(error: IdentifyError) -> str:
    return f"no run can be left out: of the others {error.message}"


class SharedFits:
    """What the structures of one wheel's ladder have in common, made once.

    These are the signals with a run left out, and the fit of friction and delay to each of them, from which
    every richer structure is searched for.
    """

    def __init__(self, signal: WheelSignal) -> None:
        self.signal = signal
        self._without: dict[int, SharedFits] = {}
        self._fits: dict[tuple[str, ...], PhysicsFit] = {}

    def without(self, run: int) -> SharedFits:
        """The same for all runs but this one; not kept with many runs, where no fit of it is used twice."""
        if run in self._without:
            return self._without[run]
        made = SharedFits(self.signal.select([k for k in range(self.signal.runs) if k != run]))
        if self.signal.runs <= MANY_RUNS:
            self._without[run] = made
        return made

    def fit(self, structure: Structure) -> PhysicsFit:
        """A structure's fit from the grid, for friction and delay or less."""
        if structure.free not in self._fits:
            self._fits[structure.free] = fit_physics(self.signal, structure)
        return self._fits[structure.free]


def fit_structure(shared: SharedFits, structure: Structure, nested: PhysicsFit | None = None) -> PhysicsFit:
    """Fit a structure; one richer than friction and delay is searched for from that model's fit.

    Parameters
    ----------
    nested : the fit of a simpler structure to the same rows. It is one more place to start from, so that a
        richer structure never fits worse than one that it contains.
    """
    signal = shared.signal
    inner = tuple(name for name in DELAY.free if name in structure.free)
    if len(inner) == len(structure.free) or "gain_mps" not in inner:
        found = shared.fit(structure)
    else:
        found = fit_nested(signal, structure, shared.fit(Structure("inner", inner)))
    if nested is None or found.minimum.cost <= nested.minimum.cost:
        return replace(found, structure=structure)
    start, initial = nested.physics, nested.initial_mps
    other = fit_physics(signal, structure, start=start, base=start, initial_mps=initial)
    return min(found, other, key=lambda end: end.minimum.cost)


def leave_one_run_out(
    shared: SharedFits, structure: Structure, whole: PhysicsFit | None = None
) -> FreeRunError:
    """Free-run error of every run under the model fitted to the others.

    The left-out run gives its efforts and the speed of its first rows, nothing else.

    Parameters
    ----------
    whole : the fit to all runs, one more place to start from; of several ends the one that fits the
        other runs best is taken, so that the left-out run decides nothing. With more than six runs
        it is the only start: one run among many does not decide which valley the minimum lies in.
    """
    signal = shared.signal
    if signal.runs < 2:
        raise IdentifyError("leaving one run out needs two runs or more")
    by_run = np.zeros(signal.runs)
    for index in range(signal.runs):
        others = shared.without(index)
        ends: list[PhysicsFit] = []
        if whole is None or signal.runs <= MANY_RUNS:
            ends.append(fit_structure(others, structure))
        if whole is not None:
            ends.append(fit_physics(others.signal, structure, start=whole.physics, base=whole.physics))
        fit = min(ends, key=lambda end: end.minimum.cost)
        left_out = signal.select([index])
        predicted = simulate_signal(fit.physics, left_out)
        by_run[index] = left_out.rms_by_run(predicted - left_out.speed_mps)[0]
    return free_run_error(signal.names, by_run, signal.scale_mps, held_out=True)


def simulate_signal(physics: WheelPhysics, signal: WheelSignal) -> FloatArray:
    """Free-run simulation from the measured first rows of every segment, shape (n,), m/s."""
    initial, _ = measured_initial(signal)
    return simulate_physics(physics.to_vector(), signal.excitation, initial).speed_mps


def _quantities(
    signal: WheelSignal, fit: PhysicsFit, intervals: bool
) -> tuple[dict[str, Quantity], list[str]]:
    """Parameters with 95 % intervals under residuals that may be autocorrelated."""
    weights = signal.weights()
    judged = weights > 0.0
    slopes = sensitivities(signal, fit)
    raw = np.zeros_like(slopes)
    raw[judged] = slopes[judged] / weights[judged, None]
    residual = fit.predicted_mps - signal.speed_mps
    strength = np.sqrt(np.einsum("ij,ij->j", slopes, slopes))
    influential = strength > 1e-9 * max(float(strength.max()), 1e-300)
    margins = np.zeros(len(influential))
    block = max(1, round(BLOCK_SHARE * fit.physics.time_constant_s / float(signal.excitation.interval_s[0])))
    if intervals:
        run_of_row = signal.run_of_row.astype(np.intp)
        found = half_widths(raw[:, influential], residual, weights, run_of_row, block)
        shown = shown_resolution(signal.speed_mps, signal.resolution_mps)
        margins[influential] = np.maximum(found, rounding_half_widths(raw[:, influential], weights, shown))

    why_not = why_no_time_constant(signal, fit) if intervals else None
    values = fit.physics.to_vector()
    parameters: dict[str, Quantity] = {}
    notes: list[str] = []
    for k, name in enumerate(fit.structure.free):
        unit = UNITS.get(name, RATIO)
        value = float(values[PHYSICS_FIELDS.index(name)])
        reason = None if influential[k] else "these runs do not depend on it"
        if why_not is not None and name in DYNAMIC:
            reason = why_not
        ends = _interval(name, value, float(margins[k]))
        if reason is None and intervals:
            reason = _too_wide(name, ends)
        if reason is not None:
            parameters[name] = Quantity.unknown(unit, reason)
            notes.append(f"{name}: {reason}")
            continue
        freedom = FREEDOMS[name]
        edge = 1e-6 * (freedom.upper - freedom.lower)
        if value <= freedom.lower + edge and name not in ("delay_s", "friction", "breakaway_excess"):
            notes.append(f"{name} stands at the lower end of what is searched ({freedom.lower:g} {unit})")
        if value >= freedom.upper - edge:
            notes.append(f"{name} stands at the upper end of what is searched ({freedom.upper:g} {unit})")
        parameters[name] = Quantity(value, unit, ends if intervals else None)
    if not fit.minimum.converged:
        notes.append("the search was still improving when it was stopped")
    if fit.physics.gain_mps < 0.0:
        notes.append("the gain is negative: effort and speed have opposite signs in this recording")
    return parameters, notes


def _interval(name: str, value: float, margin: float) -> tuple[float, float]:
    """The 95 % interval of a parameter, within what is physically possible."""
    freedom = FREEDOMS[name]
    if freedom.log:
        low, high = value * math.exp(-min(margin, 50.0)), value * math.exp(min(margin, 50.0))
    else:
        low, high = value - margin, value + margin
    return max(low, freedom.lower), min(high, freedom.upper)


def _too_wide(name: str, ends: tuple[float, float]) -> str | None:
    """Why an interval means that the parameter is not known; None where it is."""
    low, high = ends
    if name == "gain_mps" and low <= 0.0 <= high:
        return "not pinned down: its 95 % interval holds zero"
    if name == TIME_CONSTANT and high > LARGEST_RATIO * low:
        return f"not pinned down: anything from {low:.2g} to {high:.2g} s fits"
    return None
