"""Whether runs show a wheel's time constant at all, and which interval a parameter can physically have."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from truing.identify.output_error import PhysicsFit, fit_physics
from truing.identify.signals import WheelSignal
from truing.identify.structures import FREEDOMS, Structure

TIME_CONSTANT = "time_constant_s"
STEPS_ADVICE = "Record steps of several levels both ways, with rests between them"
# A time constant that may as well be this many times longer or shorter is not known; its interval may be as
# wide as the two together.
UNKNOWN_FACTOR = 4.0
LARGEST_RATIO = UNKNOWN_FACTOR**2
# Growth of the loss per row, for each free initial speed and parameter, that chance alone reaches (the 99.9 %
# quantile of chi-squared with one degree of freedom is 10.8; residuals resemble their neighbours).
LOSS_PER_FREEDOM = 4.0
# Efforts that differ by less are constant; a speed that changes by less over a run has settled.
CONSTANT_EFFORT = 5e-3
SETTLED_SHARE = 0.3
_REFIT_ITERATIONS = 15
_EDGE = 1e-3


def why_no_time_constant(signal: WheelSignal, fit: PhysicsFit) -> str | None:
    """Why these runs do not show the time constant of `fit`; None where they do."""
    if has_constant_efforts(signal):
        return "the efforts are constant and the wheel has settled before the first row"
    value = fit.physics.time_constant_s
    bound = at_a_bound(fit)
    if bound is not None:
        return bound
    grown = 1.0 + LOSS_PER_FREEDOM * (signal.excitation.segments + fit.coordinates.physical) / len(signal)
    for factor in (1.0 / UNKNOWN_FACTOR, UNKNOWN_FACTOR):
        if _loss_at(signal, fit, factor * value) < grown * fit.minimum.cost:
            return f"{factor * value:.2g} s fits as well as {value:.2g} s"
    return None


def at_a_bound(fit: PhysicsFit) -> str | None:
    """Which end of what is searched the time constant stands at, in a sentence; None: at neither."""
    freedom = FREEDOMS[TIME_CONSTANT]
    value = fit.physics.time_constant_s
    if TIME_CONSTANT not in fit.structure.free:
        return None
    if value >= (1.0 - _EDGE) * freedom.upper:
        return f"the search ended at the longest that is tried, {freedom.upper:g} s"
    if value <= (1.0 + _EDGE) * freedom.lower:
        return f"the search ended at the shortest that is tried, {freedom.lower:g} s"
    return None


def has_constant_efforts(signal: WheelSignal) -> bool:
    """Whether every run holds one level of effort at one speed: only gain and friction show there."""
    for a, b in pairwise(signal.excitation.starts):
        if np.ptp(signal.excitation.effort[a:b]) > CONSTANT_EFFORT:
            return False
        speed = signal.speed_mps[a:b]
        count = max(len(speed) // 10, 2)
        begin, end = float(np.median(speed[:count])), float(np.median(speed[-count:]))
        if abs(begin - end) > SETTLED_SHARE * max(abs(begin), abs(end)):
            return False
    return True


def _loss_at(signal: WheelSignal, fit: PhysicsFit, time_constant_s: float) -> float:
    """Smallest loss with the time constant held at a value, all others refitted."""
    held = replace(fit.physics, time_constant_s=time_constant_s)
    free = tuple(name for name in fit.structure.free if name != TIME_CONSTANT)
    structure = Structure("time constant held", free)
    end = fit_physics(
        signal, structure, base=held, start=held, initial_mps=fit.initial_mps, iterations=_REFIT_ITERATIONS
    )
    return end.minimum.cost
