"""A learned term in words: what it does, and which known shapes its values resemble."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.learned.result import Resemblance
from truing.model.correction import PERIODIC, Place, Term

# Share of the values' weighted variation that a known shape must explain to be listed, and how many are.
MIN_ALIKE, MAX_ALIKE = 0.7, 3
# Values above this share of the largest belong to the stretch in which a term acts.
ACTS_ABOVE = 0.4
# A stretch that takes more than this share of the grid is no appearance.
MAX_STRETCH = 0.85

_SUBJECTS: dict[Place, str] = {
    "force": "A force along the forward direction",
    "friction": "A force against the motion",
    "gain": "A change of the gain",
    "inertia": "A change of the inertia",
    "signal": "An error of the recorded speed",
}
_VARIABLES = {
    "speed": "the wheel's own speed",
    "speed_difference": "the difference of the wheels' speeds (how fast the robot turns)",
    "net_effort": "the net effort (effort less speed over gain, as the current is)",
    "other_net_effort": "the other wheel's net effort",
    "effort": "the wheel's own effort",
    "other_effort": "the other wheel's effort",
    "load": "the effort of both wheels together",
    "run_time": "the time in the run",
    "set_time": "the time since the first run",
    "travel": "the travel since the start of the run",
    "travel_repeating": "the travel since the start of the run",
    "angle_repeating": "the wheel's angle",
    "place_x": "the place along the first heading",
    "place_y": "the place across the first heading",
    "place_x_repeating": "the place along the first heading",
    "place_y_repeating": "the place across the first heading",
    "ahead": "the distance from the start along the heading",
    "heading": "the heading",
    "recent_effort": "the effort of the last moments less the present one",
    "heat": "the recent load (effort squared, averaged)",
    "ringing": "an oscillation that the effort excites",
    "ringing_rate": "the rate of an oscillation that the effort excites",
    "mean_ringing": "an oscillation that both wheels' efforts excite",
    "mean_ringing_rate": "the rate of an oscillation that both wheels' efforts excite",
}


def variable_text(term: Term) -> str:
    """What a term depends on, its constant included."""
    text = _VARIABLES[term.variable]
    if term.variable in PERIODIC and term.variable != "heading":
        return f"{text}, repeating every {_length(term.constant)}"
    if term.variable in ("recent_effort", "heat"):
        return f"{text}, over {term.constant:.2g} s"
    if "ringing" in term.variable:
        return f"{text} at {term.constant:.2g} Hz"
    return text


def sentence(term: Term) -> str:
    """What a term does, in one sentence."""
    unit = " of full effort" if term.place in ("force", "friction") else ""
    sizes = [f"{name} {100.0 * _swing(values):.2g} %" for name, values in _sides(term)]
    size = f" ({', '.join(sizes)}{unit} from lowest to highest)"
    subject = _SUBJECTS[term.place]
    stretch = _stretch(term)
    if term.variable in PERIODIC and term.variable != "heading":
        where = "of travel" if "angle" in term.variable or "travel" in term.variable else "of floor"
        return f"{subject} that repeats every {_length(term.constant)} {where}{size}."
    if stretch is not None and term.variable in ("run_time", "set_time", "travel", "place_x", "place_y"):
        unit_text = "s" if term.variable.endswith("time") else "m"
        what = {"run_time": "of a run", "set_time": "after the first run's start"}.get(
            term.variable, "of " + _VARIABLES[term.variable]
        )
        return (
            f"{subject} that appears between {stretch[0]:.1f} and {stretch[1]:.1f} {unit_text} {what}{size}."
        )
    alike = resemblances(term)
    how = (
        f" that {_GROWS[alike[0].shape]} {variable_text(term)}"
        if alike and alike[0].shape in _GROWS
        else None
    )
    return f"{subject}{how or ' that depends on ' + variable_text(term)}{size}."


_GROWS = {
    "proportional": "is proportional to",
    "square": "grows with the square of",
    "square root": "grows with the square root of",
    "sign": "has the sign of",
}


def _sides(term: Term) -> list[tuple[str, FloatArray]]:
    return [("left", np.array(term.left)), ("right", np.array(term.right))]


def _swing(values: FloatArray) -> float:
    """From lowest to highest value; of a constant its size."""
    return float(np.ptp(values)) or float(np.abs(values).max())


def _length(metres: float) -> str:
    return f"{1e3 * metres:.0f} mm" if metres < 1.0 else f"{metres:.2f} m"


def _stretch(term: Term) -> tuple[float, float] | None:
    """Where the mean of both wheels' values lies far from its median, if that is one stretch."""
    values = term.values().mean(axis=0)
    grid = np.array(term.grid)
    away = values - np.median(values)
    away = away if abs(away.max()) >= abs(away.min()) else -away
    high = np.flatnonzero(away > ACTS_ABOVE * away.max())
    if not len(high) or away.max() <= 0.0 or (np.diff(high) > 1).any():
        return None
    low, end = max(int(high[0]) - 1, 0), min(int(high[-1]) + 1, len(grid) - 1)
    begin = _crossing(grid, away, low, int(high[0]))
    finish = _crossing(grid, away, end, int(high[-1]))
    return (begin, finish) if finish - begin < MAX_STRETCH * (grid[-1] - grid[0]) else None


