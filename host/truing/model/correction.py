"""A learned correction of a robot model: lookups of one variable each, and their free run beside the physics.

The equation stands in `correction_kernel.py`. A correction is what no effect of the catalogue says: it is
read as a shape ("friction that appears between 3 and 6 s"), simulated as it stands, and carried by exports.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, cast, get_args

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.model import correction_kernel as kernel

# Where a term acts. force: effort forward. friction: dry friction, effort against the motion.
# gain: share of the effort that is added. inertia: share of the net effort u - v / g that is added.
# signal: share by which the recorded speed exceeds the wheel's.
Place = Literal["force", "friction", "gain", "inertia", "signal"]
# What a term depends on. The first group is of the simulated state, the second of the rows alone.
StateVariable = Literal["speed", "speed_difference", "net_effort", "other_net_effort"]
RowVariable = Literal[
    "effort", "other_effort", "load", "run_time", "set_time", "travel", "travel_repeating", "angle_repeating",
    "place_x", "place_y", "place_x_repeating", "place_y_repeating", "ahead", "heading",
    "recent_effort", "heat", "ringing", "ringing_rate", "mean_ringing", "mean_ringing_rate",
]  # fmt: skip
Variable = StateVariable | RowVariable
STATE_VARIABLES: tuple[str, ...] = get_args(StateVariable)
PERIODIC = ("travel_repeating", "angle_repeating", "place_x_repeating", "place_y_repeating", "heading")
UNITS: dict[str, str] = {
    "speed": "m/s", "speed_difference": "m/s", "net_effort": "effort", "other_net_effort": "effort",
    "effort": "effort", "other_effort": "effort", "load": "effort", "run_time": "s", "set_time": "s",
    "travel": "m", "travel_repeating": "m", "angle_repeating": "m", "heading": "rad",
    "place_x": "m", "place_y": "m", "place_x_repeating": "m", "place_y_repeating": "m", "ahead": "m",
    "recent_effort": "effort", "heat": "1", "ringing": "effort", "ringing_rate": "effort",
    "mean_ringing": "effort", "mean_ringing_rate": "effort",
}  # fmt: skip
MAX_FALL = kernel.MAX_FALL
# Points per state lookup in the kernel.
TABLE_POINTS = 65


@dataclass(frozen=True, slots=True)
class Term:
    """One lookup for each wheel.

    Attributes
    ----------
    constant : period (m), or time constant (s), or frequency (Hz) of the variable, where it has one.
    grid : where the values stand, rising; a variable with a jump at zero has zero twice. Piecewise linear
        between, constant beyond; of a repeating variable the last value is the first.
    left, right : the values: effort, or shares.
    left_band, right_band : half widths of the 95 % intervals.
    """

    place: Place
    variable: Variable
    constant: float
    grid: tuple[float, ...]
    left: tuple[float, ...]
    right: tuple[float, ...]
    left_band: tuple[float, ...] = ()
    right_band: tuple[float, ...] = ()

    def values(self) -> FloatArray:
        """Both wheels' values, shape (2, k)."""
        return np.array([self.left, self.right])

    def with_values(self, values: FloatArray, bands: FloatArray | None = None) -> Term:
        """The same term with other values (2, k), and half widths of the same shape."""
        left, right = (tuple(float(x) for x in row) for row in values)
        if bands is None:
            return replace(self, left=left, right=right)
        left_band, right_band = (tuple(float(x) for x in row) for row in bands)
        return replace(self, left=left, right=right, left_band=left_band, right_band=right_band)

    def at(self, z: FloatArray) -> FloatArray:
        """Values of both wheels at their own variable z (n, 2), shape (n, 2)."""
        values = self.values()
        return np.stack([np.interp(z[:, w], self.grid, values[w]) for w in range(2)], axis=1)

    def to_dict(self) -> dict[str, Any]:
        """As a JSON object, or a TOML table."""
        out: dict[str, Any] = {
            "acts_as": self.place, "variable": self.variable, "unit": UNITS[self.variable],
            "constant": self.constant, "grid": list(self.grid),
            "left": list(self.left), "right": list(self.right),
        }  # fmt: skip
        if self.left_band:
            out |= {"left_band": list(self.left_band), "right_band": list(self.right_band)}
        return out

    @classmethod
    def from_dict(cls, table: Mapping[str, Any]) -> Term:
        """Inverse of `to_dict`."""

        def numbers(name: str) -> tuple[float, ...]:
            return tuple(float(x) for x in table.get(name, ()))

        return cls(
            cast(Place, str(table["acts_as"])),
            cast(Variable, str(table["variable"])),
            float(table.get("constant", 0.0)),
            *(numbers(name) for name in ("grid", "left", "right", "left_band", "right_band")),
        )


