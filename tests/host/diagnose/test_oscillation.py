"""An oscillation in what a model leaves, beside noise, slow disturbances and a decaying error."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy

from truing.arrays import FloatArray
from truing.diagnose.data.set_data import set_data
from truing.diagnose.engine import initial_fit
from truing.diagnose.fit import Fit
from truing.diagnose.oscillation import Oscillation, find_oscillation
from truing.diagnose.problem import Problem
from truing.diagnose.simulation.simulator import SetSimulator
from truing.recording.baseline import Baseline, WheelModel
from truing.recording.run import RecordingSet, Run

ROWS, ROW_S, RUNS, NOISE_MPS = 400, 0.02, 5, 0.003
T_S = np.arange(ROWS) * ROW_S


@pytest.fixture(scope="module")
def problem() -> Problem:
    effort = np.where(T_S < 4.0, 0.6, -0.4)
    columns = {"t_s": T_S, "effort_left": effort, "effort_right": effort}
    columns |= {"vel_left_mps": effort, "vel_right_mps": effort}
    runs = tuple(Run(f"{number:02d}", dict(columns)) for number in range(RUNS))
    wheel = WheelModel(1.0, 0.1)
    data = set_data(RecordingSet("even", runs, Baseline(Path("baseline.toml"), wheel, wheel, None, None)))
    return initial_fit(data, SetSimulator(data)).problem


def found(problem: Problem, error: FloatArray) -> Oscillation | None:
    """The answer for a model whose residual is this, shape (runs * rows, 2), m/s."""
    start = problem.simulator.start()
    residual = replace(problem.residual(start, ()), speeds=problem.data.speed_mps - error)
    return find_oscillation(problem, Fit((), start, (), residual))


def filtered_noise(poles: list[complex], seed: int = 1) -> FloatArray:
    """Noise of NOISE_MPS through these poles, shape (runs * rows, 2)."""
    white = np.random.default_rng(seed).normal(size=(RUNS * ROWS, 2))
    out = scipy.signal.lfilter([1.0], np.poly(poles).real, white, axis=0)
    return np.asarray(NOISE_MPS * out / out.std())


def pendulum(hertz: float) -> FloatArray:
    """What a step sets swinging in each run, with a phase and a size of its own, shape (runs * rows,)."""
    rng = np.random.default_rng(2)
    runs = [rng.uniform(0.5, 1.5) * np.sin(2.0 * np.pi * (hertz * T_S + rng.uniform())) for _ in range(RUNS)]
    return np.concatenate(runs) * NOISE_MPS


@pytest.mark.parametrize("hertz", [0.8, 2.0, 4.0])
def test_a_part_that_swings_is_found_with_its_frequency(problem, hertz) -> None:
    swing = 2.0 * pendulum(hertz)[:, None]
    oscillation = found(problem, swing + filtered_noise([]))
    assert oscillation is not None
    assert oscillation.together
    assert oscillation.frequency_hz == pytest.approx(hertz, rel=0.15)


def test_one_wheel_against_the_other_is_said(problem) -> None:
    oscillation = found(problem, 2.0 * pendulum(2.0)[:, None] * (1.0, -1.0) + filtered_noise([]))
    assert oscillation is not None
    assert not oscillation.together


@pytest.mark.parametrize("memory", [0.0, 0.7, 0.98])
def test_noise_and_slow_disturbances_do_not_oscillate(problem, memory) -> None:
    assert [found(problem, filtered_noise([memory], seed)) for seed in range(20)] == [None] * 20


def test_an_error_that_decays_after_each_step_is_no_oscillation(problem) -> None:
    after_step = np.exp(-T_S / 0.3) - np.exp(-np.maximum(T_S - 4.0, 0.0) / 0.3) * (T_S >= 4.0)
    error = 5.0 * NOISE_MPS * np.tile(after_step, RUNS)[:, None]
    assert found(problem, error + filtered_noise([])) is None


def test_one_run_alone_is_no_oscillation_of_the_robot(problem) -> None:
    error = 5.0 * pendulum(2.0)[:, None] * (np.arange(RUNS * ROWS)[:, None] < ROWS)
    assert found(problem, error + filtered_noise([])) is None
