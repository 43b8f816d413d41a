"""Residuals that come and go, beside noise, slow disturbances and a single event."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from truing.arrays import FloatArray
from truing.diagnose.data.set_data import set_data
from truing.diagnose.engine import initial_fit
from truing.diagnose.fit import Fit
from truing.diagnose.intermittent import comes_and_goes
from truing.diagnose.problem import Problem
from truing.diagnose.simulation.simulator import SetSimulator
from truing.recording.baseline import Baseline, WheelModel
from truing.recording.run import RecordingSet, Run

ROWS, ROW_S, RUNS, NOISE_MPS = 300, 0.05, 5, 0.003
T_S = np.arange(ROWS) * ROW_S


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Runs of 15 s at steady and changing efforts, both ways."""
    effort = np.where(T_S < 7.5, 0.6, -0.4)
    speed = np.where(T_S < 7.5, 0.6, -0.4)
    columns = {"t_s": T_S, "effort_left": effort, "effort_right": effort}
    columns |= {"vel_left_mps": speed, "vel_right_mps": speed}
    runs = tuple(Run(f"{number:02d}", dict(columns)) for number in range(RUNS))
    wheel = WheelModel(1.0, 0.1)
    data = set_data(RecordingSet("even", runs, Baseline(Path("baseline.toml"), wheel, wheel, None, None)))
    return initial_fit(data, SetSimulator(data)).problem


def found(problem: Problem, error: FloatArray) -> list[bool]:
    """The answer for a model whose residual is this, shape (runs * rows, 2), m/s."""
    start = problem.simulator.start()
    residual = replace(problem.residual(start, ()), speeds=problem.data.speed_mps - error)
    return comes_and_goes(problem, Fit((), start, (), residual)).tolist()


def noise(seed: int = 1, memory: float = 0.0) -> FloatArray:
    """Noise of NOISE_MPS whose rows remember each other by `memory`."""
    rng = np.random.default_rng(seed)
    out = np.zeros((RUNS * ROWS, 2))
    for row in range(1, len(out)):
        out[row] = memory * out[row - 1] + rng.normal(0.0, NOISE_MPS * np.sqrt(1.0 - memory**2), 2)
    return out


def along(problem: Problem, size_mps: float, wanted: np.ndarray) -> FloatArray:
    """An error of this size along the left wheel's motion where it is wanted, shape (n, 2)."""
    return np.stack(
        [size_mps * wanted * np.sign(problem.data.speed_mps[:, 0]), np.zeros(RUNS * ROWS)], axis=1
    )


@pytest.mark.parametrize("memory", [0.0, 0.85])
def test_noise_and_slow_disturbances_do_not_come_and_go(problem: Problem, memory: float) -> None:
    assert [found(problem, noise(seed, memory)) for seed in range(4)] == [[False, False]] * 4


def test_a_brake_that_binds_now_and_then_does(problem: Problem) -> None:
    binds = np.tile(T_S % 3.0 < 0.5, RUNS)
    assert found(problem, noise(memory=0.85) + along(problem, -3.0 * NOISE_MPS, binds)) == [True, False]


def test_knocks_do(problem: Problem) -> None:
    rng = np.random.default_rng(2)
    knocked = np.repeat(rng.random(RUNS * ROWS // 10) < 0.08, 10)
    signs = np.repeat(rng.choice((-1.0, 1.0), RUNS * ROWS // 10), 10)
    assert found(problem, noise() + along(problem, 10.0 * NOISE_MPS, knocked * signs)) == [True, False]


def test_one_event_does_not(problem: Problem) -> None:
    once = np.zeros(RUNS * ROWS, dtype=bool)
    once[2 * ROWS + 100 : 2 * ROWS + 140] = True
    assert found(problem, noise() + along(problem, 30.0 * NOISE_MPS, once)) == [False, False]


def test_too_few_stretches_are_no_evidence(problem: Problem) -> None:
    few = replace(problem, counted=problem.counted * (problem.data.run_of_row == 0)[:, None])
    binds = np.tile(T_S % 3.0 < 0.5, RUNS)
    assert found(few, noise() + along(problem, -5.0 * NOISE_MPS, binds)) == [False, False]
