"""A wheel's physics from its log: what is recovered, how well, and what is said when it cannot be."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest

from support.synthetic_wheel import Truth, baseline, record, staircase
from truing.errors import IdentifyError
from truing.identify.grey_box import fit_wheel
from truing.identify.model_error import FreeRunError, OneStepError
from truing.identify.signals import wheel_signal
from truing.identify.simulate import simulate
from truing.recording.run import Run

TRUTH = Truth(gain=1.45, tau=0.32, delay=0.043, friction=0.04, breakaway=0.04, disturbance=0.008)
KNOWN = {"gain_mps": 1.45, "time_constant_s": 0.32, "delay_s": 0.043, "friction": 0.04}


@cache
def runs(counts_per_rev: float, seed: int, count: int = 4, truth: Truth = TRUTH) -> tuple[Run, ...]:
    return tuple(
        record(
            truth,
            staircase(100 * seed + k),
            counts_per_rev=counts_per_rev,
            seed=100 * seed + k,
            name=f"{k:02d}",
            fine_s=5e-4,
        )
        for k in range(count)
    )


def equation_error_time_constant(recorded: Sequence[Run], counts_per_rev: float) -> float:
    """SysId's way: acceleration by differences, regressed on speed, effort and sign."""
    rows, targets = [], []
    for run in recorded:
        v = run.speed("left", baseline(counts_per_rev)).values
        u = run.effort("left")
        moving = np.abs(v[1:-1]) > 0.05
        rows.append(np.column_stack((v[1:-1], u[1:-1], np.sign(v[1:-1])))[moving])
        targets.append(((v[2:] - v[:-2]) / 0.1)[moving])
    solution, *_ = np.linalg.lstsq(np.concatenate(rows), np.concatenate(targets), rcond=None)
    return float(-1.0 / solution[0])


@pytest.mark.slow
@pytest.mark.parametrize("counts_per_rev", [64.0, 2400.0])
def test_intervals_hold_the_truth_under_quantisation_and_a_disturbance_with_memory(
    counts_per_rev: float,
) -> None:
    inside = total = 0
    for seed in range(12):
        fit = fit_wheel(runs(counts_per_rev, seed), "left", "delay", baseline(counts_per_rev), hold_out=False)
        for name, truth in KNOWN.items():
            quantity = fit.parameters[name]
            assert quantity.ci95 is not None
            assert quantity.ci95[0] < quantity.ci95[1]
            inside += quantity.ci95[0] <= truth <= quantity.ci95[1]
            total += 1
    # 48 draws at a true 95 %: fewer than 41 inside happens once in a hundred times.
    assert inside >= 41, f"{inside} of {total}"


@pytest.mark.parametrize("counts_per_rev", [64.0, 2400.0])
def test_a_delay_is_found_between_the_samples_of_a_20_hz_log(counts_per_rev: float) -> None:
    fit = fit_wheel(runs(counts_per_rev, 1), "left", "delay", baseline(counts_per_rev), hold_out=False)
    assert fit.physics.delay_s == pytest.approx(0.043, abs=0.005)


def test_equation_error_lies_about_the_time_constant_and_simulation_error_does_not() -> None:
    for counts_per_rev in (64.0, 20_000.0):
        recorded = runs(counts_per_rev, 2)
        fit = fit_wheel(recorded, "left", "delay", baseline(counts_per_rev), hold_out=False)
        assert fit.physics.time_constant_s == pytest.approx(0.32, rel=0.04)
        assert equation_error_time_constant(recorded, counts_per_rev) > 1.15 * 0.32


def test_free_run_error_on_left_out_runs_is_near_the_noise_and_says_what_it_is() -> None:
    fit = fit_wheel(runs(2400.0, 3), "left", "delay", baseline(2400.0))
    assert isinstance(fit.free_run, FreeRunError)
    assert not isinstance(fit.free_run, OneStepError)
    assert fit.held_out is not None
    assert fit.held_out.held_out
    assert set(fit.held_out.by_run_mps) == {"00", "01", "02", "03"}
    assert fit.free_run.percent <= fit.held_out.percent < 1.1 * fit.free_run.percent


def test_friction_left_out_shows_in_the_free_run_error() -> None:
    recorded, base = runs(2400.0, 3), baseline(2400.0)
    linear, friction, delay = (
        fit_wheel(recorded, "left", name, base, hold_out=False).free_run.percent
        for name in ("linear", "friction", "delay")
    )
    assert linear > 1.2 * friction
    assert friction > 2.0 * delay


def test_breakaway_above_running_friction_is_told_apart() -> None:
    truth = Truth(friction=0.03, breakaway=0.09, disturbance=0.001)
    # Slow ramps through zero are what shows it.
    ramp = [(0.01 * k, 0.2 * float(np.sin(2.0 * np.pi * 0.01 * k / 6.0))) for k in range(1500)]
    recorded = [record(truth, ramp, seed=k, name=str(k), fine_s=5e-4) for k in range(2)]
    fit = fit_wheel(recorded, "left", "breakaway", baseline(), hold_out=False)
    assert fit.physics.friction == pytest.approx(0.03, abs=0.004)
    assert fit.physics.breakaway_excess == pytest.approx(0.06, abs=0.006)


