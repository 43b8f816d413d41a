"""A robot as recorders of robot teams see it: friction, delay, and a speed renewed at every eighth row only.

Its physics is written out here: a first-order wheel with dry friction behind a delay, in steps of 1 ms.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from truing.arrays import FloatArray
from truing.diagnose.data.recorder_report import recorded_signals
from truing.diagnose.data.set_data import set_data
from truing.diagnose.engine import diagnose
from truing.diagnose.present.corrected_model import corrected_model
from truing.diagnose.result import NAMING, Diagnosis
from truing.recording.baseline import Baseline, WheelModel
from truing.recording.run import RecordingSet, Run

GAIN_MPS, TAU_S, FRICTION, DELAY_S = 5.0, 0.18, 0.06, 0.06
ROW_S, HELD_ROWS, NOISE_MPS = 0.005, 8, 0.004


def driven(effort: FloatArray, friction: float, gain_mps: float) -> FloatArray:
    """Speed of one wheel at every row of an effort given per row, m/s."""
    per_row = round(ROW_S * 1000)
    fine = np.repeat(effort, per_row)
    fine = np.concatenate((np.zeros(round(DELAY_S * 1000)), fine))[: len(fine)]
    speed, out = 0.0, np.zeros(len(fine))
    for k, u in enumerate(fine):
        if speed == 0.0 and abs(u) <= friction:
            continue
        sign = np.sign(speed) if speed != 0.0 else np.sign(u)
        after = speed + (gain_mps * (u - friction * sign) - speed) * 0.001 / TAU_S
        speed = 0.0 if speed != 0.0 and after * speed < 0.0 and abs(u) <= friction else after
        out[k] = speed
    return out[per_row - 1 :: per_row]


def run(name: str, effort: FloatArray, random: np.random.Generator) -> Run:
    """Both wheels under one effort, their speeds measured at every eighth row and held between."""
    columns = {"t_s": np.arange(len(effort)) * ROW_S}
    for side, friction, gain in (("left", FRICTION, GAIN_MPS), ("right", 1.2 * FRICTION, 0.97 * GAIN_MPS)):
        speed = driven(effort, friction, gain)
        measured = speed + random.normal(size=len(speed)) * NOISE_MPS * (speed != 0.0)
        columns[f"effort_{side}"] = effort
        columns[f"vel_{side}_mps"] = measured[np.arange(len(effort)) // HELD_ROWS * HELD_ROWS]
    return Run(name, columns)


@pytest.fixture(scope="module")
def recordings() -> RecordingSet:
    """Ramps and steps both ways, with a baseline without friction and delay."""
    random = np.random.default_rng(11)
    ramp = np.minimum(0.021 * np.arange(round(10.0 / ROW_S)) * ROW_S, 1.0)
    step = np.where(np.arange(round(3.0 / ROW_S)) * ROW_S < 0.05, 0.0, 0.5)
    efforts = {"01_ramp": ramp, "02_ramp_back": -ramp, "03_step": step, "04_step_back": -step}
    runs = tuple(run(name, effort, random) for name, effort in efforts.items())
    wheel = WheelModel(4.2, 0.3)
    return RecordingSet("team", runs, Baseline(Path("baseline.toml"), wheel, wheel))


@pytest.fixture(scope="module")
def found(recordings: RecordingSet) -> Diagnosis:
    """The first diagnosis."""
    return diagnose(recordings)


def test_friction_and_lateness_are_named(found: Diagnosis) -> None:
    names = {effect.name for effect in found.effects}
    assert found.verdict in NAMING
    assert names & {"coulomb_friction", "stribeck_friction", "driver_deadband"}
    assert names & {"input_delay", "driver_lag", "speed_filter"}


def test_free_run_errors_are_in_order(found: Diagnosis) -> None:
    fit = found.fit
    assert fit.noise_floor <= fit.model_rmse <= fit.refit_rmse <= fit.baseline_rmse
    assert fit.heldout_model_rmse < 0.2 * fit.heldout_refit_rmse
    assert fit.model_rmse < 0.02 * GAIN_MPS


def test_every_named_effects_interval_excludes_that_it_is_absent(found: Diagnosis) -> None:
    for effect in found.effects:
        assert any(not value.ci95[0] <= 0.0 <= value.ci95[1] for value in effect.parameters.values())


def test_the_recorder_is_described(found: Diagnosis) -> None:
    for side in ("left", "right"):
        signal = found.recorder[f"speed_{side}"]
        np.testing.assert_allclose(signal.updated_every_s, HELD_ROWS * ROW_S, rtol=0.01)


def test_the_corrected_model_has_the_claimed_error(recordings: RecordingSet, found: Diagnosis) -> None:
    assert recordings.baseline is not None
    corrected = corrected_model(found, recordings.baseline).baseline
    again = diagnose(replace(recordings, baseline=corrected))
    np.testing.assert_allclose(again.fit.baseline_rmse, found.fit.model_rmse, rtol=0.02)


def test_effects_that_the_baseline_already_holds_are_refitted_and_exported(recordings: RecordingSet) -> None:
    assert recordings.baseline is not None
    held = {"coulomb_friction": {"left": 0.02, "right": 0.02}, "input_delay": {"delay": 0.01}}
    old = replace(recordings.baseline, effects=held)
    second = diagnose(replace(recordings, baseline=old))
    friction = second.baseline_effects["coulomb_friction"]
    np.testing.assert_allclose(friction["left"].value, FRICTION, rtol=0.15)
    np.testing.assert_allclose(friction["right"].value, 1.2 * FRICTION, rtol=0.15)
    corrected = corrected_model(second, old).baseline
    assert corrected.effects["coulomb_friction"]["left"] == friction["left"].value
    again = diagnose(replace(recordings, baseline=corrected))
    np.testing.assert_allclose(again.fit.baseline_rmse, second.fit.model_rmse, rtol=0.02)


def test_a_speed_that_comes_late_against_its_positions_is_measured_so() -> None:
    random = np.random.default_rng(3)
    effort = np.where(np.arange(1200) % 400 < 200, 0.5, 0.1)
    one = run("late", effort, random)
    rows = 12  # 60 ms
    early = {
        f"pos_{side}_m": np.cumsum(np.append(one.columns[f"vel_{side}_mps"][rows:], np.zeros(rows))) * ROW_S
        for side in ("left", "right")
    }
    late = replace(one, columns=one.columns | early)
    wheel = WheelModel(GAIN_MPS, TAU_S)
    data = set_data(RecordingSet("late", (late,), Baseline(Path("baseline.toml"), wheel, wheel)))
    signals = recorded_signals(RecordingSet("late", (late,)), data)
    np.testing.assert_allclose(signals["speed_left"].late_s, rows * ROW_S, atol=0.011)
