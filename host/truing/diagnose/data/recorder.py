"""How wheel speeds were recorded, and the same runs at the rate at which they were really measured.

A recorder often logs faster than its sensor is read: on drivetrains of robot teams 76 to 98 % of the rows
repeat the row before. A repeated row is no new measurement. Counted as one it makes every residual look
strongly correlated, an autoregressive noise model finds a pole near one, and slow model errors lose all
their weight. So the usual time between renewals is estimated for each wheel, and the runs are reduced to the
rows at which a speed was renewed; efforts become their means over the longer intervals.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.recording.run import MOTION_PAIRS, RecordingSet, Run, SpeedSource

# A signal is held where at least this share of its rows repeat, at speeds above this share of its 98th
# percentile: there two measurements are never equal.
MIN_HELD_SHARE, FAST_SHARE = 0.2, 0.25
# Rows without a renewal are kept this far apart, s: no drive of a wheel answers faster, and the spacing stays
# even enough that none of it looks like a gap.
MIN_SPACING_S = 0.018
# Renewals closer together than this share of the usual time (one wheel's after the other's) make one row: a
# speed taken for newer than it is looks like a delay that varies.
SAME_RENEWAL = 0.26
# An unchanged value was measured anew after so many times the usual time: sooner, the renewal may be late.
SURELY_RENEWED = 1.5
# Below this size of set a step that all changes are multiples of is not looked for.
MIN_STEPS = 20


@dataclass(frozen=True, slots=True)
class Renewal:
    """How often one wheel's speed is renewed.

    Attributes
    ----------
    every_s : the usual time between renewals, s.
    repeated : share of the rows in fast motion that repeat the row before.
    resolution : the smallest step of the signal, in its column's unit; 0 where none is found.
    """

    every_s: float
    repeated: float
    resolution: float

    @property
    def held(self) -> bool:
        """Whether the recorder logs faster than it measures."""
        return self.repeated >= MIN_HELD_SHARE


def renewals(recordings: RecordingSet) -> tuple[Renewal, Renewal]:
    """How often the signal of each wheel is renewed, left and right."""
    left, right = (_renewal(recordings, wheel) for wheel in (0, 1))
    return left, right


def at_renewals(recordings: RecordingSet) -> RecordingSet:
    """The same runs reduced to the rows at which a speed was renewed; unchanged where every row is one.

    Rows faster than any wheel are merged as well: their speeds are averaged where none of them repeats.
    Encoder counts are exact at any rate and stay as they are.
    """
    if not recordings.runs or any(run.has_pair("ticks") for run in recordings):
        return recordings
    every = [one.every_s for one in renewals(recordings) if one.held]
    runs = tuple(_at_renewals(run, min(every) if every else None) for run in recordings)
    return replace(recordings, runs=runs)


def repeated_rows(recordings: RecordingSet, reduced: RecordingSet) -> tuple[BoolArray, ...]:
    """Rows of each reduced run, (n, 2), at which a wheel's speed cannot have been renewed since the last."""
    each = renewals(recordings)
    masks = []
    for run in reduced:
        source = _source(run)
        repeated = np.zeros((len(run), 2), dtype=bool)
        for wheel, name in enumerate(MOTION_PAIRS[source]):
            if each[wheel].held and source == "vel":
                repeated[:, wheel] = _too_early(run.columns[name], run.t_s, each[wheel].every_s)
        masks.append(repeated)
    return tuple(masks)


def _too_early(values: FloatArray, t_s: FloatArray, every_s: float) -> BoolArray:
    """Rows, shape (n,), whose value did not change and may be the last measurement's."""
    early = ~_changed(values)
    last_s = t_s[0]
    for row in range(len(values)):
        early[row] &= t_s[row] - last_s < SURELY_RENEWED * every_s
        if not early[row]:
            last_s = t_s[row]
    return early


def merged(run: Run, rows: IntArray, *, average_speeds: bool) -> Run:
    """The run at these rows; efforts (and speeds, if asked for) are means over the longer intervals."""
    step = np.diff(run.t_s, prepend=run.t_s[0])
    starts = np.concatenate(([0], rows[:-1] + 1))
    duration = np.add.reduceat(step, starts)
    averaged = {"effort_left", "effort_right", *(MOTION_PAIRS["vel"] if average_speeds else ())}
    columns = {name: values[rows] for name, values in run.columns.items()}
    for name in averaged & columns.keys():
        total = np.add.reduceat(run.columns[name] * step, starts)
        columns[name] = np.divide(total, duration, out=columns[name].copy(), where=duration > 0.0)
    mode = None if run.mode is None else tuple(run.mode[row] for row in rows)
    text = {name: tuple(values[row] for row in rows) for name, values in run.text_columns.items()}
    return replace(run, columns=columns, mode=mode, text_columns=text)


