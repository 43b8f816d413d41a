"""Identifying a whole set: labels, fits by kind and direction, findings, tables, CSV, JSON, the command."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console

from support.first_order_robot import BASELINE, TEST_XI, FirstOrderRobot
from truing.cli import group
from truing.errors import FileError, TruingError
from truing.identify.data_checks import check_set, summarise
from truing.identify.identification import Identification, identify_set
from truing.identify.tables import fits_csv, result_tables, steps_csv, unstepped
from truing.recording.reader import read_recording_set
from truing.recording.run import RecordingSet, Run
from truing.recording.writer import write_run

ONE_LEVEL = ((1.0, 0.0), (3.0, 0.30), (2.0, 0.0))
RAMP = tuple((0.05, 0.002 * k) for k in range(200))
BACK = tuple((0.05, -0.002 * k) for k in range(200))
ROBOT = FirstOrderRobot(disturbance=0.005)


def recording_set(*runs: Run) -> RecordingSet:
    named = tuple(replace(run, name=f"{number:02d}_{run.name}") for number, run in enumerate(runs, start=1))
    return RecordingSet("a robot", named, BASELINE)


@pytest.fixture(scope="module")
def paper_like() -> Identification:
    return identify_set(
        recording_set(
            ROBOT.drive(ONE_LEVEL, right_share=0.0, name="I"),
            ROBOT.drive(ONE_LEVEL, right_share=0.0, mode="velocity", name="V", seed=2),
            ROBOT.drive(TEST_XI, name="XI", seed=3),
        )
    )


@pytest.fixture(scope="module")
def foreign() -> Identification:
    bare = ("vel", "pos")
    return identify_set(
        recording_set(
            ROBOT.drive(RAMP, columns=bare, name="slow_forward", rate_hz=50.0),
            ROBOT.drive(BACK, columns=bare, name="slow_backward", rate_hz=50.0, seed=2),
            ROBOT.drive(((0.1, 0.0), (3.0, 0.5)), columns=bare, name="fast_forward", rate_hz=50.0, seed=3),
            ROBOT.drive(((0.1, 0.0), (3.0, -0.5)), columns=bare, name="fast_backward", rate_hz=50.0, seed=4),
        )
    )


def printed(result: Identification) -> str:
    console = Console(file=io.StringIO(), width=110, highlight=False)
    for table in result_tables(result):
        console.print(table.to_rich())
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_runs_carry_the_papers_labels(paper_like: Identification) -> None:
    assert [run.mode for run in paper_like.runs] == ["E-L", "V-L", "E-B"]


def test_steps_of_one_level_and_of_several_have_tables_of_their_own(paper_like: Identification) -> None:
    three, four, shape, _ = result_tables(paper_like)
    assert three.title == "Steps, one level each"
    expected = [["01_I", "E-L", "left", "30 %"], ["02_V", "V-L", "left", "0.30 m/s"]]
    assert [row[:4] for row in three.rows] == expected
    assert four.title == "Steps, several levels"
    steps = ["0 → 35 %", "35 → 50 %", "50 → 45 %", "45 → 0 %"]
    assert [row[3] for row in four.rows] == steps * 2
    up, down = four.header.index("τ up, s"), four.header.index("τ down, s")
    assert shape.header[-4:] == ["Dead time, s", "Over, %", "Under, %", "Ripple, mm/s"]
    assert len(shape.rows) == 2 * 2 + 2 * 4
    assert [bool(row[up]) for row in four.rows[:4]] == [True, True, False, False]
    assert [bool(row[down]) for row in four.rows[:4]] == [False, False, True, True]


def test_a_wheel_that_is_never_driven_is_not_in_the_table(paper_like: Identification) -> None:
    three = result_tables(paper_like)[0]
    assert all(row[2] == "left" for row in three.rows)


def test_the_terminal_shows_every_number_and_every_remark(paper_like: Identification) -> None:
    text = printed(paper_like)
    for table in result_tables(paper_like):
        for row in table.rows:
            for line in row[4].split("\n"):
                assert line in text
    assert "mm/s per %" in text
    assert "63.2 %" in text


def test_runs_with_steps_only_are_fitted_together(paper_like: Identification) -> None:
    assert [(fit.wheel, fit.label) for fit in paper_like.fits] == [("left", "all runs"), ("right", "03_XI")]


def test_ramps_and_steps_are_also_fitted_by_kind_and_direction(foreign: Identification) -> None:
    labels = ["all runs", "steps backward", "steps forward", "ramps backward", "ramps forward"]
    assert [fit.label for fit in foreign.fits if fit.wheel == "left"] == labels
    for fit in foreign.fits:
        assert fit.gain.value == pytest.approx(1.45, rel=0.02)
    assert [line.split(":")[0] for line in unstepped(foreign)] == ["01_slow_forward", "02_slow_backward"]


def test_dry_friction_on_a_ramp_is_not_passed_off_as_lag() -> None:
    def rub(run: Run) -> Run:
        # A wheel that answers only to the effort above its friction.
        columns = dict(run.columns)
        for side in ("left", "right"):
            speed = columns[f"vel_{side}_mps"]
            columns[f"vel_{side}_mps"] = np.sign(speed) * np.maximum(np.abs(speed) - 1.45 * 0.06, 0.0)
        return replace(run, columns=columns)

    step = ((0.1, 0.0), (3.0, 0.5))
    result = identify_set(
        recording_set(
            rub(ROBOT.drive(RAMP, columns=("vel",), name="slow")),
            rub(ROBOT.drive(step, columns=("vel",), name="fast")),
        )
    )
    (ramp,) = [fit for fit in result.fits if fit.wheel == "left" and fit.label == "ramps forward"]
    assert any("friction" in note for note in ramp.notes)
    assert "friction" in printed(result)


def test_json_holds_every_number_and_null_with_a_reason(paper_like: Identification) -> None:
    tree = json.loads(json.dumps(paper_like.to_json(), allow_nan=False))
    assert tree["schema"] == 1
    left = tree["runs"][0]["left"]
    assert left["steps"][0]["gain"]["value"] == pytest.approx(14.5, rel=0.02)
    assert left["steps"][1]["gain"]["value"] is None
    assert left["steps"][1]["gain"]["reason"]
    assert tree["runs"][0]["right"]["reason"]
    low, high = tree["first_order"][0]["gain_mps"]["ci95"]
    assert low < 1.45 < high


def test_csv_tables_hold_the_same_numbers(paper_like: Identification) -> None:
    rows = list(csv.DictReader(io.StringIO(steps_csv(paper_like))))
    assert len(rows) == 2 + 2 + 8
    first = paper_like.runs[0].left.steps[0]
    assert float(rows[0]["gain"]) == pytest.approx(first.gain.value, rel=1e-5)
    assert rows[1]["gain"] == ""
    assert rows[1]["reason"] == "no gain at zero input"
    fits = list(csv.DictReader(io.StringIO(fits_csv(paper_like))))
    assert float(fits[0]["gain_low_mps"]) < float(fits[0]["gain_mps"]) < float(fits[0]["gain_high_mps"])


def test_progress_runs_from_start_to_end() -> None:
    seen: list[float] = []
    identify_set(recording_set(ROBOT.drive(TEST_XI), ROBOT.drive(TEST_XI, seed=2)), seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


def topics(*runs: Run) -> set[str]:
    return {finding.topic for finding in check_set(recording_set(*runs))}


def test_a_healthy_robot_has_no_findings(paper_like: Identification, foreign: Identification) -> None:
    assert paper_like.findings == ()
    assert foreign.findings == ()


def changed(run: Run, **columns: np.ndarray) -> Run:
    return replace(run, columns=run.columns | columns)


def test_what_looks_wrong_is_said() -> None:
    run = ROBOT.drive(TEST_XI, columns=("vel", "pos"), rate_hz=50.0)
    left, effort = run.columns["vel_left_mps"], run.columns["effort_left"]
    held = left[np.minimum(np.arange(len(run)) // 4 * 4, len(run) - 1)]
    jump = run.columns["pos_left_m"] + np.where(run.t_s > 4.0, 8.0, 0.0)
    late = run.t_s + np.where(run.t_s > 4.0, 2.0, 0.0)
    assert "repeated" in topics(changed(run, vel_left_mps=held))
    assert "jump" in topics(changed(run, pos_left_m=jump))
    assert "gap" in topics(changed(run, t_s=late))
    assert "sign" in topics(changed(run, vel_left_mps=-left))
    assert "dead" in topics(changed(run, vel_left_mps=0.0 * left))
    assert "effort" in topics(changed(run, effort_left=12.0 * effort))
    assert "sides" in topics(changed(run, vel_left_mps=0.5 * left))


def test_a_scaled_wheel_is_told_from_an_encoder_that_miscounts() -> None:
    run = ROBOT.drive(TEST_XI, columns=("vel",), rate_hz=50.0)
    left = run.columns["vel_left_mps"]
    (scaled,) = check_set(recording_set(changed(run, vel_left_mps=0.5 * left)))
    assert "gearing" in scaled.text
    wandering = 0.5 * left * (1.0 + 0.4 * np.sin(20.0 * run.t_s))
    (lost,) = check_set(recording_set(changed(run, vel_left_mps=wandering)))
    assert "miscounts" in lost.text
    assert lost.wheel == "left"


def test_findings_that_repeat_take_one_line() -> None:
    run = ROBOT.drive(TEST_XI, columns=("vel",), rate_hz=50.0)
    half = changed(run, vel_left_mps=0.5 * run.columns["vel_left_mps"])
    lines = summarise(check_set(recording_set(*[half] * 6)))
    assert len(lines) == 1
    assert "and 2 more" in lines[0]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    text = "[robot]\nwheel_radius_m = 0.0635\nwheelbase_m = 0.283\ncounts_per_rev = 2400\n"
    for side in ("left", "right"):
        text += f"[wheel.{side}]\ngain_mps = 1.45\ntime_constant_s = 0.35\n"
    (tmp_path / "baseline.toml").write_text(text)
    write_run(ROBOT.drive(TEST_XI), tmp_path / "runs" / "01_XI.csv")
    return tmp_path


def test_truing_identify_prints_tables_and_writes_a_folder(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = CliRunner().invoke(group, ["identify", str(folder), "--out", str(out)], catch_exceptions=False)
    assert result.exit_code == 0
    assert "Steps, several levels" in result.stdout
    names = {path.name for path in out.iterdir()}
    files = {"report.html", "identification.json", "steps.csv", "first_order.csv", "01_XI.png"}
    assert names == files | {"tables"}
    tables = {path.name for path in (out / "tables").iterdir()}
    assert {"steps_several_levels.csv", "steps_several_levels.png", "steps_their_shape.csv"} <= tables
    assert len([name for name in tables if name.endswith(".csv")]) * 2 == len(tables)


def test_truing_identify_json_is_json_and_nothing_else(folder: Path) -> None:
    result = CliRunner().invoke(group, ["identify", str(folder), "--json"], catch_exceptions=False)
    assert json.loads(result.stdout)["runs"][0]["mode"] == "E-B"


def test_truing_identify_takes_a_single_file(folder: Path) -> None:
    file = folder / "runs" / "01_XI.csv"
    result = CliRunner().invoke(group, ["identify", str(file), "--json"], catch_exceptions=False)
    assert json.loads(result.stdout)["runs"][0]["run"] == "01_XI"


def test_a_users_mistake_is_a_truing_error_with_a_next_step(folder: Path) -> None:
    result = CliRunner().invoke(group, ["identify", str(folder / "nowhere")])
    assert isinstance(result.exception, FileError)
    (folder / "baseline.toml").unlink()
    result = CliRunner().invoke(group, ["identify", str(folder)])
    assert isinstance(result.exception, TruingError)
    assert "--model" in result.exception.next_step


REAL_ERRORS = {
    # Set, wheel: free-run error of a first-order model over all runs, per cent, that a plain fit reaches.
    ("frc_frc5024_2020__MinibotCarpet20200124-1730", "left"): 6.1,
    ("frc_frc5024_2020__Piperservant20200206-1721", "left"): 6.3,
    ("frc_armada2508_2020__data20200509-1153", "right"): 4.4,
    ("frc_frc2881_2022__sysid_data20220227-150426", "left"): 2.9,
}


@pytest.mark.recordings
@pytest.mark.parametrize(("name", "wheel"), list(REAL_ERRORS))
def test_real_drivetrains_are_followed_as_well_as_a_first_order_model_can(
    recordings: Path, name: str, wheel: str
) -> None:
    real = read_recording_set(recordings / "real" / name)
    result = identify_set(real)
    fit = next(fit for fit in result.fits if fit.wheel == wheel and fit.label == "all runs")
    assert fit.rms_percent is not None
    assert fit.rms_percent <= 1.1 * REAL_ERRORS[name, wheel]
    assert real.baseline is not None
    known = getattr(real.baseline, wheel)
    assert fit.gain.value == pytest.approx(known.gain_mps, rel=0.06)
    steps = [step for run in result.runs for side in run.wheels if side.wheel == wheel for step in side.steps]
    assert steps, "the fast runs are steps"
    for step in steps:
        assert step.gain.value == pytest.approx(10.0 * known.gain_mps, rel=0.10)
        assert step.time_constant.value is not None


@pytest.mark.recordings
def test_the_minibots_broken_right_encoder_is_named_in_every_run(recordings: Path) -> None:
    name = "frc_frc5024_2020__MinibotCarpet20200124-1730"
    findings = identify_set(read_recording_set(recordings / "real" / name)).findings
    sides = [finding for finding in findings if finding.topic == "sides"]
    assert len(sides) == 4
    assert all(finding.wheel == "right" and "miscounts" in finding.text for finding in sides)


@pytest.mark.recordings
def test_every_real_set_is_identified_within_two_seconds_of_computing(recordings: Path) -> None:
    import time

    for folder in sorted((recordings / "real").iterdir()):
        # Computing time, not the clock on the wall: other programs may share the machine.
        start = time.process_time()
        result = identify_set(read_recording_set(folder))
        assert time.process_time() - start < 2.0
        assert any(fit.gain.value is not None for fit in result.fits)


def test_a_number_that_no_robot_makes_is_named_and_not_fitted() -> None:
    run = ROBOT.drive(TEST_XI)
    ticks = run.columns["ticks_left"].copy()
    ticks[50] = 1e12
    with pytest.raises(TruingError, match=r"ticks_left, row 51"):
        identify_set(recording_set(changed(run, ticks_left=ticks)))
    microvolts = changed(run, effort_right=1e6 * run.columns["effort_right"])
    with pytest.raises(TruingError, match="effort_right"):
        identify_set(recording_set(microvolts))
