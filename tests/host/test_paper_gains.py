"""The printed effort gains: what each piece of physics explains of them, and what nothing does."""

from __future__ import annotations

import numpy as np
import pytest

from truing.studies.bakirci_gains import (
    LADDER,
    OWN_CURRENT,
    GainStudy,
    GainTable,
    fit_rung,
    predict,
    printed_gains,
    settling_remainder,
    study_gains,
)


@pytest.fixture(scope="module")
def study() -> GainStudy:
    return study_gains()


def made_up(rung_number: int, theta: list[float]) -> GainTable:
    """The paper's levels with the gains of a known robot."""
    table = printed_gains()
    gain = predict(LADDER[rung_number], np.array(theta), table)
    return GainTable(table.tests, table.pivots, table.effort, table.previous, gain, table.tau_s)


def test_the_paper_prints_twenty_two_effort_gains_in_nine_tests(study: GainStudy) -> None:
    assert len(study.table) == 22
    assert len(set(study.table.tests)) == 9
    assert study.table.gain[list(study.fifteen.values())].tolist() == [9.132, 12.131, 13.338]


@pytest.mark.parametrize(
    ("number", "theta"),
    [
        (0, [14.0]),
        (1, [15.0, 0.03]),
        (2, [15.0, 0.02, 0.03]),
        (3, [16.0, 0.03, 0.02, 0.06]),
        (4, [16.0, 0.03, 0.02, 0.06, 0.04]),
        (5, [16.0, 0.02, 0.015, 0.04, 0.02, 0.006, 0.08]),
    ],
)
def test_a_robot_that_is_made_of_a_rungs_physics_is_recovered_by_it(number: int, theta: list[float]) -> None:
    table = made_up(number, theta)
    fit = fit_rung(LADDER[number], table)
    assert fit.worst < 2e-4
    if number < 5:  # friction that falls is told by the 15 % levels alone: its shape stays loose
        assert fit.theta == pytest.approx(theta, rel=0.02)
        assert np.abs(fit.left_out).max() < 2e-3


def test_a_steady_speed_balances_drive_supply_and_friction() -> None:
    """v = G (u (1 - d n u) - f - s - a exp((0.2 - v)/w)), in m/s with G in m/s per unit effort."""
    theta = np.array([15.0, 0.02, 0.015, 0.05, 0.0, 0.006, 0.08])
    table = printed_gains()
    gain = predict(LADDER[5], theta, table)
    u, n = table.effort, np.where(table.pivots, 1.0, 2.0)
    v = 0.1 * gain * u
    friction = 0.02 + 0.015 * table.pivots + 0.006 * np.exp((0.2 - v) / 0.08)
    np.testing.assert_allclose(v, 1.5 * (u * (1 - 0.05 * n * u) - friction), atol=1e-9)


def test_friction_then_scrub_then_supply_each_lower_the_error(study: GainStudy) -> None:
    means = [fit.mean for fit in study.ladder]
    print([f"{100 * fit.mean:.1f}/{100 * fit.worst:.1f}" for fit in study.ladder])
    assert means[0] == pytest.approx(0.073, abs=0.001)
    assert study.ladder[0].worst == pytest.approx(0.489, abs=0.001)
    assert means[0] > means[1] > means[2] > means[3]
    assert study.ladder[3].mean <= 0.02
    assert study.ladder[3].worst <= 0.06


def test_explanations_hold_on_tests_that_were_left_out_but_test_i_stays_hard(study: GainStudy) -> None:
    linear, best = study.ladder[0], study.best
    assert best.left_out_mean < 0.5 * linear.left_out_mean
    for fit in (*study.ladder, *study.alternatives):
        assert study.table.tests[fit.left_out_row] == "I"
        assert abs(fit.left_out[fit.left_out_row]) > 0.15


def test_no_model_without_memory_can_tell_the_two_straight_readings_at_fifteen_apart(
    study: GainStudy,
) -> None:
    _, rising, falling = study.fifteen.values()
    for fit in study.ladder:
        same = fit.predicted[rising] == pytest.approx(fit.predicted[falling], rel=1e-12)
        assert same == ("remainder" not in fit.rung.parameters)
    _, worst = study.static_floor
    for fit in study.ladder[:4]:
        assert fit.worst >= worst
    # The smallest relative error of one number for 12.131 and 13.338, weighted as the fit weighs them.
    assert worst == pytest.approx(12.6774 / 12.131 - 1.0, abs=0.006)


def test_what_contradicts_every_rung_is_listed(study: GainStudy) -> None:
    left = [study.table.label(row) for row in study.unexplained(study.best)]
    assert "III, 45% from rest, pivoting" in left
    assert "XVII, 30% down from 40%" in left
    assert [study.table.label(row) for row, _ in study.backward] == ["III, 45% from rest, pivoting"]


def test_a_supply_drop_by_frictions_own_current_would_need_more_than_a_battery_has(study: GainStudy) -> None:
    own = next(fit for fit in study.alternatives if fit.rung is OWN_CURRENT)
    assert own.at_bound == ("drop",)
    assert study.drop_beyond_friction > 1.0


def test_intervals_of_a_rung_hold_the_truth_as_often_as_they_say() -> None:
    """Gains of a known robot, each test with an error of its own and each level with another."""
    truth = [15.0, 0.03, 0.03]
    table = made_up(2, truth)
    rng = np.random.default_rng(5)
    tests = sorted(set(table.tests))
    held = np.zeros(3)
    repeats = 60
    for _ in range(repeats):
        shared = dict(zip(tests, rng.normal(0.0, 0.01, len(tests)), strict=True))
        noise = np.array([shared[test] for test in table.tests]) + rng.normal(0.0, 0.01, len(table))
        noisy = GainTable(
            table.tests, table.pivots, table.effort, table.previous, table.gain * (1 + noise), table.tau_s
        )
        fit = fit_rung(LADDER[2], noisy)
        held += [low <= value <= high for (low, high), value in zip(fit.ci95, truth, strict=True)]
    print(f"held: {held / repeats}")
    assert np.all(held / repeats >= 0.85)


def test_the_remainder_of_a_step_is_its_mean_over_the_window() -> None:
    times = np.linspace(1.2, 2.0, 20001)
    for tau in (0.2, 0.6, 1.057):
        mean = float(np.trapezoid(np.exp(-times / tau), times) / 0.8)
        assert settling_remainder(np.array([tau]))[0] == pytest.approx(mean, rel=1e-6)
