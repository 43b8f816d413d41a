"""What drives a simulation: rows of a log, and the pieces of constant effort between them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from truing.arrays import FloatArray, IntArray

# An edge inside an interval is looked for when the levels around it differ by this much effort, and
# stand still to within this share of the difference.
MIN_EDGE = 0.01
STILL_SHARE = 0.05
# An edge is one between levels that stand still for so many rows.
STILL_ROWS = 2
# One that fell nearer to a row's end than this share of the interval fell on it.
MIN_PART = 0.02


@dataclass(frozen=True, slots=True)
class Pieces:
    """Constant inputs, one after the other.

    Attributes
    ----------
    end_s : shape (m,), s, when each ends.
    effort, supply : shape (m,), see `Excitation`.
    starts : shape (segments + 1,), first piece of every segment, and m.
    """

    end_s: FloatArray
    effort: FloatArray
    supply: FloatArray
    starts: IntArray


@dataclass(frozen=True, slots=True)
class Excitation:
    """One or more segments of a log laid end to end, n rows in all.

    Attributes
    ----------
    t_s : shape (n,), s, increasing inside a segment; uneven steps are fine.
    effort : shape (n,), -1..1, mean over the interval that ends at each row.
    supply : shape (n,), relative deviation of the supply voltage from nominal; zeros when unknown.
    starts : shape (segments + 1,), first row of every segment, and n.
    interval_s : shape (segments,), s, the usual time between rows; the first row's effort is the
        mean over that long before it.
    pieces : the effort as the simulation sees it.
    mean_over_interval : the speed is a mean over the interval that ends at the row (counts, our own
        log), not a reading at the row's instant.
    """

    t_s: FloatArray
    effort: FloatArray
    supply: FloatArray
    starts: IntArray
    interval_s: FloatArray
    pieces: Pieces
    mean_over_interval: bool = True

    @property
    def segments(self) -> int:
        """How many segments there are."""
        return len(self.starts) - 1


def excitation(
    t_s: FloatArray,
    effort: FloatArray,
    supply: FloatArray,
    starts: IntArray,
    interval_s: FloatArray,
    lasting: int = STILL_ROWS,
) -> Excitation:
    """An excitation whose pieces are the intervals, cut where an edge fell inside one.

    Parameters
    ----------
    lasting : rows for which the effort stands still on either side of an edge.

    A log holds the mean effort of an interval. Where the effort stands still on both sides of a row
    and the row lies between the two levels, one edge fell inside its interval, and the mean says
    when; spreading it over the interval would bias the time constant.
    """
    ends: list[FloatArray] = []
    efforts: list[FloatArray] = []
    supplies: list[FloatArray] = []
    piece_starts = [0]
    for a, b in pairwise(starts):
        t, u, s = t_s[a:b], effort[a:b], supply[a:b]
        rows = _rows_with_edge(u, lasting)
        before, after = u[rows - 1], u[rows + 1]
        cut = t[rows - 1] + (u[rows] - after) / (before - after) * (t[rows] - t[rows - 1])
        level = u.copy()
        level[rows] = after
        ends.append(np.insert(t, rows, cut))
        efforts.append(np.insert(level, rows, before))
        supplies.append(np.insert(s, rows, s[rows]))
        piece_starts.append(piece_starts[-1] + len(ends[-1]))
    pieces = Pieces(
        np.concatenate(ends),
        np.concatenate(efforts),
        np.concatenate(supplies),
        np.array(piece_starts, dtype=np.int64),
    )
    return Excitation(t_s, effort, supply, starts, interval_s, pieces)


def _rows_with_edge(effort: FloatArray, lasting: int) -> IntArray:
    """Rows of one segment inside whose interval a single edge fell."""
    width = 2 * lasting + 1
    if len(effort) < width:
        return np.zeros(0, dtype=np.int64)
    seen = np.lib.stride_tricks.sliding_window_view(effort, width)
    before, here, after = (seen[:, lasting + k] for k in (-1, 0, 1))
    height = np.abs(after - before)
    away = np.maximum(
        np.abs(seen[:, :lasting] - before[:, None]).max(axis=1),
        np.abs(seen[:, lasting + 1 :] - after[:, None]).max(axis=1),
    )
    still = away <= STILL_SHARE * height
    part = np.divide(here - before, after - before, out=np.zeros_like(height), where=height > MIN_EDGE)
    between = (part > MIN_PART) & (part < 1.0 - MIN_PART)
    return (np.flatnonzero(still & between) + lasting).astype(np.int64)
