"""95 % intervals hold the true numbers, also where a misfit is flat or has corners."""

from __future__ import annotations

import numpy as np
import pytest

from support.simulated_runs import RICH, levels, noisy_robot
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
