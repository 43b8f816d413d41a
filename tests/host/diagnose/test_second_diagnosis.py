"""The second diagnosis of a robot: effects that the simulation already holds get their new numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from support.synthetic_wheel import RADIUS_M, Truth, record, staircase
from truing.diagnose.diagnosis_input import Options
from truing.diagnose.engine import diagnose
from truing.diagnose.present.corrected_model import corrected_model
from truing.diagnose.present.export_check import error_as_given
from truing.diagnose.present.exports import Export, write_exports
from truing.diagnose.present.text import baseline_effect_lines
from truing.diagnose.result import Diagnosis, EffectParameter, FitErrors, NamedEffect
from truing.diagnose.simulator_baseline import equivalent_baseline
from truing.recording.baseline import Baseline, RobotGeometry, WheelModel, read_baseline
from truing.recording.run import RecordingSet, Run
from truing.recording.writer import write_run

REAL = Truth(friction=0.10, breakaway=0.10, delay=0.04)
GEOMETRY = RobotGeometry("second", RADIUS_M, 0.283, 2400.0)
ALREADY = {"coulomb_friction": {"left": 0.03, "right": 0.03}, "input_delay": {"delay": 0.01}}


def runs(truth: Truth) -> tuple[Run, ...]:
    return tuple(record(truth, staircase(k), seed=k, fine_s=1e-3, name=f"{k:02d}") for k in range(3))


def robot(effects: dict[str, dict[str, float]]) -> RecordingSet:
    wheel = WheelModel(1.45, 0.35)
    baseline = Baseline(Path("baseline.toml"), wheel, wheel, GEOMETRY, 20.0, effects)
    return RecordingSet("second", runs(REAL), baseline)


def simulator_output(folder: Path, truth: Truth) -> Options:
    for run in runs(truth):
        write_run(run, folder / f"{run.name}.csv")
    return Options(sim_runs=folder)


def check_delay_and_friction(recordings: RecordingSet, diagnosis: Diagnosis, folder: Path) -> None:
    """The real 40 ms and 0.10 are reported, and exported to a baseline that keeps the claimed error."""
    said = " ".join(baseline_effect_lines(diagnosis))
    assert "delay 40." in said
    assert diagnosis.baseline_effects["input_delay"]["delay"].value == pytest.approx(0.04, abs=1e-3)
    lines = write_exports(
        [Export("toml", folder / "m.toml"), Export("fmu", folder / "m.fmu")], recordings, diagnosis
    )
    assert sum(line.startswith("checked: ") for line in lines) == 2, lines
    written = read_baseline(folder / "m.toml")
    assert written.effects["input_delay"]["delay"] == pytest.approx(0.04, abs=1e-3)
    assert written.effects["coulomb_friction"]["left"] == pytest.approx(0.10, abs=2e-3)
    assert error_as_given(written, recordings) == pytest.approx(diagnosis.fit.model_rmse, rel=0.05)
    assert diagnosis.fit.model_rmse < 0.002


def test_effects_of_the_baseline_are_refitted_reported_and_exported(tmp_path: Path) -> None:
    recordings = robot(ALREADY)
    diagnosis = diagnose(recordings)
    assert diagnosis.verdict == "parameters_only"
    check_delay_and_friction(recordings, diagnosis, tmp_path)


def test_effects_of_another_simulator_are_refitted_reported_and_exported(tmp_path: Path) -> None:
    recordings = robot({})
    options = simulator_output(tmp_path / "sim", Truth(friction=0.03, breakaway=0.03, delay=0.01, tau=0.35))
    diagnosis = diagnose(recordings, options)
    assert diagnosis.verdict == "parameters_only"
    check_delay_and_friction(recordings, diagnosis, tmp_path)


def test_a_delay_that_the_simulator_has_is_not_the_robots(tmp_path: Path) -> None:
    # The baseline says 10 ms; the simulator itself has the robot's 40 ms, and everything else as well.
    recordings = robot(ALREADY)
    diagnosis = diagnose(recordings, simulator_output(tmp_path / "sim", replace(REAL, gain=1.40)))
    given = {(entry.wheel, entry.name): entry.given for entry in diagnosis.numbers}
    assert given["left", "gain_mps"] == pytest.approx(1.40, rel=0.01)
    assert diagnosis.fit.refit_rmse < 0.002
    (said,) = [check.text for check in diagnosis.checks if check.topic == "simulator"]
    assert "reproduced to 0.00" in said
    assert recordings.baseline is not None
    assert corrected_model(diagnosis, recordings.baseline).model.left.delay_s == pytest.approx(0.04, abs=1e-3)


def delay(value_s: float) -> dict[str, EffectParameter]:
    return {"delay": EffectParameter(value_s, (value_s, value_s), "s")}


def test_what_the_simulator_holds_takes_the_simulators_numbers() -> None:
    baseline = robot(ALREADY).baseline
    assert baseline is not None
    found = Diagnosis("sim", "parameters_only", (), FitErrors(0.1, 0.01, 0.01, 0.01))
    moved, _ = equivalent_baseline(baseline, replace(found, baseline_effects={"input_delay": delay(0.04)}))
    assert moved.effects["input_delay"]["delay"] == 0.04


@pytest.mark.parametrize("verdict", ["missing_physics", "ambiguous", "partly_explained"])
def test_what_the_simulator_likeliest_has_is_not_the_robots(verdict: str) -> None:
    baseline = robot({}).baseline
    assert baseline is not None
    lag = {"time_constant": EffectParameter(0.04, (0.03, 0.05), "s")}
    effects = (
        NamedEffect("input_delay", "body", delay(0.04), 0.6, 0.1, 0.01),
        NamedEffect("driver_lag", "body", lag, 0.4, 0.1, 0.01, explanation=1),
    )
    named = effects if verdict == "ambiguous" else effects[:1]
    found = Diagnosis("sim", verdict, (), FitErrors(0.1, 0.05, 0.01, 0.01), effects=named)  # type: ignore[arg-type]
    moved, _ = equivalent_baseline(baseline, found)
    assert set(moved.effects) == {"input_delay"}
    assert moved.effects["input_delay"]["delay"] == 0.04
