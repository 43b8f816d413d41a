"""Every export behaves on the diagnosed runs as claimed, or says what it leaves out and what that costs."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from support.simulated_runs import RICH, by_run, recording_set, recordings
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.data.traces import RunTraces
from truing.diagnose.present.corrected_model import CorrectedModel, corrected_model
from truing.diagnose.present.export_check import check_baseline, check_format
from truing.diagnose.present.exports import Export, write_exports
from truing.diagnose.result import Diagnosis, EffectParameter, FitErrors, NamedEffect, WheelNumbers
from truing.diagnose.simulation.simulator import SetSimulator
from truing.exporters import exporters
from truing.recording.run import RecordingSet

NOISE_MPS = 0.002
# In the simulator's own numbers. Nuisance parameters are away from where a baseline without them has them.
HIDDEN: dict[str, dict[str, float]] = {
    "coulomb_friction": {"left": 0.05, "right": 0.07},
    "stribeck_friction": {
        "left": 0.03,
        "right": 0.05,
        "excess_left": 0.06,
        "excess_right": 0.08,
        "stribeck": 0.12,
    },
    "turning_scrub": {"scrub": 0.06},
    "quadratic_drag": {"left": 0.15, "right": 0.1},
    "supply_sag": {"drop_at_stall": 0.15, "drop_over_set": 0.08, "back_emf": 0.8},
    "winding_heating": {"gain_drop": 0.1, "thermal_time_constant": 30.0, "slowing": 1.0},
    "input_delay": {"delay": 0.06},
    "driver_lag": {"time_constant": 0.08},
    "driver_deadband": {"deadband": 0.06},
    "current_limit": {"limit": 0.6, "back_emf": 0.8},
    "speed_limit": {"limit": 0.5},
    "direction_asymmetry": {"left": 0.9, "right": 1.1, "by_effort": 1.0},
    "coast_decay": {"release": 0.4},
    "gear_backlash": {"left": 0.08, "right": 0.06, "motor_share": 0.3},
    "torque_ripple": {"sine_left": 0.03, "cosine_left": 0.02, "cosine_right": -0.03, "per_revolution": 4.0},
    "encoder_eccentricity": {"sine_left": 0.05, "cosine_left": -0.04, "cosine_right": 0.06},
    "encoder_dropout": {"left": 0.1, "right": 0.15, "exponent": 3.0},
    "inertia_coupling": {"coupling": 0.2},
    "payload_change": {"time_constant_ratio": 1.3, "at": 0.5},
    "speed_filter": {"time_constant": 0.08},
}
# What a wheel's physics holds, so that the formats that hold all of it lose nothing.
CARRIED = (
    "coulomb_friction",
    "stribeck_friction",
    "quadratic_drag",
    "input_delay",
    "driver_lag",
    "driver_deadband",
    "speed_filter",
)


def diagnosed(effect: str) -> tuple[RecordingSet, Diagnosis]:
    """Recordings of a robot with an effect, and a diagnosis that found it to the last digit."""
    source = "vel" if effect == "speed_filter" else "pos"
    data = recordings(source=source)
    simulator = SetSimulator(data)
    theta = simulator.start()
    for key, value in HIDDEN[effect].items():
        theta[simulator.layout.index(f"{effect}.{key}")] = value
    theta[:4] *= (1.04, 0.95, 0.97, 1.05)
    for _ in range(12):
        # What depends on the wheel's angle needs an angle, which the speeds so far give.
        made = SetSimulator(data).speeds(theta, simulator.enabled([effect]))
        data = recordings(RICH, by_run(data, made), source=source)
    noise = np.random.default_rng(1).normal(0.0, NOISE_MPS, made.shape)
    runs = recording_set(RICH, by_run(data, made + noise), source=source)
    data = recordings(RICH, by_run(data, made + noise), source=source)
    simulator = SetSimulator(data)
    made = simulator.speeds(theta, simulator.enabled([effect]))
    traces = []
    for k, run in enumerate(runs):
        rows = data.rows_of(k)
        shape = made[rows].shape
        counted = data.counted[rows]
        effort, measured = data.effort[rows], data.speed_mps[rows]
        still = np.zeros(shape)
        traces.append(
            RunTraces(run.name, run.t_s, run.t_s, effort, measured, still, still, made[rows], still, counted)
        )
    error = float(np.sqrt(np.mean((data.speed_mps - made)[data.counted] ** 2)))
    reported = simulator.report(effect, theta)
    parameters = {key: EffectParameter(value, (value, value), "1") for key, value in reported.items()}
    names = (
        ("left", "gain_mps"),
        ("left", "time_constant_s"),
        ("right", "gain_mps"),
        ("right", "time_constant_s"),
    )
    numbers = tuple(
        WheelNumbers(wheel, name, "", value, value, EffectParameter(value, (value, value), ""))  # type: ignore[arg-type]
        for (wheel, name), value in zip(names, theta[:4].tolist(), strict=True)
    )
    return runs, Diagnosis(
        "made up",
        "missing_physics",
        tuple(run.name for run in runs),
        FitErrors(0.1, 0.05, error, NOISE_MPS),
        effects=(NamedEffect(effect, "both", parameters, 0.99, 0.05, error),),
        exact={effect: simulator.internal(effect, theta)},
        numbers=numbers,
        traces=tuple(traces),
    )


def corrected(runs: RecordingSet, diagnosis: Diagnosis) -> CorrectedModel:
    assert runs.baseline is not None
    return corrected_model(diagnosis, runs.baseline)


def figures(line: str) -> tuple[float, float]:
    """Found and claimed error of a check's line, mm/s."""
    found, claimed = re.findall(r"([0-9.e+-]+) mm/s", line)
    return float(found), float(claimed)


