"""Recordings as the fits see them: one wheel's efforts and speeds in segments without a gap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.errors import IdentifyError
from truing.model.excitation import Excitation, excitation
from truing.recording.run import Geometry, Run, SpeedSource, Wheel

NOMINAL_SUPPLY_V = 12.0
MINIMUM_SEGMENT_ROWS = 4


@dataclass(frozen=True, slots=True)
class WheelSignal:
    """One wheel in one or more runs, laid end to end.

    Attributes
    ----------
    excitation : times, efforts and supply, cut into segments at the ends of runs and at gaps.
    speed_mps : shape (n,), measured.
    run_of_row : shape (n,), index into `names`.
    names : the runs' names.
    source : the columns that the speed comes from.
    resolution_mps : smallest step that the speed can show.
    has_supply : whether every run logs its supply voltage.
    """

    excitation: Excitation
    speed_mps: FloatArray
    run_of_row: IntArray
    names: tuple[str, ...]
    source: SpeedSource
    resolution_mps: float
    has_supply: bool

    def __len__(self) -> int:
        return len(self.speed_mps)

    @property
    def runs(self) -> int:
        """How many runs there are."""
        return len(self.names)

    @property
    def counted(self) -> BoolArray:
        """Rows that judge a model, shape (n,): the first row of a segment is given, not judged."""
        counted = np.ones(len(self), dtype=bool)
        counted[self.excitation.starts[:-1]] = False
        return counted

    def weights(self) -> FloatArray:
        """Square-root weights, shape (n,), that make every run count the same: sum of squares 1."""
        counted = self.counted
        counts = np.bincount(self.run_of_row, counted, self.runs)
        return np.asarray(counted / np.sqrt(counts[self.run_of_row] * self.runs))

    @property
    def scale_mps(self) -> float:
        """The 98th percentile of |speed| over these runs: what per cents refer to."""
        return float(np.percentile(np.abs(self.speed_mps), 98.0))

    def rms_by_run(self, residual: FloatArray) -> FloatArray:
        """Root mean square of `residual` (n,) in each run, shape (runs,)."""
        counted = self.counted
        counts = np.bincount(self.run_of_row, counted, self.runs)
        return np.asarray(np.sqrt(np.bincount(self.run_of_row, counted * residual**2, self.runs) / counts))

    def select(self, keep: Sequence[int]) -> WheelSignal:
        """The runs with these indices, in this order."""
        whole = self.excitation
        rows, starts, intervals, run_of_row = [], [0], [], []
        for new, old in enumerate(keep):
            for k, (a, b) in enumerate(pairwise(whole.starts)):
                if self.run_of_row[a] == old:
                    rows.append(np.arange(a, b))
                    run_of_row.append(np.full(b - a, new))
                    intervals.append(whole.interval_s[k])
                    starts.append(starts[-1] + int(b - a))
        if not rows:
            raise IdentifyError("no run is left to fit")
        index = np.concatenate(rows)
        chosen = excitation(
            whole.t_s[index],
            whole.effort[index],
            whole.supply[index],
            np.array(starts, dtype=np.int64),
            np.array(intervals),
        )
        return WheelSignal(
            replace(chosen, mean_over_interval=whole.mean_over_interval),
            self.speed_mps[index],
            np.concatenate(run_of_row),
            tuple(self.names[k] for k in keep),
            self.source,
            self.resolution_mps,
            self.has_supply,
        )


# Rows closer together are more than a search needs, s; no wheel answers faster.
SEARCH_SPACING_S = 0.008
# So many rows must become one before it is worth it.
MIN_TOGETHER = 3


def thinned(signal: WheelSignal) -> WheelSignal | None:
    """The signal with rows put together to what a search needs; None where there are not too many.

    Efforts, supply and speed of a row are means over its interval, and so are those of several rows; of
    speeds that were read at the rows' times the last one stands. The first row of a segment, which gives its
    initial speed, stays as it is.
    """
    whole = signal.excitation
    count = int(SEARCH_SPACING_S / float(np.median(whole.interval_s)) + 0.01)
    if count < MIN_TOGETHER:
        return None
    keep: list[IntArray] = []
    starts = [0]
    for a, b in pairwise(whole.starts):
        rows = np.append(np.arange(a, b - 1, count), b - 1)
        keep.append(rows)
        starts.append(starts[-1] + len(rows))
    index = np.concatenate(keep)
    # A row's interval begins at the row before it; that of a segment's first row holds nothing.
    step_s = np.diff(whole.t_s, prepend=whole.t_s[0])
    step_s[whole.starts[:-1]] = 0.0
    ends = np.concatenate(([-1], index))
    totals = [np.concatenate(([0.0], np.cumsum(np.where(step_s > 0.0, values * step_s, 0.0)))) for values in (
        np.ones_like(step_s), whole.effort, whole.supply, signal.speed_mps
    )]  # fmt: skip
    length, *sums = (total[ends[1:] + 1] - total[ends[:-1] + 1] for total in totals)
    first = length <= 0.0
    effort, supply, speed = (
        np.where(first, values[index], part / np.where(first, 1.0, length))
        for values, part in zip((whole.effort, whole.supply, signal.speed_mps), sums, strict=True)
    )
    together = excitation(
        whole.t_s[index], effort, supply, np.array(starts, dtype=np.int64), count * whole.interval_s
    )
    return replace(
        signal,
        excitation=replace(together, mean_over_interval=whole.mean_over_interval),
        speed_mps=speed if whole.mean_over_interval else signal.speed_mps[index],
        run_of_row=signal.run_of_row[index],
    )


def shown_resolution(speed_mps: FloatArray, resolution_mps: float = 0.0) -> float:
    """The smallest step that a speed shows, m/s: that of its counts, else that between its values.

    Parameters
    ----------
    speed_mps : shape (n,).
    resolution_mps : of one count per row, where counts are known; 0 where not.
    """
    if resolution_mps > 0.0:
        return resolution_mps
    steps = np.diff(np.unique(speed_mps))
    # Values that differ by rounding errors of the division alone are one value.
    steps = steps[steps > 1e-9 * float(np.max(np.abs(speed_mps), initial=0.0))]
    return float(steps.min()) if steps.size else 0.0


def wheel_signal(runs: Sequence[Run], wheel: Wheel, baseline: Geometry | None = None) -> WheelSignal:
    """Efforts and speeds of one wheel in all runs; gaps start a new segment.

    Rows that share a time stamp are one instant: the last of them stands. Speeds from counts or
    positions are means over the interval; so is a reported speed, as docs/DATA_FORMAT.md has it (whatever
    filter sits on top of it is the fit's to find), unless its runs were found to say otherwise.
    """
    if not runs:
        raise IdentifyError("there is no run to fit")
    pieces: list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]] = []
    run_of_row: list[IntArray] = []
    starts = [0]
    intervals: list[float] = []
    sources: set[SpeedSource] = set()
    resolutions: list[float] = []
    has_supply = all("battery_v" in run.columns for run in runs)
    for index, run in enumerate(runs):
        speed = run.speed(wheel, baseline)
        sources.add(speed.source)
        resolutions.append(speed.resolution)
        supply = run.columns["battery_v"] / NOMINAL_SUPPLY_V - 1.0 if has_supply else np.zeros(len(run))
        keep = np.append(np.diff(run.t_s) > 0.0, True)
        after_gap = np.zeros(len(run), dtype=bool)
        after_gap[run.gaps()] = True
        cuts = np.flatnonzero(after_gap[keep])
        columns = [column[keep] for column in (run.t_s, run.effort(wheel), supply, speed.values)]
        bounds = [0, *cuts.tolist(), int(keep.sum())]
        for a, b in pairwise(bounds):
            if b - a < MINIMUM_SEGMENT_ROWS:
                continue  # too short to hold an initial state and anything else
            pieces.append((columns[0][a:b], columns[1][a:b], columns[2][a:b], columns[3][a:b]))
            run_of_row.append(np.full(b - a, index, dtype=np.int64))
            starts.append(starts[-1] + b - a)
            intervals.append(run.interval_s)
    if len(sources) > 1:
        raise IdentifyError(f"the runs give their speed in different ways ({', '.join(sorted(sources))})")
    if len(np.unique(np.concatenate(run_of_row))) != len(runs) if run_of_row else True:
        raise IdentifyError("a run holds nothing but gaps")
    t, effort, supply_all, speed_all = (
        np.ascontiguousarray(np.concatenate([piece[k] for piece in pieces])) for k in range(4)
    )
    driven = excitation(t, effort, supply_all, np.array(starts, dtype=np.int64), np.array(intervals))
    instant = sources == {"vel"} and all(run.instant for run in runs)
    return WheelSignal(
        replace(driven, mean_over_interval=not instant),
        speed_all,
        np.concatenate(run_of_row),
        tuple(run.name for run in runs),
        sources.pop(),
        float(np.median(resolutions)),
        has_supply,
    )