@dataclass(frozen=True, slots=True)
class Correction:
    """Terms beside a physical model of two wheels.

    Attributes
    ----------
    gain_mps, time_constant_s : of the wheels' linear part, (left, right).
    effort_share, drag : linear parts that are fitted beside the terms: share of the effort that is added, and
        effort per m/s.
    """

    gain_mps: tuple[float, float]
    time_constant_s: tuple[float, float]
    terms: tuple[Term, ...]
    effort_share: tuple[float, float] = (0.0, 0.0)
    drag: tuple[float, float] = (0.0, 0.0)

    def to_dict(self) -> dict[str, Any]:
        """As a JSON object, or a TOML table."""
        return {
            "gain_mps": list(self.gain_mps), "time_constant_s": list(self.time_constant_s),
            "effort_share": list(self.effort_share), "drag": list(self.drag),
            "terms": [term.to_dict() for term in self.terms],
        }  # fmt: skip

    @classmethod
    def from_dict(cls, table: Mapping[str, Any]) -> Correction:
        """Inverse of `to_dict`."""

        def pair(name: str) -> tuple[float, float]:
            left, right = table.get(name, (0.0, 0.0))
            return float(left), float(right)

        return cls(
            pair("gain_mps"),
            pair("time_constant_s"),
            tuple(Term.from_dict(each) for each in table["terms"]),
            pair("effort_share"),
            pair("drag"),
        )


@dataclass(frozen=True, slots=True)
class Rows:
    """What a free run reads: n rows of a set laid end to end.

    Attributes
    ----------
    starts : shape (segments + 1,), first rows of segments, and n.
    dt_s, effort : shape (n,), s; (n, 2).
    instant : rows hold the speed at their time, not the mean over their interval.
    variables : (variable, constant) to its values, shape (n, 2).
    """

    starts: IntArray
    dt_s: FloatArray
    effort: FloatArray
    instant: bool
    variables: Mapping[tuple[str, float], FloatArray] = field(default_factory=dict)


def limited(correction: Correction) -> Correction:
    """The correction within the limits that keep every free run bounded (`correction_kernel`)."""
    gain = np.array(correction.gain_mps)
    effort_share = np.maximum(np.array(correction.effort_share), -MAX_FALL)
    drag = np.minimum(np.array(correction.drag), MAX_FALL / gain)
    left = 1.0 / gain - drag  # damping that the linear part leaves
    terms = []
    for term in correction.terms:
        values = term.values()
        grid = np.array(term.grid)
        if term.place in ("force", "friction") and term.variable in STATE_VARIABLES:
            values = _with_limited_slopes(term, grid, values, left)
        if term.place == "inertia":
            values = np.clip(values, -MAX_FALL, 10.0)
        terms.append(term.with_values(values))
    return replace(
        correction,
        terms=tuple(terms),
        effort_share=(float(effort_share[0]), float(effort_share[1])),
        drag=(float(drag[0]), float(drag[1])),
    )


