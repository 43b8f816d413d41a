"""The wheel's simulation: friction sticks exactly, pieces are solved in closed form, delay is continuous."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from support.synthetic_wheel import Truth, baseline, record, staircase
from truing.identify.signals import wheel_signal
from truing.model.excitation import Excitation, excitation
from truing.model.wheel import MAX_STEP_S, WheelPhysics, simulate_physics

Array = NDArray[np.float64]


def drive(t: Array, effort: Array) -> Excitation:
    starts = np.array([0, len(t)], dtype=np.int64)
    return excitation(t, effort, np.zeros(len(t)), starts, np.array([t[1] - t[0]]))


def run(
    physics: WheelPhysics, t: Array, effort: Array, v0: float = 0.0, max_step_s: float = MAX_STEP_S
) -> tuple[Array, Array]:
    response = simulate_physics(physics.to_vector(), drive(t, effort), np.array([v0]), max_step_s)
    return response.speed_mps, response.travel_m


def test_a_wheel_pushed_less_than_its_friction_stays_exactly_at_rest() -> None:
    t = np.arange(0.0, 5.0, 0.05)
    speed, travel = run(WheelPhysics(1.4, 0.3, friction=0.05), t, 0.0499 * np.sin(3.0 * t))
    assert np.all(speed == 0.0)
    assert np.all(travel == 0.0)


def test_a_coasting_wheel_stops_when_the_closed_form_says_and_stays() -> None:
    gain, tau, friction, v0 = 1.4, 0.3, 0.05, 0.6
    stop = tau * np.log(1.0 + v0 / (gain * friction))
    t = np.arange(0.0, 2.0, 0.05)
    physics = WheelPhysics(gain, tau, friction=friction)
    speed, travel = run(physics, t, np.zeros_like(t), v0)
    assert np.all(speed[t > stop + 0.05] == 0.0)
    assert speed[np.searchsorted(t, stop)] > 0.0
    # Integrating tau dv/dt = -v - gain friction from v0 to 0 gives the distance to the stop.
    distance = tau * v0 - gain * friction * stop
    assert travel[-1] == pytest.approx(distance, abs=1e-12)


def test_breakaway_holds_a_wheel_that_running_friction_would_let_go() -> None:
    t = np.arange(0.0, 4.0, 0.02)
    physics = WheelPhysics(1.4, 0.1, friction=0.03, breakaway_excess=0.04)
    speed, _ = run(physics, t, np.minimum(0.02 * t, 0.08))
    moving = t[np.argmax(speed > 0.0)]
    assert moving == pytest.approx(0.07 / 0.02, abs=0.03)


def test_the_result_does_not_depend_on_how_often_the_log_looks() -> None:
    physics = WheelPhysics(1.4, 0.25, delay_s=0.0371, friction=0.04, reverse_gain=0.9)
    fine = np.arange(0.0, 6.0 + 1e-9, 0.01)
    effort = 0.4 * np.sign(np.sin(2.0 * np.pi * (np.floor((fine - 1e-9) / 0.1) * 0.1) / 1.6))
    effort[fine < 0.3 - 1e-9] = 0.0
    effort[30] = 0.0
    _, travel = run(physics, fine, effort)
    # The same staircase, logged at every tenth row: it changes at those rows only.
    _, coarse = run(physics, fine[::10], effort[::10])
    np.testing.assert_allclose(coarse, travel[::10], atol=1e-9)
    uneven = np.unique(np.concatenate((fine[::10], fine[33::37])))
    at = np.searchsorted(fine[::10], uneven - 1e-12)
    _, odd = run(physics, uneven, effort[::10][np.minimum(at, len(fine[::10]) - 1)])
    np.testing.assert_allclose(odd[np.isin(uneven, fine[::10])], coarse, atol=1e-9)


def test_the_simulation_is_continuous_in_the_delay_between_samples() -> None:
    t = np.arange(0.0, 3.0, 0.05)
    effort = np.where((t > 0.5) & (t < 2.0), 0.5, 0.0)
    delays = np.arange(0.02, 0.08, 1e-4)
    ends = np.array([run(WheelPhysics(1.4, 0.2, delay_s=d, friction=0.03), t, effort)[1][25] for d in delays])
    steps = np.diff(ends) / 1e-4
    assert np.all(steps < 0.0)
    assert np.max(np.abs(np.diff(steps))) < 1e-4 * abs(steps.mean())


def test_halving_the_step_of_speed_dependent_friction_moves_nothing() -> None:
    t = np.arange(0.0, 8.0, 0.05)
    effort = 0.25 * np.sin(2.0 * np.pi * t / 3.0)
    physics = WheelPhysics(1.4, 0.3, friction=0.03, breakaway_excess=0.03, stribeck_mps=0.05, drag=0.1)
    coarse, _ = run(physics, t, effort)
    half, _ = run(physics, t, effort, max_step_s=1.25e-3)
    assert np.max(np.abs(coarse - half)) < 1e-4


@pytest.mark.parametrize("name", ["recorder_lag_s", "recorder_window_s"])
def test_a_recorders_filter_delays_the_reported_speed_and_not_the_travel(name: str) -> None:
    t = np.arange(0.0, 4.0, 0.02)
    effort = np.where(t > 0.5, 0.5, 0.0)
    plain = WheelPhysics(1.4, 0.2)
    filtered = WheelPhysics(1.4, 0.2, **{name: 0.1})
    speed, travel = run(plain, t, effort)
    reported, same_travel = run(filtered, t, effort)
    np.testing.assert_allclose(same_travel, travel, atol=1e-12)
    lag = np.sum(speed - reported) * 0.02 / speed[-1]
    # A first-order filter lags by its time constant; a mean over 0.1 s by half of that, against a
    # mean over the interval by half an interval less.
    expected = 0.1 if name == "recorder_lag_s" else 0.05 - 0.01
    assert lag == pytest.approx(expected, rel=0.02)


def test_a_lag_ahead_of_the_motor_gives_the_two_pole_step_response() -> None:
    t = np.arange(0.0, 2.0, 0.01)
    _, travel = run(WheelPhysics(2.0, 0.3, lag_s=0.05), t, np.where(t > 0.0, 0.5, 0.0))
    time = t[-1]
    expected = time - 0.35 + (0.09 * np.exp(-time / 0.3) - 0.0025 * np.exp(-time / 0.05)) / 0.25
    assert travel[-1] == pytest.approx(expected, abs=2e-5)


def test_the_kernel_agrees_with_a_wheel_integrated_in_tiny_steps() -> None:
    truth = Truth(gain=1.3, tau=0.27, delay=0.031, friction=0.05, breakaway=0.05, reverse_gain=0.9)
    recorded = record(truth, staircase(4), counts_per_rev=1e7, fine_s=1e-4)
    signal = wheel_signal([recorded], "left", baseline(1e7))
    physics = WheelPhysics(1.3, 0.27, delay_s=0.031, friction=0.05, reverse_gain=0.9)
    speed = simulate_physics(physics.to_vector(), signal.excitation, np.zeros(1)).speed_mps
    assert np.sqrt(np.mean((speed - signal.speed_mps)[1:] ** 2)) < 5e-4


def test_a_gap_starts_afresh_and_its_rows_judge_nothing() -> None:
    recorded = record(Truth(), staircase(1), drop_rows=(100, 140))
    signal = wheel_signal([recorded], "left", baseline())
    assert signal.excitation.segments == 2
    assert signal.excitation.starts[1] == 100
    assert not signal.counted[100]
    assert signal.counted[101]


def test_an_edge_inside_an_interval_is_found_from_the_mean_effort() -> None:
    t = np.arange(0.0, 1.0, 0.05)
    effort = np.where(t > 0.42, 0.6, 0.0)
    effort[9] = 0.6 * 0.3  # the step came 70 % into the interval 0.40 .. 0.45
    pieces = drive(t, effort).pieces
    row = np.flatnonzero(pieces.effort == 0.6)[0]
    assert pieces.end_s[row - 1] == pytest.approx(0.435)


def test_a_ramp_is_not_taken_for_edges() -> None:
    t = np.arange(0.0, 1.0, 0.05)
    assert len(drive(t, 0.3 * t).pieces.effort) == len(t)
