"""What the effort did between two rows: a log holds its mean over each interval, the wheel felt its course.

Where the effort stands still and steps, `truing.model.excitation` finds the step. Where it changes from
row to row, the mean leaves three courses open: held over the row (a command renewed with each row), running
on smoothly (a sweep, a ramp), or jumping from the row before to the row after (a controller whose set point
steps). The recordings say which: the one whose simulation comes closest to the measured speeds of that run.
Smooth courses are parabolas that keep every row's mean and meet at its ends (Colella and Woodward 1984,
eq. 1.9, without their limiter). How far the courses part is how well the speeds there can be foretold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from truing.diagnose.data import BoolArray, SetData, held_pieces
from truing.diagnose.simulation.simulator import SetSimulator
from truing.model.excitation import STILL_ROWS, Pieces
from truing.model.kernel import FloatArray, IntArray

# Segments of fewer pieces have no course.
SHORTEST = 5
# A smooth row is simulated in this many parts.
PARTS = 4
# Effort that changes by less from row to row stands still.
STILL = 2e-3
# Effort that changes by more than this over two rows may have jumped in the row between.
LEAST_JUMP = 0.03
# An edge between levels that last fewer rows than this is no more than a guess.
LASTING = 4
# Where it does not stand still for two rows after such a change, a kick fell somewhere inside the row.
LEAST_KICK = 0.01
# A run's course is taken for smooth when that leaves this share of its squared error, at most.
BETTER = 0.9


def with_courses(data: SetData) -> SetData:
    """The set with every run's effort held, smooth or jumping between rows, as its speeds say.

    The baseline's own numbers judge: they are the same for all courses.
    """
    chosen = data
    least = BETTER * _errors(data)
    for split in (smooth, _jumping):
        other = recut(data, split)
        if _same(other, data):
            continue
        errors = _errors(other)
        chosen = _joined(chosen, other, np.flatnonzero(errors < least))
        least = np.minimum(least, errors)
    return chosen


def doubt_of_courses(data: SetData) -> FloatArray:
    """How far apart the courses take the speeds, shape (n, 2), m/s: none is known better than that.

    A sweep faster than the log can follow leaves all courses wrong; so does a controller that kicks at a
    moment inside a row that nobody knows.
    """
    rows = data.t_s, data.effort, data.starts, data.interval_s
    guessed, held = (replace(data, pieces=held_pieces(*rows, lasting)) for lasting in (STILL_ROWS, LASTING))
    others = [recut(held, split) for split in (smooth, _jumping, _late)]
    courses = [_speeds(held), *(_speeds(other) for other in (guessed, *others) if not _same(other, held))]
    return np.asarray(np.ptp(np.stack(courses), axis=0))


def _joined(one: SetData, other: SetData, runs: IntArray) -> SetData:
    """`one` with these runs' pieces from `other`."""
    taken = np.isin(one.run_of_segment, runs)
    left, right = (_chosen_pieces(a, b, taken) for a, b in zip(one.pieces, other.pieces, strict=True))
    return replace(one, pieces=(left, right))


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


Cut = tuple[FloatArray, FloatArray, FloatArray]
Split = Callable[[FloatArray, FloatArray, FloatArray], Cut]


def recut(data: SetData, split: Split) -> SetData:
    """The set with its pieces cut anew, in segments that are long enough to have a course."""
    left, right = (
        _segmentwise(pieces, lambda _k, cut: split(*cut) if len(cut[0]) >= SHORTEST else cut)
        for pieces in data.pieces
    )
    return replace(data, pieces=(left, right))


def _chosen_pieces(one: Pieces, other: Pieces, taken: BoolArray) -> Pieces:
    return _segmentwise(one, lambda k, cut: _cut_of(other, k) if taken[k] else cut)


def _cut_of(pieces: Pieces, segment: int) -> Cut:
    a, b = pieces.starts[segment], pieces.starts[segment + 1]
    return pieces.end_s[a:b], pieces.effort[a:b], pieces.supply[a:b]


def _segmentwise(pieces: Pieces, change: Callable[[int, Cut], Cut]) -> Pieces:
    cuts = [change(k, _cut_of(pieces, k)) for k in range(len(pieces.starts) - 1)]
    lengths = [len(end) for end, _, _ in cuts]
    return Pieces(
        np.concatenate([end for end, _, _ in cuts]),
        np.concatenate([effort for _, effort, _ in cuts]),
        np.concatenate([supply for _, _, supply in cuts]),
        np.concatenate(([0], np.cumsum(lengths))).astype(np.int64),
    )


def _widths(end: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Lengths of one segment's pieces, s, and which of them are as long as most."""
    width = np.diff(end, prepend=2.0 * end[0] - end[1])
    return width, np.abs(width / np.median(width) - 1.0) < 0.2


def _jumping(end: FloatArray, effort: FloatArray, supply: FloatArray) -> Cut:
    """One segment's pieces with a jump wherever a row's mean lies between its neighbours'."""
    width, usual = _widths(end)
    before, after = effort[:-2], effort[2:]
    between = (effort[1:-1] - before) * (effort[1:-1] - after) < 0.0
    rows = 1 + np.flatnonzero(between & (np.abs(after - before) > LEAST_JUMP) & usual[1:-1])
    before, after = effort[rows - 1], effort[rows + 1]
    cut = end[rows] - width[rows] * (1.0 - (effort[rows] - after) / (before - after))
    level = effort.copy()
    level[rows] = after
    return np.insert(end, rows, cut), np.insert(level, rows, before), np.insert(supply, rows, supply[rows])


def _late(end: FloatArray, effort: FloatArray, supply: FloatArray) -> Cut:
    """One segment's pieces with every kick (a jump, and no standstill after it) late in its row.

    Where it runs on into the next row and ends there, it is early in that one.
    """
    width, usual = _widths(end)
    change = np.abs(np.diff(effort))
    moves_on = np.maximum(change[1:], np.append(change[2:], 0.0)) > LEAST_KICK
    rows = 1 + np.flatnonzero((change[:-1] > LEAST_JUMP) & moves_on & usual[1:-1])
    on = np.setdiff1d(rows + 1, rows)
    on = on[(on < len(effort) - 1) & usual[np.minimum(on, len(effort) - 1)]]
    on = on[np.abs(effort[on + 1] - effort[on]) > LEAST_JUMP]
    level, first = effort.copy(), effort.copy()
    first[rows], level[rows] = effort[rows - 1], 2.0 * effort[rows] - effort[rows - 1]
    first[on], level[on] = 2.0 * effort[on] - effort[on + 1], effort[on + 1]
    cut = np.union1d(rows, on)
    halves = end[cut] - 0.5 * width[cut]
    level, first = np.clip(level, -1.0, 1.0), np.clip(first, -1.0, 1.0)
    return np.insert(end, cut, halves), np.insert(level, cut, first[cut]), np.insert(supply, cut, supply[cut])


def smooth(end: FloatArray, effort: FloatArray, supply: FloatArray) -> Cut:
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
        low[:, None] * x + (high - low)[:, None] * x**2 / 2.0 + bend[:, None] * (x**2 / 2.0 - x**3 / 3.0)
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
    _, usual = _widths(end)
    moves = np.abs(np.diff(effort, prepend=effort[0])) > STILL
    out = np.zeros(len(end), dtype=bool)
    inner = slice(2, len(end) - 2)
    out[inner] = moves[2:-2] & moves[3:-1]
    for shift in range(5):
        out[inner] &= usual[shift : len(end) - 4 + shift]
    return out