def _at_renewals(run: Run, every_s: float | None) -> Run:
    rows = _rows_to_keep(run, every_s)
    return run if len(rows) == len(run) else merged(run, rows, average_speeds=every_s is None)


def _rows_to_keep(run: Run, every_s: float | None) -> IntArray:
    """Rows at which a speed was renewed, and some between where that takes long; ends and gaps always."""
    t = run.t_s
    always = np.zeros(len(run), dtype=bool)
    always[[0, -1]] = True
    always[run.gaps()] = True
    always[run.gaps() - 1] = True
    renewed = np.zeros(len(run), dtype=bool) if every_s is None else _last_of_renewal(run, every_s)
    rounding = 0.25 * run.interval_s
    keep = [0]
    for row in range(1, len(run)):
        since = t[row] - t[keep[-1]]
        if since >= MIN_SPACING_S - rounding or ((always[row] or renewed[row]) and since > 0.0):
            keep.append(row)
    return np.array(keep, dtype=np.int64)


def _last_of_renewal(run: Run, every_s: float) -> BoolArray:
    """Rows at which the last of the wheels' signals was renewed, shape (n,)."""
    changed = np.zeros(len(run), dtype=bool)
    for name in MOTION_PAIRS[_source(run)]:
        changed |= _changed(run.columns[name])
    at = np.flatnonzero(changed)
    following = np.diff(run.t_s[at], append=np.inf)
    changed[at[following <= SAME_RENEWAL * every_s]] = False
    return changed


def _renewal(recordings: RecordingSet, wheel: int) -> Renewal:
    times: list[FloatArray] = []
    steps: list[FloatArray] = []
    repeated = rows = 0
    for run in recordings:
        values = run.columns[MOTION_PAIRS[_source(run)][wheel]]
        fast, changed = _fast(values, run), _changed(values)
        repeated += int((fast & ~changed).sum())
        rows += int(fast.sum())
        at = np.flatnonzero(changed & fast)
        times.append(np.array([run.t_s[b] - run.t_s[a] for a, b in pairwise(at) if fast[a : b + 1].all()]))
        steps.append(np.abs(np.diff(values)))
    interval_s = float(np.median([run.interval_s for run in recordings]))
    between = np.concatenate(times)
    between = between[between > 0.0]
    every_s = max(float(np.median(between)), interval_s) if len(between) else interval_s
    return Renewal(every_s, repeated / max(rows, 1), _smallest_step(np.concatenate(steps)))


def _source(run: Run) -> SpeedSource:
    return next(source for source in ("vel", "pos", "ticks") if run.has_pair(source))


def _changed(values: FloatArray) -> BoolArray:
    changed = np.ones(len(values), dtype=bool)
    changed[1:] = values[1:] != values[:-1]
    return changed


def _fast(values: FloatArray, run: Run) -> BoolArray:
    """Rows at which the wheel turns too fast for two measurements to be equal, shape (n,)."""
    speed = np.abs(values)
    if _source(run) != "vel":
        reach = max(2, len(values) // 200)  # over several rows, so that held positions are no standstill
        row = np.arange(len(values))
        after, before = np.minimum(row + reach, len(row) - 1), np.maximum(row - reach, 0)
        speed = np.abs(values[after] - values[before]) / np.maximum(run.t_s[after] - run.t_s[before], 1e-9)
    return np.asarray(speed > max(FAST_SHARE * float(np.percentile(speed, 98)), 0.0))


def _smallest_step(steps: FloatArray) -> float:
    """The step that nearly all changes are multiples of; 0 where there is none."""
    steps = steps[steps > 0.0]
    if len(steps) < MIN_STEPS:
        return 0.0
    step = float(np.percentile(steps, 1))
    remainder = np.abs(steps / step - np.round(steps / step))
    return step if float(np.percentile(remainder, 90)) < 0.05 else 0.0
