"""Inter-sample input reconstruction: the effort between two rows, of which a log holds only the mean.

Where the effort is constant and steps, `truing.model.excitation` finds the step. Where it changes from row
to row, the mean is compatible with three hypotheses: held over the row (a command renewed with each row),
smooth (a sweep, a ramp), or a step from the row before to the row after within the row (a controller whose
set point steps). Per run the one is selected whose simulation is closest to the measured speeds. Smooth
input is a piecewise parabola that keeps every row's mean and is continuous (Colella and Woodward 1984, eq.
1.9, without their limiter). The difference of the simulated speeds is the uncertainty of the prediction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.diagnose.data.set_data import SetData, held_pieces
from truing.diagnose.simulation.simulator import SetSimulator
from truing.model.excitation import STILL_ROWS, Pieces

# Segments of fewer pieces are left as they are.
MIN_PIECES = 5
# A smooth row is simulated in this many parts.
SMOOTH_PARTS = 4
# Effort that changes by less from row to row is constant.
HOLD_TOLERANCE = 2e-3
# Effort that changes by more than this over two rows may have stepped in the row between.
MIN_STEP = 0.03
# The time of a step between levels that last fewer rows than this is uncertain.
MIN_LEVEL_ROWS = 4
# Where it changes by more than this within two rows after a step, an impulse occurred inside the row.
MIN_CHANGE_AFTER = 0.01
# A reconstruction replaces the one before if its squared error is at most this share of it.
MAX_ERROR_RATIO = 0.9


def with_inter_sample_input(data: SetData) -> SetData:
    """The set with the effort of each run held, smooth or stepping between rows, whichever fits its speeds.

    The hypotheses are compared under the baseline's own parameters.
    """
    chosen = data
    best_error = MAX_ERROR_RATIO * _errors(data)
    for split in (smooth, _step_within_row):
        other = recut(data, split)
        if _same(other, data):
            continue
        errors = _errors(other)
        chosen = _joined(chosen, other, np.flatnonzero(errors < best_error))
        best_error = np.minimum(best_error, errors)
    return chosen


def inter_sample_uncertainty(data: SetData) -> FloatArray:
    """Uncertainty of the simulated speeds from the unknown inter-sample input, shape (n, 2), m/s.

    The range over all hypotheses: none holds for a sweep faster than the log rate, or for impulses at an
    unknown time within a row.
    """
    rows = data.t_s, data.effort, data.starts, data.interval_s
    default, held = (
        replace(data, pieces=held_pieces(*rows, min_level_rows))
        for min_level_rows in (STILL_ROWS, MIN_LEVEL_ROWS)
    )
    others = [recut(held, split) for split in (smooth, _step_within_row, _late_impulse)]
    responses = [_speeds(held), *(_speeds(other) for other in (default, *others) if not _same(other, held))]
    return np.asarray(np.ptp(np.stack(responses), axis=0))


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

    Changes, because the inter-sample input affects the speed from one row to the next, while errors of the
    baseline's parameters are slower and larger.
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
    """The set with the pieces of its longer segments divided by `split`."""
    left, right = (
        _segmentwise(pieces, lambda _k, cut: split(*cut) if len(cut[0]) >= MIN_PIECES else cut)
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


def _step_within_row(end: FloatArray, effort: FloatArray, supply: FloatArray) -> Cut:
    """One segment's pieces with a step within every row whose mean lies between its neighbours'."""
    width, usual = _widths(end)
    before, after = effort[:-2], effort[2:]
    between = (effort[1:-1] - before) * (effort[1:-1] - after) < 0.0
    rows = 1 + np.flatnonzero(between & (np.abs(after - before) > MIN_STEP) & usual[1:-1])
    before, after = effort[rows - 1], effort[rows + 1]
    cut = end[rows] - width[rows] * (1.0 - (effort[rows] - after) / (before - after))
    level = effort.copy()
    level[rows] = after
    return np.insert(end, rows, cut), np.insert(level, rows, before), np.insert(supply, rows, supply[rows])


def _late_impulse(end: FloatArray, effort: FloatArray, supply: FloatArray) -> Cut:
    """One segment's pieces with every impulse (a step followed by another change) late in its row.

    Where it extends into the next row and ends there, it is early in that one.
    """
    width, usual = _widths(end)
    change = np.abs(np.diff(effort))
    moves_on = np.maximum(change[1:], np.append(change[2:], 0.0)) > MIN_CHANGE_AFTER
    rows = 1 + np.flatnonzero((change[:-1] > MIN_STEP) & moves_on & usual[1:-1])
    following = np.setdiff1d(rows + 1, rows)
    following = following[(following < len(effort) - 1) & usual[np.minimum(following, len(effort) - 1)]]
    following = following[np.abs(effort[following + 1] - effort[following]) > MIN_STEP]
    level, first = effort.copy(), effort.copy()
    first[rows], level[rows] = effort[rows - 1], 2.0 * effort[rows] - effort[rows - 1]
    first[following], level[following] = (
        2.0 * effort[following] - effort[following + 1],
        effort[following + 1],
    )
    cut = np.union1d(rows, following)
    halves = end[cut] - 0.5 * width[cut]
    level, first = np.clip(level, -1.0, 1.0), np.clip(first, -1.0, 1.0)
    return np.insert(end, cut, halves), np.insert(level, cut, first[cut]), np.insert(supply, cut, supply[cut])


def smooth(end: FloatArray, effort: FloatArray, supply: FloatArray) -> Cut:
    """One segment's pieces with its smoothly varying rows in `SMOOTH_PARTS` parts."""
    varying = np.flatnonzero(_varying(end, effort))
    if not len(varying):
        return end, effort, supply
    before, here, after = effort[varying - 1], effort[varying], effort[varying + 1]
    low = (7.0 * (before + here) - effort[varying - 2] - after) / 12.0
    high = (7.0 * (here + after) - before - effort[varying + 2]) / 12.0
    # Means of the parabola with ends low, high and mean `here` over the parts of the row.
    cuts = np.arange(SMOOTH_PARTS + 1) / SMOOTH_PARTS
    bend = 6.0 * here - 3.0 * (low + high)
    x = cuts[None, :]
    integral = (
        low[:, None] * x + (high - low)[:, None] * x**2 / 2.0 + bend[:, None] * (x**2 / 2.0 - x**3 / 3.0)
    )
    levels = np.clip(np.diff(integral, axis=1) * SMOOTH_PARTS, -1.0, 1.0)
    width = end[varying] - end[varying - 1]
    new_ends = end[varying, None] - width[:, None] * (1.0 - cuts[None, 1:])
    count = np.ones(len(end), dtype=np.int64)
    count[varying] = SMOOTH_PARTS
    out_end, out_effort, out_supply = (np.repeat(values, count) for values in (end, effort, supply))
    place = (np.cumsum(count) - count)[varying][:, None] + np.arange(SMOOTH_PARTS)[None, :]
    out_end[place], out_effort[place] = new_ends, levels
    return out_end, out_effort, out_supply


def _varying(end: FloatArray, effort: FloatArray) -> BoolArray:
    """Whole rows whose effort differs from both neighbours', two whole rows on either side."""
    _, usual = _widths(end)
    moves = np.abs(np.diff(effort, prepend=effort[0])) > HOLD_TOLERANCE
    out = np.zeros(len(end), dtype=bool)
    inner = slice(2, len(end) - 2)
    out[inner] = moves[2:-2] & moves[3:-1]
    for shift in range(5):
        out[inner] &= usual[shift : len(end) - 4 + shift]
    return out
