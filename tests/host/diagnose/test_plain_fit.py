"""Where a model leaves more than noise, its parameters come from plain least squares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from support.simulated_runs import RICH, noisy_robot
from truing.diagnose.engine import initial_fit, investigate
from truing.diagnose.exchanges import best_exchange
from truing.diagnose.fit import Fit, fit
from truing.diagnose.ordered_errors import plain_fit
from truing.diagnose.problem import Problem
from truing.diagnose.simulation.simulator import SetSimulator

NOISE_MPS = 0.004
LEFT_OUT = {"driver_deadband": {"deadband": 0.1}, "quadratic_drag": {"left": 0.3, "right": 0.3}}


@pytest.fixture(scope="module")
def refitted() -> tuple[Problem, Fit]:
    """A baseline that lacks two effects, refitted to recordings with outliers."""
    data = noisy_robot(RICH, LEFT_OUT, NOISE_MPS, 5)
    speeds = data.speed_mps.copy()
    speeds[40::150] += 1.5
    stage = initial_fit(replace(data, speed_mps=speeds), SetSimulator(data, data.baseline))
    return stage.problem, stage.base


def test_a_plain_fit_has_the_smallest_free_run_error(refitted: tuple[Problem, Fit]) -> None:
    problem, base = refitted
    done = plain_fit(problem, base, base)
    smallest = problem.free_run_rmse(done.residual.speeds)
    assert smallest < 0.999 * problem.free_run_rmse(base.residual.speeds)
    for column in done.columns:
        for factor in (0.98, 1.02):
            theta = done.theta.copy()
            theta[list(column.entries)] *= factor
            assert problem.free_run_rmse(problem.residual(theta, ()).speeds) > smallest, column.name


def test_repeated_rows_count_as_long_as_they_stand(refitted: tuple[Problem, Fit]) -> None:
    problem, base = refitted
    stands_for = np.where(np.arange(len(problem.data)) % 2 == 0, 9.0, 1.0)[:, None] * np.ones(2)
    weighted = replace(problem, data=replace(problem.data, stands_for=stands_for))
    once, often = (plain_fit(one, base, base) for one in (problem, weighted))
    errors = [weighted.free_run_rmse(one.residual.speeds) for one in (once, often)]
    assert errors[1] < errors[0]


def test_a_plain_fit_gives_each_wheel_its_own_delay() -> None:
    """Two motor controllers that are asked one after the other."""
    given = {"input_delay": {"delay": 0.06, "difference": 0.05}}
    data = noisy_robot(RICH, given, NOISE_MPS, 7)
    problem = initial_fit(data, SetSimulator(data, data.baseline)).problem
    start = problem.simulator.start()
    start[problem.simulator.layout.index("input_delay.delay")] = 0.04
    weighted = fit(problem, ("input_delay",), start)
    assert "input_delay.difference" not in {column.name for column in weighted.columns}
    done = plain_fit(problem, weighted, weighted)
    assert done.value("input_delay.delay") == pytest.approx(0.06, abs=0.004)
    assert done.value("input_delay.difference") == pytest.approx(0.05, abs=0.008)
    before, after = (problem.free_run_rmse(one.residual.speeds) for one in (weighted, done))
    assert after < 0.9 * before


@pytest.mark.slow
def test_of_models_with_one_effect_exchanged_that_of_the_smaller_error_is_taken() -> None:
    """A lag of the driver in place of the delay is likely where the noise model took the delay for noise."""
    runs = tuple(scale * run for scale in (1.0, 0.8, 0.9) for run in RICH)
    effects = {"driver_deadband": {"deadband": 0.05}, "input_delay": {"delay": 0.08}}
    found = investigate(noisy_robot(runs, effects, NOISE_MPS, 3), lambda _: None, 1)
    assert set(found.best.effects) == set(effects)
    wrong = fit(found.problem, ("driver_deadband", "driver_lag"), found.base.theta)
    assert found.problem.exceeds_noise(wrong.residual.speeds)
    assert set(best_exchange(found.search, wrong).effects) == set(effects)
    assert best_exchange(found.search, found.best) is found.best
