"""Signals, statistics, steps and CSV of a run; a diagnosis as a process that can be watched and ended."""

from __future__ import annotations

import csv
import io
import json
import time
from pathlib import Path

import pytest

from truing.errors import TruingError
from truing.recording.baseline import read_baseline
from truing.web.process.diagnosis_job import DiagnosisJob
from truing.web.views.analysis import analysis_content, csv_text, signals_of
from truing.web.views.figures import MAX_POINTS, decimated
from web.synthetic_runs import BASELINE, straight_run, synthetic_set


@pytest.fixture
def baseline(tmp_path: Path):
    (tmp_path / "baseline.toml").write_text(BASELINE)
    return read_baseline(tmp_path / "baseline.toml")


def show(run, baseline, wanted=("speed_left", "x_m"), span=None):
    return analysis_content(run, baseline, wanted, span)


def test_signals_of_one_unit_share_a_panel(baseline):
    found = show(straight_run(), baseline, ("speed_left", "speed_right", "x_m"), (1.0, 2.0))["figure"]
    names = [(panel["unit"], [line["name"] for line in panel["lines"]]) for panel in found["panels"]]
    assert names == [("m/s", ["speed_left", "speed_right"]), ("m", ["x_m"])]
    assert [(mark["from"], mark["to"]) for mark in found["marks"]] == [(1.0, 2.0)]


def test_statistics_are_of_the_selection(baseline):
    run = straight_run(0.5)
    whole, part = show(run, baseline), show(run, baseline, span=(4.0, 6.0))
    assert whole["statistics"][0][1] == str(len(run))
    name, rows, mean, _, minimum, maximum, slope = part["statistics"][1]
    assert (name, rows) == ("x_m, m", "41")
    # 0.5 m/s, all but the last of the start-up's exponential gone.
    assert float(slope) == pytest.approx(0.5, abs=0.002)
    assert float(minimum) < float(mean) < float(maximum)
    assert show(run, baseline, span=(90.0, 91.0))["statistics"][0][1] == "0"


def test_every_step_has_its_metrics(baseline):
    steps = show(straight_run(0.5), baseline)["steps"]
    wheel, at, change, steady, gain, tau, *_ = steps[0]
    assert wheel == "left"
    assert float(at) == pytest.approx(1.0, abs=0.06)
    assert change.endswith("0.345")
    assert float(steady) == pytest.approx(0.5, abs=0.002)
    assert float(gain) == pytest.approx(14.5, rel=0.01)
    assert float(tau) == pytest.approx(0.35, abs=0.02)


def test_csv_holds_the_selection_with_units(baseline):
    run = straight_run()
    rows = list(csv.reader(io.StringIO(csv_text(run, baseline, ("x_m", "effort_left"), (1.0, 2.0)))))
    assert rows[0] == ["t_s", "effort_left (% effort)", "x_m (m)"]
    assert len(rows) == 22
    assert float(rows[-1][2]) == run.columns["x_m"][40]


def test_a_long_run_is_drawn_with_its_extremes(baseline):
    run = straight_run()
    values = run.columns["x_m"].repeat(100)
    values[777] = 99.0
    t = run.t_s[0] + 0.01 * (values * 0 + 1).cumsum()
    times, drawn = decimated(t, values)
    assert len(times) <= MAX_POINTS + 1
    assert max(value for value in drawn if value is not None) == 99.0
    assert len(signals_of(run, baseline)) == 9


def test_a_diagnosis_is_ended_at_once_and_leaves_nothing_behind(tmp_path):
    job = DiagnosisJob(tmp_path / "diagnoses")
    job.start(synthetic_set(tmp_path / "made"), "made")
    assert job.state.stage == "running"
    with pytest.raises(TruingError):
        job.start(tmp_path / "made", "made")
    began = time.monotonic()
    job.cancel()
    assert job.state.stage == "cancelled"
    assert time.monotonic() - began < 5.0
    assert not job.result_of("made").exists()


def test_what_is_wrong_with_recordings_is_said(tmp_path):
    job = DiagnosisJob(tmp_path / "diagnoses")
    job.start(tmp_path / "nowhere", "nowhere")
    until = time.monotonic() + 60.0
    while job.state.stage == "running" and time.monotonic() < until:
        time.sleep(0.05)
    assert job.state.stage == "failed"
    assert "nowhere" in job.state.problem


@pytest.mark.slow
def test_a_diagnosis_leaves_verdict_report_and_heat_map(tmp_path):
    job = DiagnosisJob(tmp_path / "diagnoses")
    job.start(synthetic_set(tmp_path / "made"), "made")
    progress = set()
    until = time.monotonic() + 400.0
    while job.state.stage == "running" and time.monotonic() < until:
        progress.add(job.state.progress)
        time.sleep(0.02)
    assert job.state.stage == "done", job.state.problem
    assert len(progress) > 2
    result = job.result_of("made")
    assert result.is_file()
    assert result.with_suffix(".html").stat().st_size > 10_000
    page = json.loads((result.parent / "pages/made.json").read_text())
    maps = [panel["map"] for panel in page["map"]["panels"]]
    assert [panel["unit"] for panel in page["map"]["panels"]][:2] == ["left, refitted", "right, refitted"]
    assert maps[0]["rows"] == ["01_straight", "02_straight", "03_straight"]
    assert all(len(row) == len(maps[0]["edges"]) - 1 for row in maps[0]["values"])