@pytest.mark.parametrize("effect", sorted(HIDDEN))
def test_the_exported_baseline_has_the_error_that_was_claimed(effect: str) -> None:
    runs, diagnosis = diagnosed(effect)
    text = corrected(runs, diagnosis).to_toml()
    (line,) = check_baseline(text, Path("m.toml"), runs, diagnosis)
    assert line.startswith("checked: toml"), line
    found, claimed = figures(line)
    assert found == pytest.approx(claimed, rel=0.05)
    assert claimed < 2.0 * 1000.0 * NOISE_MPS


@pytest.mark.parametrize("effect", ["stribeck_friction", "torque_ripple", "encoder_dropout"])
def test_a_baseline_without_the_numbers_that_are_not_reported_does_not_pass(effect: str) -> None:
    runs, diagnosis = diagnosed(effect)
    text = corrected(runs, replace(diagnosis, exact={})).to_toml()
    (line,) = check_baseline(text, Path("m.toml"), runs, diagnosis)
    assert line.startswith("WARNING: toml"), line


@pytest.mark.parametrize("effect", sorted(HIDDEN))
@pytest.mark.parametrize("kind", sorted(set(exporters()) - {"toml", "ros2-control"}))
def test_a_format_has_the_claimed_error_or_says_what_it_leaves_out_and_what_that_costs(
    kind: str, effect: str
) -> None:
    runs, diagnosis = diagnosed(effect)
    (line,) = check_format(kind, corrected(runs, diagnosis), diagnosis)
    found, claimed = figures(line)
    if effect in CARRIED and kind in ("fmu", "python", "mat"):
        assert line.startswith("checked"), line
    if line.startswith("checked"):
        assert found == pytest.approx(claimed, rel=0.06)
    else:
        assert " without " in line
        assert found > 1.05 * claimed


def test_an_effect_that_no_format_holds_is_named_with_its_cost(tmp_path: Path) -> None:
    runs, diagnosis = diagnosed("driver_deadband")
    lines = write_exports([Export("mjcf", tmp_path / "m.xml")], runs, diagnosis)
    (warning,) = [line for line in lines if line.startswith("WARNING")]
    assert "without deadband" in warning
    assert figures(warning)[0] > 5.0 * figures(warning)[1]


def test_a_baseline_that_does_not_keep_the_claim_is_not_delivered(tmp_path: Path) -> None:
    runs, diagnosis = diagnosed("stribeck_friction")
    path = tmp_path / "m.toml"
    lines = write_exports([Export("toml", path)], runs, replace(diagnosis, exact={}))
    assert not path.exists()
    assert any(line.startswith("not written") and "claimed" in line for line in lines)


def test_every_internal_number_of_a_table_stands() -> None:
    for name, entry in CATALOGUE.items():
        given = {item.name: item.starts[-1] if item.starts else item.off for item in entry.parameters}
        numbers = {"gain_left": 1.4, "gain_right": 1.5, "tau_left": 0.3, "tau_right": 0.2}
        assert given.items() <= entry.internal(given | numbers).items(), name
