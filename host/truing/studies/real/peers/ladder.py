"""Least squares on the free-run error, one more piece of physics at each rung.

What a control engineer does by hand: gain and time constant; dry friction; a delay of the input; a first
order filter of the recorded speed; friction and gain of their own in each direction. Every rung starts
from the fit of the rung below it, so that none fits worse (output-error method; Ljung, System
Identification, 2nd edition, section 7.2).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from truing.arrays import FloatArray
from truing.studies.real.peers.first_order_wheel import NUMBERS, FirstOrderWheel
from truing.studies.real.peers.peer import Peer, WheelModel
from truing.studies.real.peers.wheel_runs import WheelRun

# Ends of the search; a gain is bounded by multiples of top speed over top effort.
LOWEST = {"tau": 0.005, "friction": 0.0, "delay": 0.0, "lag": 0.0}
HIGHEST = {"tau": 5.0, "friction": 0.6, "delay": 0.3, "lag": 0.6}
GAIN_FACTOR = 10.0
# Where a number starts that the rung below does not have.
STARTS = {"tau": (0.1, 0.5), "friction": (0.01, 0.05, 0.15), "delay": (0.0, 0.02, 0.08), "lag": (0.02, 0.15)}
# What is known of a wheel that is never driven: it stands.
STILL = FirstOrderWheel(np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0]))
SCOUT_EVALUATIONS, EVALUATIONS = 8, 50
DERIVATIVE_SHARE = 1e-4


@dataclass(frozen=True, slots=True)
class Rung:
    """A structure: which numbers it has beside those of the rung below.

    Attributes
    ----------
    free : groups of `NUMBERS`; those of a group are equal.
    """

    name: str
    title: str
    free: tuple[tuple[str, ...], ...]


_GAIN = (("gain_forward", "gain_reverse"), ("tau",))
_FRICTION = ("friction_forward", "friction_reverse")
RUNGS = (
    Rung("linear", "straight line", _GAIN),
    Rung("friction", "+ friction", (*_GAIN, _FRICTION)),
    Rung("delay", "+ delay", (*_GAIN, _FRICTION, ("delay",))),
    Rung("filter", "+ filter", (*_GAIN, _FRICTION, ("delay",), ("lag",))),
    Rung("directions", "+ directions", tuple((name,) for name in NUMBERS)),
)


def fit_rung(rung: Rung, runs: Sequence[WheelRun], near: WheelModel | None) -> WheelModel:
    """Fit a structure to runs of one wheel.

    Parameters
    ----------
    near : a model of this rung, refined; or of the rung below, whose missing numbers are searched for;
        None: a search from the data alone.
    """
    from scipy.optimize import least_squares

    scale = _gain_scale(runs)
    if scale == 0.0:
        return STILL
    kinds = [group[0].partition("_")[0] for group in rung.free]
    lower = np.array([LOWEST.get(kind, scale / GAIN_FACTOR) for kind in kinds])
    upper = np.array([HIGHEST.get(kind, scale * GAIN_FACTOR) for kind in kinds])

    def residual(x: FloatArray) -> FloatArray:
        model = FirstOrderWheel(_numbers(rung, x))
        return np.concatenate([(model.simulate(run) - run.speed_mps)[run.judged] for run in runs])

    def search(start: FloatArray, evaluations: int) -> tuple[float, FloatArray]:
        x = np.clip(start, lower + 1e-9, upper - 1e-9)
        size = np.maximum(np.abs(x), 0.02)
        step = np.full(len(x), DERIVATIVE_SHARE)
        end = least_squares(
            residual, x, bounds=(lower, upper), x_scale=size, diff_step=step, max_nfev=evaluations
        )
        return float(end.cost), np.asarray(end.x)

    starts = _starts(rung, near, scale)
    if len(starts) > 1:
        ends = [search(start, SCOUT_EVALUATIONS) for start in starts]
        starts = [min(ends, key=lambda end: end[0])[1]]
    return FirstOrderWheel(_numbers(rung, search(starts[0], EVALUATIONS)[1]), rung.name)


def _numbers(rung: Rung, x: FloatArray) -> FloatArray:
    numbers = np.zeros(len(NUMBERS))
    for group, value in zip(rung.free, x, strict=True):
        numbers[[NUMBERS.index(name) for name in group]] = value
    return numbers


def _starts(rung: Rung, near: WheelModel | None, scale: float) -> list[FloatArray]:
    """Where to start: the model at hand, and a grid over the numbers that it lacks."""
    known = near.numbers if isinstance(near, FirstOrderWheel) else np.zeros(len(NUMBERS))
    values = [float(np.mean([known[NUMBERS.index(name)] for name in group])) for group in rung.free]
    if isinstance(near, FirstOrderWheel) and near.structure == rung.name:
        return [np.array(values)]
    grid: list[tuple[float, ...]] = []
    for group, value in zip(rung.free, values, strict=True):
        kind = group[0].partition("_")[0]
        missing = value == 0.0
        grid.append((scale,) if missing and kind == "gain" else STARTS[kind] if missing else (value,))
    # The rung below, its missing numbers at zero, is always among the starts.
    plain = [np.array(values)] if near is not None else []
    return plain + [np.array(point) for point in itertools.product(*grid)]


def _gain_scale(runs: Sequence[WheelRun]) -> float:
    """Top speed over top effort, m/s; 0 where the wheel is never driven or never moves."""
    speed = np.concatenate([np.abs(run.speed_mps) for run in runs])
    effort = np.concatenate([np.abs(run.effort) for run in runs])
    top = float(np.percentile(effort, 98.0))
    return float(np.percentile(speed, 98.0)) / top if top > 0.0 else 0.0


def ladder() -> tuple[Peer, ...]:
    """The rungs as peers, each starting from the one before."""
    names = ("", *(rung.name for rung in RUNGS))
    return tuple(
        Peer(rung.name, rung.title, partial(fit_rung, rung), starts_from=below)
        for rung, below in zip(RUNGS, names, strict=False)
    )
