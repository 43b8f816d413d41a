"""Finds the constant levels of a run's input: when each began, how high, for how long."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from truing.arrays import FloatArray
from truing.recording.run import Run, Wheel

InputKind: TypeAlias = Literal["effort", "velocity"]

# Shorter levels tell nothing about a steady speed.
SHORTEST_LEVEL_S = 0.25
# A plan's neighbouring levels differ by more than this (fraction of supply).
FINE_JUMP = 0.01
# Foreign recorders log the voltage at the motor, which wanders with the supply: only a jump of
# this share of the largest input counts as a step there.
COARSE_JUMP = 0.25
# Within a level the input may wander by this much (5th to 95th percentile): a plan's, by the
# resolution of a log (fraction of supply); a foreign recorder's, by this share of the level.
FINE_SPREAD = 0.005
COARSE_SPREAD = 0.25
# Levels must cover this share of a run for its input to count as piecewise constant.
MIN_COVER = 0.8
# The input of a level is its mean over the last 40 %, where the steady speed is taken as well.
STEADY_SHARE = 0.4


@dataclass(frozen=True, slots=True)
class Level:
    """A stretch of constant input to one wheel.

    Attributes
    ----------
    start_s, end_s : when the input took this value and when it left it; `start_s` is resolved
        inside the sampling interval where the mean effort of that interval allows it.
    value : effort fraction, or m/s in velocity mode.
    previous : the input before, in the same unit; `value` itself where the run begins.
    """

    kind: InputKind
    start_s: float
    end_s: float
    value: float
    previous: float

    @property
    def duration_s(self) -> float:
        """How long the input kept this value, s."""
        return self.end_s - self.start_s


@dataclass(frozen=True, slots=True)
class Levels:
    """The levels of one wheel in a run; empty, with the reason, when the input is no staircase."""

    levels: tuple[Level, ...]
    reason: str | None = None


def find_levels(run: Run, wheel: Wheel) -> Levels:
    """The constant levels of a wheel's input, from the command where there is one, else the effort."""
    command = run.command(wheel)
    if command is not None and run.mode is not None:
        return _from_command(run, wheel, command, run.mode)
    return _from_effort(run, wheel)


def _from_command(run: Run, wheel: Wheel, command: FloatArray, mode: tuple[str, ...]) -> Levels:
    """Levels of a logged command: exact values, one edge wherever command or mode changes."""
    value = np.where(np.array(mode) == "idle", 0.0, command)
    # A rest is zero input in whatever mode surrounds it; only what moves has a kind.
    kinds = {name for name, driven in zip(mode, value != 0.0, strict=True) if driven}
    if len(kinds) > 1:
        return Levels((), "the run mixes effort and velocity commands")
    kind: InputKind = "velocity" if "velocity" in kinds else "effort"
    edges = np.flatnonzero(np.abs(np.diff(value)) > 1e-9) + 1
    levels = _levels_between(run, wheel, kind, value, edges, 0.0)
    cover = sum(level.duration_s for level in levels)
    if cover < MIN_COVER * run.duration_s:
        return Levels((), "the command keeps changing (a ramp or a free drive)")
    return _checked(levels)


def _from_effort(run: Run, wheel: Wheel) -> Levels:
    """Levels of a logged effort: first as exact as a plan makes them, then as a supply lets them be."""
    effort = run.effort(wheel)
    largest = float(np.percentile(np.abs(effort), 98))
    if largest < FINE_JUMP:
        return Levels((), "the wheel is never driven")
    edges = _edges(effort, FINE_JUMP)
    fine = _levels_between(run, wheel, "effort", effort, edges, 0.0)
    # A plan's steps leave no stretch over; a wandering supply leaves many short ones.
    if len(fine) == edges.size + 1:
        return _checked(fine)
    edges = _edges(effort, COARSE_JUMP * largest)
    coarse = _levels_between(run, wheel, "effort", effort, edges, COARSE_SPREAD)
    if sum(level.duration_s for level in coarse) >= MIN_COVER * run.duration_s:
        return _checked(coarse)
    return Levels((), "the effort keeps changing (a ramp or a free drive)")


