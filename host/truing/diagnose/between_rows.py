"""What the effort did between two rows: a log holds its mean over each interval, the wheel felt its course.

Where the effort stands still and steps, `truing.model.excitation` finds the step. Where it changes from
row to row, the mean leaves two courses open: held over the row (a command renewed with each row) or running
on smoothly (a sweep, a ramp, a controller's output). The recordings say which: the one whose simulation
comes closer to the measured speeds of that run. Smooth courses are parabolas that keep every row's mean
and meet at its ends (Colella and Woodward 1984, eq. 1.9, without their limiter).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from itertools import pairwise

import numpy as np

from truing.diagnose.data import BoolArray, SetData, held_pieces
from truing.diagnose.simulation.simulator import SetSimulator
from truing.model.excitation import Pieces
from truing.model.kernel import FloatArray

# A smooth row is simulated in this many parts.
PARTS = 4
# Effort that changes by less from row to row stands still.
STILL = 2e-3
# A run's course is taken for smooth when that leaves this share of its squared error, at most.
BETTER = 0.9


def with_courses(data: SetData) -> SetData:
    """The set with every run's effort held or smooth between rows, as its speeds say.

    The baseline's own numbers judge: they are the same for both courses.
    """
    smooth = smoothed(data, range(data.runs))
    if _same(smooth, data):
        return data
    better = _errors(smooth) < BETTER * _errors(data)
    return smoothed(data, np.flatnonzero(better).tolist())


def doubt_of_courses(data: SetData) -> FloatArray:
    """How far apart the two courses take the speeds, shape (n, 2), m/s: neither is known better than that.

    A sweep faster than the log can follow leaves both courses wrong.
    """
    held = set_held(data)
    smooth = smoothed(held, range(data.runs))
    if _same(smooth, held):
        return np.zeros_like(data.speed_mps)
    return np.abs(_speeds(smooth) - _speeds(held))


def set_held(data: SetData) -> SetData:
    """The set with every row's effort held over the row, edges inside still rows aside."""
    return replace(data, pieces=held_pieces(data.t_s, data.effort, data.starts, data.interval_s))


def _same(one: SetData, other: SetData) -> bool:
    return all(len(a.end_s) == len(b.end_s) for a, b in zip(one.pieces, other.pieces, strict=True))


def _speeds(data: SetData) -> FloatArray:
    simulator = SetSimulator(data, data.baseline)
    return simulator.speeds(simulator.start(), simulator.enabled(()))


def _errors(data: SetData) -> FloatArray:
    """Sum of squared row-to-row changes of the error of each run, shape (runs,).

    Changes, because the course inside a row moves the speed from one row to the next, and errors of the
    baseline's numbers, which are slower, would drown it.
    """
    error = np.where(data.counted, data.speed_mps - _speeds(data), 0.0)
    change = np.diff(error, axis=0, prepend=error[:1])
    change[data.first] = 0.0
    sums: FloatArray = np.zeros(data.runs)
    np.add.at(sums, data.run_of_row, (change**2).sum(axis=1))
    return sums


def smoothed(data: SetData, runs: Collection[int]) -> SetData:
    """The set with the effort of these runs running on smoothly wherever it changes from row to row."""
    chosen = np.isin(data.run_of_segment, list(runs))
    left, right = (_smooth_pieces(pieces, chosen) for pieces in data.pieces)
    return replace(data, pieces=(left, right))


def _smooth_pieces(pieces: Pieces, chosen: BoolArray) -> Pieces:
    ends: list[FloatArray] = []
    efforts: list[FloatArray] = []
    supplies: list[FloatArray] = []
    starts = [0]
    for segment, (a, b) in enumerate(pairwise(pieces.starts)):
        end, effort, supply = pieces.end_s[a:b], pieces.effort[a:b], pieces.supply[a:b]
        if chosen[segment] and b - a >= 5:
            end, effort, supply = _split(end, effort, supply)
        ends.append(end)
        efforts.append(effort)
        supplies.append(supply)
        starts.append(starts[-1] + len(end))
    return Pieces(
        np.concatenate(ends),
        np.concatenate(efforts),
        np.concatenate(supplies),
        np.array(starts, dtype=np.int64),
    )


def _split(
    end: FloatArray, effort: FloatArray, supply: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """One segment's pieces with its smooth rows in `PARTS` parts."""
    varying = np.flatnonzero(_varying(end, effort))
    if not len(varying):
        return end, effort, supply
    before, here, after = effort[varying - 1], effort[varying], effort[varying + 1]
    low = (7.0 * (before + here) - effort[varying - 2] - after) / 12.0
    high = (7.0 * (here + after) - before - effort[varying + 2]) / 12.0
    # Means of the parabola with ends low, high and mean `here` over the parts of the row.
    cuts = np.arange(PARTS + 1) / PARTS
    bend = 6.0 * here - 3.0 * (low + high)
    x = cuts[None, :]
    integral = (
        low[:, None] * x
        + (high - low)[:, None] * x**2 / 2.0
        + bend[:, None] * (x**2 / 2.0 - x**3 / 3.0)
    )
    levels = np.clip(np.diff(integral, axis=1) * PARTS, -1.0, 1.0)
    width = end[varying] - end[varying - 1]
    new_ends = end[varying, None] - width[:, None] * (1.0 - cuts[None, 1:])
    count = np.ones(len(end), dtype=np.int64)
    count[varying] = PARTS
    out_end, out_effort, out_supply = (np.repeat(values, count) for values in (end, effort, supply))
    place = (np.cumsum(count) - count)[varying][:, None] + np.arange(PARTS)[None, :]
    out_end[place], out_effort[place] = new_ends, levels
    return out_end, out_effort, out_supply


def _varying(end: FloatArray, effort: FloatArray) -> BoolArray:
    """Whole rows whose effort differs from both neighbours', two whole rows on either side."""
    width = np.diff(end, prepend=2.0 * end[0] - end[1])
    usual = np.abs(width / np.median(width) - 1.0) < 0.2
    moves = np.abs(np.diff(effort, prepend=effort[0])) > STILL
    out = np.zeros(len(end), dtype=bool)
    inner = slice(2, len(end) - 2)
    out[inner] = moves[2:-2] & moves[3:-1]
    for shift in range(5):
        out[inner] &= usual[shift : len(end) - 4 + shift]
    return out


