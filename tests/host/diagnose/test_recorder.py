"""A recorder that logs faster than it measures: renewals are found, and repeated rows carry no weight."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from truing.diagnose.data.recorder import at_renewals, renewals, repeated_rows
from truing.diagnose.data.set_data import set_data
from truing.recording.baseline import Baseline, WheelModel
from truing.recording.run import RecordingSet, Run

ROW_S = 0.005


def ramp(every_rows: int, seconds: float = 8.0, offset_rows: int = 0) -> Run:
    """Both wheels speed up evenly; each is measured every so many rows, the right one some rows later."""
    t_s = np.arange(round(seconds / ROW_S)) * ROW_S
    speed = 0.5 * t_s
    rows = np.arange(len(t_s))
    left = speed[rows // every_rows * every_rows]
    right = speed[np.maximum((rows - offset_rows) // every_rows * every_rows + offset_rows, 0)]
    columns = {
        "t_s": t_s,
        "effort_left": t_s / seconds,
        "effort_right": t_s / seconds,
        "vel_left_mps": left,
        "vel_right_mps": right,
    }
    return Run("ramp", columns)


def test_the_time_between_renewals_is_found() -> None:
    for every in (4, 10, 50):
        left, right = renewals(RecordingSet("held", (ramp(every, offset_rows=2),)))
        np.testing.assert_allclose((left.every_s, right.every_s), every * ROW_S, rtol=1e-6)
        np.testing.assert_allclose(left.repeated, 1.0 - 1.0 / every, atol=0.02)
        assert left.held


def test_a_speed_that_changes_with_each_row_is_not_held() -> None:
    left, right = renewals(RecordingSet("free", (ramp(1),)))
    assert not left.held
    np.testing.assert_allclose((left.every_s, right.every_s), ROW_S)


def test_runs_are_reduced_to_rows_that_were_measured() -> None:
    recordings = RecordingSet("held", (ramp(10),))
    run = at_renewals(recordings).runs[0]
    assert len(run) < 0.4 * len(recordings.runs[0])
    measured = np.flatnonzero(np.diff(run.columns["vel_left_mps"]) != 0.0) + 1
    # A renewed speed stands at the time at which it was renewed.
    np.testing.assert_allclose(run.columns["vel_left_mps"][measured], 0.5 * run.t_s[measured], atol=1e-12)
    assert not len(run.gaps())


def test_efforts_of_merged_rows_are_means_over_their_interval() -> None:
    original = ramp(10)
    run = at_renewals(RecordingSet("held", (original,))).runs[0]
    steps = np.diff(run.t_s, prepend=run.t_s[0])
    whole = float(np.sum(run.columns["effort_left"] * steps))
    np.testing.assert_allclose(
        whole, np.sum(original.columns["effort_left"] * np.diff(original.t_s, prepend=0.0)), rtol=1e-9
    )


def test_a_row_at_which_only_the_other_wheel_was_renewed_is_no_measurement() -> None:
    recordings = RecordingSet("held", (ramp(10, offset_rows=5),))
    reduced = at_renewals(recordings)
    (mask,) = repeated_rows(recordings, reduced)
    run = reduced.runs[0]
    for wheel, side in enumerate(("left", "right")):
        changed = np.append(True, np.diff(run.columns[f"vel_{side}_mps"]) != 0.0)
        assert not mask[changed, wheel].any()
        assert mask[:, wheel].mean() > 0.3


def test_an_old_value_is_no_measurement_while_the_next_renewal_may_be_late() -> None:
    original = ramp(50)
    left = original.columns["vel_left_mps"].copy()
    left[400:408] = left[399]  # this renewal comes 40 ms late
    late = replace(original, columns=original.columns | {"vel_left_mps": left})
    recordings = RecordingSet("held", (late,))
    reduced = at_renewals(recordings)
    (mask,) = repeated_rows(recordings, reduced)
    run = reduced.runs[0]
    stale = (run.t_s >= 400 * ROW_S) & (run.t_s < 408 * ROW_S)
    assert stale.any()
    assert mask[stale, 0].all()


def test_a_measurement_stands_for_the_rows_that_repeat_it() -> None:
    recordings = RecordingSet("held", (ramp(10), ramp(10, seconds=4.0)))
    reduced = at_renewals(recordings)
    wheel = WheelModel(1.0, 0.3)
    baseline = Baseline(Path("baseline.toml"), wheel, wheel)
    data = set_data(replace(reduced, baseline=baseline), repeated=repeated_rows(recordings, reduced))
    measured = data.valid[:, 0] & (data.speed_mps[:, 0] != 0.0)
    row_s = float(np.median([run.interval_s for run in reduced]))
    np.testing.assert_allclose(np.median(data.stands_for[measured, 0]) * row_s, 10 * ROW_S, rtol=1e-6)
    length_s = sum(float(run.t_s[-1] - run.t_s[0]) + run.interval_s for run in reduced)
    np.testing.assert_allclose(data.stands_for[:, 0].sum() * row_s, length_s, rtol=1e-6)
    assert not data.stands_for[~data.valid[:, 0], 0].any()


def test_counts_stay_as_they_are() -> None:
    run = ramp(10)
    columns = {name: values for name, values in run.columns.items() if not name.startswith("vel")}
    columns |= {name: np.floor(1000.0 * run.t_s) for name in ("ticks_left", "ticks_right")}
    recordings = RecordingSet("counts", (Run("counts", columns),))
    assert at_renewals(recordings) is recordings
