"""The rows that methods are fitted to and judged on, and which runs are left out together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.data.set_data import set_data
from truing.diagnose.result import Diagnosis
from truing.diagnose.signal_selection import with_selected_signal
from truing.errors import IdentifyError
from truing.recording.run import RecordingSet
from truing.studies.real.peers.wheel_runs import WheelRun

# No error counts as more than this many times top speed: past it a model has diverged.
MOST_ERROR = 10.0
# Stretches of fewer rows tell nothing of a wheel.
MIN_ROWS = 4
# Times of rows that differ by less are equal.
SAME_TIME_S = 1e-6


@dataclass(frozen=True, slots=True)
class RowSet:
    """What every method gets.

    Attributes
    ----------
    wheels : the runs of the left and of the right wheel, cut at their gaps.
    part_of_run : of each run, which part it is left out with.
    top_mps : 98th percentile of |speed| over both wheels, what per cents refer to.
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
    """Every row of the files, those that repeat the row before among them, divided in the same way."""
    data = with_selected_signal(set_data(recordings))
    wheels: tuple[list[WheelRun], list[WheelRun]] = ([], [])
    for k, (a, b) in enumerate(pairwise(data.starts)):
        for wheel, runs in enumerate(wheels):
            columns = (data.t_s[a:b], data.effort[a:b, wheel], data.speed_mps[a:b, wheel])
            t_s, effort, speed = (np.ascontiguousarray(column) for column in columns)
            judged = data.counted[a:b, wheel].copy()
            start = float(data.initial_mps[k, wheel])
            runs.append(WheelRun(int(data.run_of_row[a]), t_s, effort, speed, judged, start))
    return _row_set(wheels, diagnosis)


def held_model(diagnosis: Diagnosis, rows: RowSet) -> list[FloatArray]:
    """Errors of the diagnosis's model at other rows of its runs, as `WheelRun.judge` gives them.

    Between two measurements the recorder repeats the last one, and so does this.
    """
    errors = []
    for wheel, runs in enumerate(rows.wheels):
        for run in runs:
            trace = diagnosis.traces[run.run]
            new = np.flatnonzero(trace.valid[:, wheel] | (np.arange(len(trace.t_s)) == 0))
            last = np.searchsorted(trace.t_s[new], run.t_s + SAME_TIME_S, side="right") - 1
            errors.append(run.judge(trace.model[new[np.maximum(last, 0)], wheel]))
    return errors


def _row_set(wheels: tuple[Sequence[WheelRun], Sequence[WheelRun]], diagnosis: Diagnosis) -> RowSet:
    speeds = [np.abs(run.speed_mps) for runs in wheels for run in runs]
    top = float(np.percentile(np.concatenate(speeds), 98.0)) if speeds else 0.0
    if top <= 0.0:
        raise IdentifyError("no wheel moves")
    return RowSet((tuple(wheels[0]), tuple(wheels[1])), _parts(diagnosis), top)


def _parts(diagnosis: Diagnosis) -> tuple[int, ...]:
    part_of = {name: part for part, split in enumerate(diagnosis.splits) for name in split.judged}
    if len(diagnosis.splits) < 2 or set(part_of) != set(diagnosis.runs):
        raise IdentifyError("its runs are too few to leave any out")
    return tuple(part_of[name] for name in diagnosis.runs)