def _crossing(grid: FloatArray, values: FloatArray, outside: int, inside: int) -> float:
    """Where the values cross half of their maximum between two neighbours."""
    half = 0.5 * float(values.max())
    a, b = float(values[outside]), float(values[inside])
    if outside == inside or a >= half or b <= half:
        return float(grid[inside])
    return float(grid[outside] + (half - a) / (b - a) * (grid[inside] - grid[outside]))


Shape = Callable[[FloatArray], Any]


def _shapes(term: Term) -> dict[str, tuple[Shape, str]]:
    """Known shapes by name, each with the physics that has it in this place."""
    span = float(np.ptp(term.grid)) or 1.0
    period = term.constant if term.variable in PERIODIC else span
    even = term.place in ("friction", "inertia", "gain", "signal")
    known: dict[str, tuple[Shape, str]] = {
        "constant": (np.ones_like, {"friction": "dry friction"}.get(term.place, "an offset")),
        "proportional": (lambda z: z, _linear_physics(term)),
        "square": (lambda z: z**2 if even else z * np.abs(z), _square_physics(term)),
        "square root": (lambda z: np.sqrt(np.abs(z)) * (1.0 if even else np.sign(z)), ""),
        "size": (np.abs, "viscous friction" if term.place == "friction" else ""),
        "sign": (np.sign, "forward and backward differ" if even else "dry friction or a dead band"),
        "decay": (lambda z: np.exp(-np.abs(z) / (0.08 * span)), "breakaway (Stribeck) friction"),
    }
    if term.variable in PERIODIC:
        for name, factor in (("sinusoid", 1.0), ("two waves", 2.0)):
            known[name] = (_wave(period / factor), "an eccentric or toothed part")
    if term.variable in ("run_time", "set_time", "travel", "heat"):
        known["warming"] = (lambda z: 1.0 - np.exp(-3.0 * (z - term.grid[0]) / span), "warming or discharge")
    return known


def _wave(period: float) -> Shape:
    """A wave of any phase, as a complex shape."""
    return lambda z: np.exp(2j * math.pi * z / period)


def _linear_physics(term: Term) -> str:
    return {
        ("force", "effort"): "another gain",
        ("force", "ahead"): "a spring to where the run began",
        ("force", "recent_effort"): "a delay or a lag ahead of the motor",
        ("force", "speed_difference"): "viscous scrub when turning",
        ("force", "other_net_effort"): "inertia coupling through the chassis",
        ("force", "ringing"): "a resonance",
        ("force", "mean_ringing"): "a resonance of the whole robot",
    }.get((term.place, term.variable), "")


def _square_physics(term: Term) -> str:
    if term.place == "friction" and term.variable == "speed":
        return "drag"
    return "a driver whose output goes with the square" if term.variable == "effort" else ""


def resemblances(term: Term) -> tuple[Resemblance, ...]:
    """Known shapes that explain most of the values, the closest first; each beside a constant."""
    grid = np.array(term.grid)
    found = []
    for name, (shape, physics) in _shapes(term).items():
        share = _share(
            term, shape(grid), name == "constant", _linear(term) if name != "proportional" else None
        )
        if share >= MIN_ALIKE:
            found.append(Resemblance(name, physics, share))
    step = _best_step(term, grid) if term.variable not in PERIODIC else 0.0
    if step >= MIN_ALIKE:
        found.append(Resemblance("step", "something that begins or ends there", step))
    return tuple(sorted(found, key=lambda one: -one.share)[:MAX_ALIKE])


def _linear(term: Term) -> FloatArray | None:
    """The straight line that gain and damping share with a term of effort or speed, or None."""
    if term.variable not in ("effort", "speed", "net_effort"):
        return None
    grid = np.array(term.grid)
    return np.abs(grid) if term.place == "friction" else grid


def _share(term: Term, shape: FloatArray, alone: bool, line: FloatArray | None = None) -> float:
    """Share of the values' weighted energy that a shape explains, beside a constant unless `alone`.

    What a straight line explains by itself counts neither for the shape nor against it.
    """
    if line is not None and not alone:
        return _share_beside(term, shape, line)
    parts = [shape.real] + ([shape.imag] if np.iscomplexobj(shape) else [])
    columns = np.stack(parts if alone else [np.ones(len(shape)), *parts], axis=1).astype(np.float64)
    left, total = 0.0, 0.0
    bands = (term.left_band, term.right_band)
    for (_, values), band in zip(_sides(term), bands, strict=True):
        weight = np.ones(len(values)) if not band else 1.0 / (np.array(band) + 0.1 * np.median(band) + 1e-9)
        mean = 0.0 if alone else float(np.average(values, weights=weight**2))
        found = np.linalg.lstsq(columns * weight[:, None], values * weight, rcond=None)[0]
        left += float(np.sum((weight * (values - columns @ found)) ** 2))
        total += float(np.sum((weight * (values - mean)) ** 2))
    return 1.0 - left / total if total > 0.0 else 0.0


def _share_beside(term: Term, shape: FloatArray, line: FloatArray) -> float:
    """Share of what a constant and a straight line leave that a shape explains."""
    plain = np.stack([np.ones(len(line)), line], axis=1)
    whole = np.hstack((plain, shape.real[:, None]))
    left, total = 0.0, 0.0
    for _, values in _sides(term):
        rest, after = (
            values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0] for columns in (plain, whole)
        )
        left += float(after @ after)
        total += float(rest @ rest)
    return 1.0 - left / total if total > 0.0 else 0.0


def _best_step(term: Term, grid: FloatArray) -> float:
    return max((_share(term, (grid > edge).astype(np.float64), False) for edge in grid[1:-2]), default=0.0)
