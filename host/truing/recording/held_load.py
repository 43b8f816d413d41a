"""A load that an axis holds: the constant effort of a lift against gravity, found from motion both ways.

A motor that lifts and lowers a load pushes the same way in both: its effort is

    u = load + friction sign v + damping v + inertia dv/dt,

and what moves the axis is the part beyond the load. The four numbers are a regression over the rows in motion
(`inverse_dynamics.py`), and their intervals come from leaving out each stroke in turn (jackknife).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.recording.inverse_dynamics import MIN_ROWS, regression, wheel_motion
from truing.recording.run import RecordingSet, Run

# Median efforts below this, of full effort, hold nothing.
MIN_EFFORT = 0.02
# Standard deviations to the end of a 95 % interval; strokes that an interval needs.
QUANTILE, MIN_STROKES = 1.96, 3


@dataclass(frozen=True, slots=True)
class HeldLoad:
    """What an axis' efforts hold, as shares of full effort.

    Attributes
    ----------
    effort : the constant effort that balances the load, in the recording's own sign.
    friction : what motion takes beyond that, each way; positive.
    half_widths : of the 95 % intervals of both; NaN where there are too few strokes.
    is_turned : positive efforts beyond the load drive the axis to negative speeds.
    """

    effort: float
    friction: float
    half_widths: tuple[float, float]
    is_turned: bool

    def text(self) -> str:
        """The load in words."""
        turned = "; beyond it the axis moves against the effort's sign" if self.is_turned else ""
        return (
            f"holds a load: {self._value(self.effort, 0)} of full effort keeps it still, and motion takes "
            f"{self._value(self.friction, 1)} more each way (friction){turned}"
        )

    def _value(self, value: float, which: int) -> str:
        half = self.half_widths[which]
        interval = f" ({value - half:.3f} to {value + half:.3f})" if np.isfinite(half) else ""
        return f"{value:.3f}{interval}"

    def taken_out_of(self, run: Run) -> Run:
        """The run whose efforts are those beyond the load, with the sign of the motion that they cause."""
        columns = dict(run.columns)
        for name in ("effort_left", "effort_right"):
            columns[name] = (self.effort - columns[name]) if self.is_turned else columns[name] - self.effort
        return replace(run, columns=columns)


def held_load(recordings: RecordingSet) -> HeldLoad | None:
    """The load that an axis' efforts hold, where they keep one sign whichever way it moves; else None."""
    if recordings.held_load is not None:
        return recordings.held_load
    motion = None if recordings.axis is None else wheel_motion(recordings, "left")
    if motion is None:
        return None
    effort, speed, moving, terms = motion.effort, motion.speed, motion.moving, motion.terms
    ways = [moving & (speed * way > 0.0) for way in (1.0, -1.0)]
    if min(int(rows.sum()) for rows in ways) < MIN_ROWS:
        return None
    usual = [float(np.median(effort[rows])) for rows in ways]
    if usual[0] * usual[1] <= 0.0 or min(map(abs, usual)) < MIN_EFFORT:
        return None
    stroke = _strokes(moving, speed)
    found = regression(terms[moving], effort[moving])
    if abs(found[1]) >= abs(found[0]):
        return None
    halves = _jackknife(terms[moving], effort[moving], stroke[moving])
    return HeldLoad(float(found[0]), abs(float(found[1])), halves, bool(found[1] < 0.0))


def without_held_load(recordings: RecordingSet) -> RecordingSet:
    """Recordings whose efforts are those beyond the load that they hold, if they hold one."""
    load = held_load(recordings)
    if load is None or recordings.held_load is not None:
        return recordings
    return replace(recordings, runs=tuple(map(load.taken_out_of, recordings.runs)), held_load=load)


def _strokes(moving: BoolArray, speed: FloatArray) -> IntArray:
    """The number of the stroke that each row belongs to, shape (n,): motion one way without a stop."""
    state = np.where(moving, np.sign(speed), 0.0)
    return np.asarray(np.cumsum(np.diff(state, prepend=0.0) != 0.0))


def _jackknife(terms: FloatArray, effort: FloatArray, stroke: IntArray) -> tuple[float, float]:
    """Half widths of load and friction: how they change as each stroke is left out (Efron 1982)."""
    numbers = np.unique(stroke)
    if len(numbers) < MIN_STROKES:
        return (float("nan"), float("nan"))
    parts = np.array([regression(terms[stroke != one], effort[stroke != one])[:2] for one in numbers])
    count = len(numbers)
    spread = np.sqrt((count - 1) / count * np.sum((parts - parts.mean(axis=0)) ** 2, axis=0))
    return (float(QUANTILE * spread[0]), float(QUANTILE * spread[1]))