def _with_limited_slopes(term: Term, grid: FloatArray, values: FloatArray, damping: FloatArray) -> FloatArray:
    """Values whose slopes take away no more than their share of the damping (2,)."""
    out = values.copy()
    for w in range(2):
        if term.variable == "speed":
            half = len(grid) // 2
            # Friction at |v|: both halves are limited from standstill outwards, and do not pull there.
            out[w, half:] = _falling(grid[half:], values[w, half:], MAX_FALL * damping[w])
            reverse = _falling(-grid[:half][::-1], values[w, :half][::-1], MAX_FALL * damping[w])
            out[w, :half] = reverse[::-1]
        elif term.variable == "speed_difference":
            # A force: what falls with the difference damps, what rises drives apart.
            out[w] = -_falling(grid, -values[w], 0.5 * MAX_FALL * damping[w])
        else:
            out[w] = _falling(grid, values[w], MAX_FALL)
            out[w] = out[w] if term.variable == "net_effort" else -_falling(grid, -out[w], MAX_FALL)
    return out


def _falling(grid: FloatArray, values: FloatArray, max_fall: float) -> FloatArray:
    """Values from the grid's start on that fall by at most `max_fall` per unit."""
    steps = np.maximum(np.diff(values), -max_fall * np.diff(grid))
    return np.concatenate((values[:1], values[0] + np.cumsum(steps)))


def corrected_speeds(correction: Correction, rows: Rows, base: FloatArray) -> FloatArray:
    """Speeds (n, 2) of the physical model `base` (n, 2) with the correction, in free run, m/s."""
    force = rows.effort * np.array(correction.effort_share)
    against, inertia, scale = (np.zeros_like(force) for _ in range(3))
    tables = np.zeros((kernel.STATE_TABLES, 2, TABLE_POINTS))
    spans = np.zeros((kernel.STATE_TABLES, 2))
    used = np.zeros(kernel.STATE_TABLES)
    for term in correction.terms:
        if term.place == "signal" and term.variable == "speed":
            continue
        if term.variable in STATE_VARIABLES:
            _put_table(term, tables, spans, used)
            continue
        values = term.at(rows.variables[(term.variable, term.constant)])
        if term.place == "force":
            force += values
        elif term.place == "gain":
            force += values * rows.effort
        elif term.place == "friction":
            against += values
        elif term.place == "inertia":
            inertia += values
        else:
            scale += values
    out = np.zeros_like(base)
    kernel.free_run(
        rows.starts, rows.dt_s, rows.instant, rows.effort, np.ascontiguousarray(base),
        np.array(correction.gain_mps), np.array(correction.time_constant_s),
        force, against, np.clip(inertia, -MAX_FALL, None), scale, np.array(correction.drag),
        tables, spans, used, out,
    )  # fmt: skip
    for term in correction.terms:
        if term.place == "signal" and term.variable == "speed":
            out *= 1.0 + term.at(out)
    return out


def _put_table(term: Term, tables: FloatArray, spans: FloatArray, used: FloatArray) -> None:
    """Resample a lookup of the state onto the kernel's even grid."""
    grid, values = np.array(term.grid), term.values()
    if term.variable == "speed":
        half = len(grid) // 2
        forward, reverse = (
            (kernel.INERTIA_FORWARD, kernel.INERTIA_REVERSE)
            if term.place == "inertia"
            else (kernel.FORWARD, kernel.REVERSE)
        )
        even = np.linspace(0.0, grid[-1], TABLE_POINTS)
        for w in range(2):
            tables[forward, w] = np.interp(even, grid[half:], values[w, half:])
            tables[reverse, w] = np.interp(even, -grid[:half][::-1], values[w, :half][::-1])
        spans[forward] = spans[reverse] = 0.0, grid[-1]
        used[forward] = used[reverse] = 1.0
        return
    at = {"speed_difference": kernel.TURN, "net_effort": kernel.NET, "other_net_effort": kernel.OTHER_NET}[
        term.variable
    ]
    even = np.linspace(grid[0], grid[-1], TABLE_POINTS)
    for w in range(2):
        tables[at, w] = np.interp(even, grid, values[w])
    spans[at] = grid[0], grid[-1]
    used[at] = 1.0
