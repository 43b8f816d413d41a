"""95 % intervals hold the true numbers, also where a misfit is flat or has corners."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from support.simulated_runs import RICH, TAU, levels, noisy_robot
from truing.diagnose.data.set_data import SetData
from truing.diagnose.engine import initial_fit, noise_from_fit
from truing.diagnose.fit import Fit, fit
from truing.diagnose.intervals import covariance, effect_parameters
from truing.diagnose.problem import Problem
from truing.diagnose.result import EffectParameter
from truing.diagnose.simulation.simulator import SetSimulator

NOISE_MPS = 0.004
EIGHT_RUNS = tuple(0.05 * k + (1.0 - 0.1 * k) * run for k in range(4) for run in RICH)
# A long rest in the middle: the time in it at which a load was put down is not identifiable.
RESTING = (*EIGHT_RUNS[:4], levels((0.0, 0.0), seconds=8.0), *EIGHT_RUNS[4:])


def robot(efforts: tuple[np.ndarray, ...], effect: str, numbers: dict[str, float], seed: int) -> SetData:
    return noisy_robot(efforts, {effect: numbers}, NOISE_MPS, seed)


def fitted(data: SetData, effect: str, near: dict[str, float]) -> tuple[Problem, Fit]:
    """The effect, fitted from near the truth, under the noise that it leaves."""
    stage = initial_fit(data, SetSimulator(data))
    start = stage.base.theta.copy()
    for name, value in near.items():
        start[stage.problem.simulator.layout.index(f"{effect}.{name}")] = value
    first = fit(stage.problem, (effect,), start)
    problem = stage.problem.with_noise(noise_from_fit(stage.problem, first))
    return problem, fit(problem, (effect,), first.theta)


def intervals(data: SetData, effect: str, near: dict[str, float]) -> dict[str, EffectParameter]:
    problem, done = fitted(data, effect, near)
    return effect_parameters(problem, done, effect, covariance(problem, done))


def holds(number: EffectParameter, value: float) -> bool:
    return number.ci95[0] <= value <= number.ci95[1]


@pytest.mark.slow
def test_intervals_of_a_true_equation_hold_its_numbers() -> None:
    true = {"left": 0.03, "right": 0.04}
    inside, widths = [], []
    for seed in range(12):
        found = intervals(robot(EIGHT_RUNS, "coulomb_friction", true, seed), "coulomb_friction", true)
        inside += [holds(found[wheel], value) for wheel, value in true.items()]
        widths.append(found["left"].ci95[1] - found["left"].ci95[0])
    assert np.mean(inside) >= 0.9
    assert np.median(widths) < 0.01, "an interval that holds everything is not informative"


def test_a_moment_that_lies_in_a_rest_may_be_anywhere_in_it() -> None:
    data = robot(RESTING, "payload_change", {"time_constant_ratio": 1.4, "at": 0.5}, 1)
    rests = [k for k in range(data.runs) if not data.effort[data.rows_of(k)].any()]
    rows = np.flatnonzero(data.rows_of(rests[0]))
    begins, ends = data.elapsed_s[rows[0]], data.elapsed_s[rows[-1]]
    at = intervals(data, "payload_change", {"time_constant_ratio": 1.3, "at": 0.5})["at"]
    assert at.ci95[0] < begins + 1.0
    assert at.ci95[1] > ends - 1.0


def test_a_moment_that_lies_in_motion_lies_between_the_next_of_the_grid() -> None:
    """Where the error has no slope by the moment, values beside it are tried; it was half of the set once."""
    data = robot(EIGHT_RUNS, "payload_change", {"time_constant_ratio": 1.4, "at": 0.53}, 1)
    at = intervals(data, "payload_change", {"time_constant_ratio": 1.3, "at": 0.52})["at"]
    duration_s = float(data.elapsed_s[-1])
    assert holds(at, 0.53 * duration_s)
    assert at.ci95[1] - at.ci95[0] < 0.17 * duration_s


def test_a_parameter_at_its_bound_adds_no_uncertainty_to_the_others() -> None:
    """A filter of no length has the derivative of a delay: together they were uncertain by 20 s."""
    stage = initial_fit(*delayed())
    start = stage.base.theta.copy()
    start[stage.problem.simulator.layout.index("input_delay.delay")] = 0.06
    lag_s = stage.problem.simulator.layout.index("driver_lag.time_constant")
    held = tuple(
        replace(one, upper=0.0) if lag_s in one.entries else one
        for one in stage.problem.columns_of(("input_delay", "driver_lag"))
    )
    done = fit(stage.problem, ("input_delay", "driver_lag"), start, columns=held)
    spread = covariance(stage.problem, done)
    lag = effect_parameters(stage.problem, done, "driver_lag", spread)["time_constant"]
    delay = effect_parameters(stage.problem, done, "input_delay", spread)["delay"]
    assert lag.value == 0.0
    assert lag.ci95[1] < 0.05
    assert holds(delay, 0.06)
    assert delay.ci95[1] - delay.ci95[0] < 0.02


def delayed() -> tuple[SetData, SetSimulator]:
    data = robot(EIGHT_RUNS, "input_delay", {"delay": 0.06}, 4)
    return data, SetSimulator(data)


def test_two_lags_of_one_length_are_both_there() -> None:
    """A driver as slow as the wheel: the likelihood is flat in the difference of the two."""
    true = {"time_constant": float(np.mean(TAU))}
    found = intervals(robot(EIGHT_RUNS, "driver_lag", true, 2), "driver_lag", true)["time_constant"]
    assert holds(found, true["time_constant"])
    assert found.ci95[0] > 0.3 * true["time_constant"]


@pytest.mark.parametrize("effect", ["winding_heating", "stribeck_friction", "coast_decay"])
def test_no_interval_leaves_what_is_physically_possible(effect: str) -> None:
    data = robot(EIGHT_RUNS[:4], "coulomb_friction", {"left": 0.03, "right": 0.03}, 1)
    stage = initial_fit(data, SetSimulator(data))
    done = fit(stage.problem, (effect,), stage.base.theta, iterations=2)
    nothing_known = 1e6 * np.eye(done.size)
    found = effect_parameters(stage.problem, done, effect, nothing_known)
    if effect == "winding_heating":
        assert found["thermal_time_constant"].ci95 == (5.0, 2000.0)
    for name, number in found.items():
        assert 0.0 <= number.ci95[0] <= number.value <= number.ci95[1], name