def test_a_recorder_that_filters_the_speed_is_told_from_a_slow_wheel() -> None:
    run = runs(1e6, 5, 1)[0]
    speed = run.speed("left", baseline(1e6)).values
    filtered = np.zeros_like(speed)
    keep = np.exp(-0.05 / 0.12)
    for k in range(1, len(speed)):
        filtered[k] = keep * filtered[k - 1] + (1.0 - keep) * speed[k]
    columns = {name: run.columns[name] for name in ("t_s", "effort_left", "effort_right")}
    columns |= {"vel_left_mps": filtered, "vel_right_mps": filtered}
    fit = fit_wheel([Run("filtered", columns)], "left", "recorder_lag", hold_out=False)
    assert fit.physics.time_constant_s == pytest.approx(0.32, rel=0.1)
    assert fit.physics.recorder_lag_s == pytest.approx(0.12, rel=0.25)


def test_gaps_and_uneven_rows_do_not_move_the_answer() -> None:
    whole = runs(2400.0, 6)
    rng = np.random.default_rng(6)
    torn = []
    for run in whole:
        keep = np.ones(len(run), dtype=bool)
        keep[90:130] = False
        columns = {name: values[keep] for name, values in run.columns.items()}
        # A dropped row here and there: the next row's effort is then the mean over both intervals.
        drop = np.sort(rng.choice(np.arange(20, keep.sum() - 20, 3), 12, replace=False))
        for side in ("left", "right"):
            effort = columns[f"effort_{side}"].copy()
            effort[drop + 1] = 0.5 * (effort[drop] + effort[drop + 1])
            columns[f"effort_{side}"] = effort
        torn.append(Run(run.name, {name: np.delete(values, drop) for name, values in columns.items()}))
    reference = fit_wheel(whole, "left", "delay", baseline(), hold_out=False).physics
    fit = fit_wheel(torn, "left", "delay", baseline(), hold_out=False)
    assert fit.signal.excitation.segments == 8
    assert fit.physics.gain_mps == pytest.approx(reference.gain_mps, rel=0.02)
    assert fit.physics.time_constant_s == pytest.approx(reference.time_constant_s, rel=0.04)
    assert fit.physics.delay_s == pytest.approx(reference.delay_s, abs=0.006)


def test_a_model_simulates_a_run_that_it_never_saw() -> None:
    recorded, base = runs(2400.0, 7), baseline(2400.0)
    fit = fit_wheel(recorded[:3], "left", "delay", base, hold_out=False)
    unseen = simulate(fit.physics, recorded[3], "left", base)
    assert unseen.error.rms_mps < 1.3 * fit.free_run.rms_mps
    assert len(unseen.t_s) == len(unseen.speed_mps) == len(recorded[3]) - 1


def test_an_encoder_wired_backwards_is_said() -> None:
    run = runs(2400.0, 8, 1)[0]
    columns = dict(run.columns) | {"ticks_left": -run.columns["ticks_left"]}
    fit = fit_wheel([Run("backwards", columns)], "left", "linear", baseline(), hold_out=False)
    assert fit.physics.gain_mps < 0.0
    assert any("opposite signs" in note for note in fit.notes)


def test_what_the_runs_cannot_tell_is_unknown_and_not_a_number() -> None:
    truth = Truth()
    forward = [(0.0, 0.0), (0.5, 0.3), (3.0, 0.5), (6.0, 0.2), (9.0, 0.0)]
    recorded = [record(truth, forward, seed=k, name=str(k), fine_s=5e-4) for k in range(2)]
    fit = fit_wheel(recorded, "left", "asymmetric", baseline(), hold_out=False)
    assert fit.parameters["reverse_gain"].value is None
    assert fit.parameters["reverse_gain"].reason
    assert fit.parameters["gain_mps"].value == pytest.approx(1.45, rel=0.02)


@pytest.mark.parametrize("what", ["effort", "speed"])
def test_a_recording_without_excitation_is_refused_with_a_reason(what: str) -> None:
    run = runs(2400.0, 8, 1)[0]
    columns = dict(run.columns)
    columns["effort_left" if what == "effort" else "ticks_left"] = np.zeros(len(run))
    with pytest.raises(IdentifyError, match="never changes"):
        fit_wheel([Run("still", columns)], "left", "delay", baseline())


def test_resting_wheels_start_at_rest_and_moving_ones_get_a_speed_of_their_own() -> None:
    run = runs(2400.0, 9, 1)[0]
    begin = int(np.argmax(np.abs(run.speed("left", baseline()).values) > 0.2)) + 3
    columns = {name: values[begin:] for name, values in run.columns.items()}
    columns["t_s"] = columns["t_s"] - columns["t_s"][0]
    moving = Run("moving", columns)
    signal = wheel_signal([run, moving], "left", baseline())
    assert abs(signal.speed_mps[signal.excitation.starts[1]]) > 0.05
    fit = fit_wheel([run, moving], "left", "delay", baseline(), hold_out=False)
    assert fit.predicted_mps[0] == 0.0
    assert fit.free_run.by_run_mps["moving"] < 1.5 * fit.free_run.by_run_mps[run.name]
