"""The runs of a set laid end to end, cut where a gap is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.errors import IdentifyError
from truing.recording.run import Run

# Rows of the shortest segment: fewer hold an initial state and no information about a model.
MINIMUM_SEGMENT_ROWS = 4


@dataclass(frozen=True, slots=True)
class JoinedRuns:
    """Runs and the rows of theirs that a set of n rows is made of.

    Attributes
    ----------
    rows : rows of each run that stand.
    starts : shape (segments + 1,), first row of every segment, and n.
    run_of_segment : shape (segments,).
    """

    runs: Sequence[Run]
    rows: Sequence[IntArray]
    starts: IntArray
    run_of_segment: IntArray

    @property
    def run_of_row(self) -> IntArray:
        """Run of every row, shape (n,)."""
        return np.repeat(np.arange(len(self.runs)), [len(rows) for rows in self.rows]).astype(np.int64)

    @property
    def source_row(self) -> IntArray:
        """Row of the run's file, shape (n,)."""
        return np.concatenate(self.rows).astype(np.int64)

    @property
    def interval_s(self) -> FloatArray:
        """Usual time between rows, shape (segments,), s."""
        return np.array([self.runs[k].interval_s for k in self.run_of_segment])

    def join(self, columns: Sequence[FloatArray]) -> FloatArray:
        """Arrays of whole runs as one of this set's rows."""
        joined = np.concatenate([column[keep] for column, keep in zip(columns, self.rows, strict=True)])
        return np.ascontiguousarray(joined, dtype=np.float64)

    def column(self, name: str) -> FloatArray | None:
        """A column that every run has, shape (n,), or None."""
        if not all(name in run.columns for run in self.runs):
            return None
        return self.join([run.columns[name] for run in self.runs])

    def pair(self, names: tuple[str, str]) -> FloatArray | None:
        """Two such columns side by side, shape (n, 2), or None."""
        left, right = (self.column(name) for name in names)
        if left is None or right is None:
            return None
        return np.ascontiguousarray(np.stack([left, right], axis=1))

    def pose(self, names: tuple[str, str, str]) -> FloatArray:
        """A pose of every row, shape (n, 3); NaN in runs that lack it; the heading made continuous."""
        poses = []
        for run in self.runs:
            pose = np.full((len(run), 3), np.nan)
            for k, name in enumerate(names):
                if name in run.columns:
                    pose[:, k] = run.columns[name]
            known = np.isfinite(pose[:, 2])
            pose[known, 2] = np.unwrap(pose[known, 2])
            poses.append(pose)
        return self.join(poses)

    def intervals(self, t_s: FloatArray) -> FloatArray:
        """Interval that ends at the row, shape (n,), s; the usual one at a segment's first row."""
        dt_s = np.empty_like(t_s)
        dt_s[1:] = np.diff(t_s)
        dt_s[self.starts[:-1]] = self.interval_s
        return dt_s

    def rates(self, values: FloatArray, dt_s: FloatArray) -> FloatArray:
        """Values (n, 2) differenced; a segment's first row repeats the second."""
        rates = np.zeros_like(values)
        rates[1:] = np.diff(values, axis=0) / dt_s[1:, None]
        first = self.starts[:-1]
        rates[first] = rates[first + 1]
        return rates


def join_runs(runs: Sequence[Run]) -> JoinedRuns:
    """Cut runs at their gaps and lay them end to end; IdentifyError where nothing is left."""
    cuts = [_cut(run) for run in runs]
    if not any(cuts):
        raise IdentifyError("the runs hold nothing but gaps")
    rows = [np.concatenate(pieces) if pieces else np.zeros(0, np.int64) for pieces in cuts]
    lengths = [len(piece) for pieces in cuts for piece in pieces]
    starts = np.concatenate(([0], np.cumsum(lengths))).astype(np.int64)
    of_segment = np.repeat(np.arange(len(runs)), [len(pieces) for pieces in cuts]).astype(np.int64)
    return JoinedRuns(runs, rows, starts, of_segment)


def _cut(run: Run) -> list[IntArray]:
    """The rows of a run's segments: gaps cut, repeated time stamps merged, scraps left out."""
    keep = np.append(np.diff(run.t_s) > 0.0, True)
    after_gap = np.zeros(len(run), dtype=bool)
    after_gap[run.gaps()] = True
    rows = np.flatnonzero(keep).astype(np.int64)
    # A gap before a repeated stamp belongs to the row of that stamp that stands.
    gap_of_row = np.add.reduceat(after_gap, np.concatenate(([0], rows[:-1] + 1))) > 0
    bounds = [0, *np.flatnonzero(gap_of_row).tolist(), len(rows)]
    return [rows[a:b] for a, b in pairwise(bounds) if b - a >= MINIMUM_SEGMENT_ROWS]