def _checked(levels: list[Level]) -> Levels:
    if all(level.value == level.previous for level in levels):
        return Levels((), "the input never steps")
    return Levels(tuple(levels))


def _edges(effort: FloatArray, jump: float) -> NDArray[np.intp]:
    """Rows at which the effort has left its old value by more than `jump` within two rows.

    A row whose interval holds the step shows a value in between; it belongs to neither level,
    and the edge is the row after it.
    """
    step = np.abs(np.diff(effort))
    edges = np.flatnonzero(step > jump) + 1
    # Runs of neighbouring edges are one step in several rows: keep the last of each.
    if edges.size:
        keep = np.append(np.diff(edges) > 1, True)
        edges = edges[keep]
    return edges


def _levels_between(
    run: Run, wheel: Wheel, kind: InputKind, value: FloatArray, edges: NDArray[np.intp], wander: float
) -> list[Level]:
    """Cut at the edges; keep the stretches that are long enough and constant.

    Parameters
    ----------
    wander : how far the input may wander inside a level, as a share of it.
    """
    bounds = [0, *edges.tolist(), len(run)]
    middles = [_middle(value[first:stop], kind, wander) for first, stop in pairwise(bounds)]
    starts = [float(run.t_s[0])]
    for first, before, after in zip(bounds[1:-1], middles[:-1], middles[1:], strict=True):
        starts.append(_step_time(run, wheel, kind, first, after, before))
    starts.append(float(run.t_s[-1]))

    levels: list[Level] = []
    for number, middle in enumerate(middles):
        inside = value[bounds[number] : bounds[number + 1]]
        spread = float(np.subtract(*np.percentile(inside, [95, 5])))
        constant = spread <= FINE_SPREAD + wander * abs(middle)
        start, end = starts[number], starts[number + 1]
        if constant and end - start >= SHORTEST_LEVEL_S:
            levels.append(Level(kind, start, end, middle, middles[number - 1] if number else middle))
    return levels


def _middle(values: FloatArray, kind: InputKind, wander: float) -> float:
    """The input of a stretch; its last row may already hold a part of the next step."""
    if wander == 0.0:
        middle = float(np.median(values))
    else:
        inside = values[:-1] if len(values) > 1 else values
        middle = float(np.mean(inside[-max(int(STEADY_SHARE * len(inside)), 1) :]))
    return 0.0 if kind == "effort" and abs(middle) < FINE_JUMP else middle


def _step_time(run: Run, wheel: Wheel, kind: InputKind, first: int, after: float, before: float) -> float:
    """When the input stepped, resolved inside the sampling interval.

    The effort is the mean over its interval, so a step inside the interval leaves a value in
    between that says when it came. In effort mode the two values around it are the levels; in
    velocity mode they are the efforts of the neighbouring rows. Where nothing tells, the step
    lies at the start of the first interval that shows the new value.
    """
    t_s, effort = run.t_s, run.effort(wheel)
    if kind == "velocity":
        stop = min(first + 1, len(run) - 1)
        before, after = float(effort[first - 1]), float(effort[stop])
        if abs(after - before) < 2.0 * FINE_JUMP:
            return float(t_s[first - 1])
        rows = [first]
    else:
        # From a command the step is in the edge row; from the effort alone in the row before it.
        rows = [row for row in (first - 1, first) if row >= 1]
    if after == before:
        return float(t_s[first - 1])
    for row in rows:
        old_share = (after - float(effort[row])) / (after - before)
        if 0.02 < old_share < 0.98:
            return float(t_s[row - 1] + old_share * (t_s[row] - t_s[row - 1]))
    return float(t_s[first] if abs(effort[first] - after) > abs(effort[first] - before) else t_s[first - 1])
