"""The rows that methods are fitted to and judged on, and which runs are left out together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.data.recorder import renewals
from truing.diagnose.data.set_data import set_data
from truing.diagnose.data.traces import RunTraces
from truing.diagnose.result import Diagnosis
from truing.diagnose.signal_selection import with_selected_signal
from truing.errors import IdentifyError
from truing.recording.run import RecordingSet
from truing.studies.real.peers.wheel_runs import WheelRun

# No error counts as more than this many times top speed: past it a model has diverged.
MOST_ERROR = 10.0
# Stretches of fewer rows tell nothing of a wheel.
MIN_ROWS = 4
# Rows this many times further apart than the recorder's are several put together.
MIN_TOGETHER = 1.5
# Times of rows that differ by less are equal.
SAME_TIME_S = 1e-6


@dataclass(frozen=True, slots=True)
class RowSet:
    """What every method gets.

    Attributes
    ----------
    wheels : the runs of the left and of the right wheel, cut at their gaps.
    part_of_run : of each run, which part it is left out with.
    top_mps : 98th percentile of |speed| over the wheels that are judged, what per cents refer to.
    """

    wheels: tuple[tuple[WheelRun, ...], tuple[WheelRun, ...]]
    part_of_run: tuple[int, ...]
    top_mps: float

    def percent(self, errors: Sequence[FloatArray]) -> float:
        """RMS over time of what `WheelRun.judge` gives, each of shape (k, 2), per cent of top speed."""
        error, stands_s = np.concatenate(errors).T
        limit = MOST_ERROR * self.top_mps
        bounded = np.clip(np.nan_to_num(error, nan=limit), -limit, limit)
        total_s = float(stands_s.sum())
        if total_s <= 0.0:
            return math.nan
        return 100.0 * math.sqrt(float(stands_s @ bounded**2) / total_s) / self.top_mps


def judged_rows(recordings: RecordingSet, diagnosis: Diagnosis) -> RowSet:
    """The rows that a diagnosis judged, and its own division of the runs.

    Raises
    ------
    IdentifyError : its runs were not divided, or nothing moves.
    """
    data = set_data(recordings)
    wheels: tuple[list[WheelRun], list[WheelRun]] = ([], [])
    for a, b in pairwise(data.starts):
        run = int(data.run_of_row[a])
        trace = diagnosis.traces[run]
        here = (trace.t_s >= data.t_s[a] - SAME_TIME_S) & (trace.t_s <= data.t_s[b - 1] + SAME_TIME_S)
        if int(here.sum()) < MIN_ROWS:
            continue
        for wheel, runs in enumerate(wheels):
            columns = (trace.t_s[here], trace.effort[here, wheel], trace.measured[here, wheel])
            t_s, effort, speed = (np.ascontiguousarray(column, dtype=np.float64) for column in columns)
            judged = np.asarray(trace.valid[here, wheel], dtype=np.bool_)
            runs.append(WheelRun(run, t_s, effort, speed, judged, float(trace.refit[here, wheel][0])))
    return _row_set(wheels, diagnosis)


def every_row(recordings: RecordingSet, diagnosis: Diagnosis) -> RowSet:
    """Every row of the files, those that repeat the row before among them, divided in the same way.

    A wheel that the diagnosis left out counts here no more than there: the second side of an axis, or a
    wheel whose encoder is at fault.
    """
    data = with_selected_signal(set_data(recordings))
    traces = diagnosis.traces
    is_judged = [not traces or any(trace.valid[:, wheel].any() for trace in traces) for wheel in (0, 1)]
    wheels: tuple[list[WheelRun], list[WheelRun]] = ([], [])
    for k, (a, b) in enumerate(pairwise(data.starts)):
        for wheel, runs in enumerate(wheels):
            columns = (data.t_s[a:b], data.effort[a:b, wheel], data.speed_mps[a:b, wheel])
            t_s, effort, speed = (np.ascontiguousarray(column) for column in columns)
            judged = data.counted[a:b, wheel] & is_judged[wheel]
            start = float(data.initial_mps[k, wheel])
            runs.append(WheelRun(int(data.run_of_row[a]), t_s, effort, speed, judged, start))
    return _row_set(wheels, diagnosis)


def errors_at_every_row(recordings: RecordingSet, diagnosis: Diagnosis, rows: RowSet) -> list[FloatArray]:
    """Errors of the diagnosis's model at other rows of its runs, as `WheelRun.judge` gives them."""
    errors = []
    for wheel, (runs, renewal) in enumerate(zip(rows.wheels, renewals(recordings), strict=True)):
        errors += [
            run.judge(_model_at(run, diagnosis.traces[run.run], wheel, held=renewal.held)) for run in runs
        ]
    return errors


def _model_at(run: WheelRun, trace: RunTraces, wheel: int, *, held: bool) -> FloatArray:
    """The model's speeds at the rows of a run, shape (n,), m/s.

    Between two measurements a recorder repeats the last one, and so does this. Rows that are faster than any
    wheel, of which the diagnosis put several together, are interpolated between the middles of those.
    """
    new = np.flatnonzero(trace.valid[:, wheel] | (np.arange(len(trace.t_s)) == 0))
    t_s, model = trace.t_s[new], trace.model[new, wheel]
    together = float(np.median(np.diff(trace.t_s))) > MIN_TOGETHER * float(np.median(np.diff(run.t_s)))
    if together and not held:
        return np.asarray(np.interp(run.t_s, t_s - 0.5 * np.diff(t_s, prepend=t_s[0]), model))
    last = np.searchsorted(t_s, run.t_s + SAME_TIME_S, side="right") - 1
    return np.asarray(model[np.maximum(last, 0)])


def _row_set(wheels: tuple[Sequence[WheelRun], Sequence[WheelRun]], diagnosis: Diagnosis) -> RowSet:
    judged = [runs for runs in wheels if any(run.judged.any() for run in runs)]
    speeds = [np.abs(run.speed_mps) for runs in judged for run in runs]
    top = float(np.percentile(np.concatenate(speeds), 98.0)) if speeds else 0.0
    if top <= 0.0:
        raise IdentifyError("no wheel moves")
    return RowSet((tuple(wheels[0]), tuple(wheels[1])), _parts(diagnosis), top)


def _parts(diagnosis: Diagnosis) -> tuple[int, ...]:
    part_of = {name: part for part, split in enumerate(diagnosis.splits) for name in split.judged}
    if len(diagnosis.splits) < 2 or set(part_of) != set(diagnosis.runs):
        raise IdentifyError("its runs are too few to leave any out")
    return tuple(part_of[name] for name in diagnosis.runs)
