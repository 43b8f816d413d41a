"""Gain and dry friction that differ between directions: a step in reverse alone cannot separate the two."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from support.driven_wheel import Truth, ramps_and_steps
from support.simulated_runs import RICH, recordings
from truing.diagnose.data.set_data import set_data
from truing.diagnose.engine import diagnose, initial_fit
from truing.diagnose.fit import Fit, fit
from truing.diagnose.held_out import folds_of, held_out
from truing.diagnose.present.corrected_model import corrected_model
from truing.diagnose.problem import Problem
from truing.diagnose.simulation.simulator import SetSimulator
from truing.exporters.source import from_baseline
from truing.recording.baseline import Baseline, WheelModel
from truing.recording.run import RecordingSet, Run

BOTH = ("coulomb_friction", "direction_asymmetry")
TRUTHS = (
    Truth(friction=0.06, reverse_gain=1.02, reverse_friction=1.35, noise=0.01),
    Truth(gain=2.9, friction=0.07, reverse_gain=1.0, reverse_friction=1.25, noise=0.01),
)


@pytest.fixture(scope="module")
def robot() -> RecordingSet:
    """A ramp and a step forward and in reverse, with a baseline that lacks friction."""
    runs = []
    for number, wheels in enumerate(zip(*(ramps_and_steps(truth, 3) for truth in TRUTHS), strict=True)):
        columns = {"t_s": wheels[0].t_s}
        for side, wheel in zip(("left", "right"), wheels, strict=True):
            columns |= {f"effort_{side}": wheel.effort, f"vel_{side}_mps": wheel.speed_mps}
        runs.append(Run(f"{number:02d}", columns))
    wheel = WheelModel(2.8, 0.3)
    return RecordingSet("robot", tuple(runs), Baseline(Path("baseline.toml"), wheel, WheelModel(2.7, 0.3)))


@pytest.fixture(scope="module")
def problem(robot: RecordingSet) -> Problem:
    """Plain least squares of the robot's runs."""
    data = set_data(robot)
    stage = initial_fit(data, SetSimulator(data, data.baseline))
    return stage.problem.plain(0.02)


def unseen_rmse(problem: Problem, one: Fit) -> float:
    folds = folds_of(problem.data)
    return held_out(problem, one, folds, np.zeros(0)).rmse(problem.measured)


def test_in_reverse_dry_friction_is_multiplied() -> None:
    """Reverse with friction F and the ratio q is the mirror image of forward with q F."""
    data = recordings(tuple(np.abs(run) for run in RICH))
    mirrored = recordings(tuple(-np.abs(run) for run in RICH))
    speeds = []
    for each, friction, ratio in ((data, 0.09, 1.0), (mirrored, 0.06, 1.5)):
        simulator = SetSimulator(each)
        theta = simulator.start()
        for side in ("left", "right"):
            theta[simulator.layout.index(f"coulomb_friction.{side}")] = friction
            theta[simulator.layout.index(f"direction_asymmetry.friction_{side}")] = ratio
        speeds.append(simulator.speeds(theta, simulator.enabled(BOTH)))
    np.testing.assert_allclose(speeds[0], -speeds[1], atol=1e-9)
    assert np.abs(speeds[0]).max() > 0.5


def test_the_frictions_ratio_is_fitted_only_beside_friction(problem: Problem) -> None:
    alone = [column.name for column in problem.columns_of(("direction_asymmetry",))]
    beside = [column.name for column in problem.columns_of(BOTH)]
    assert not any("friction" in name for name in alone)
    assert {"direction_asymmetry.friction_left", "direction_asymmetry.friction_right"} < set(beside)


def test_directions_hold_on_runs_left_out(problem: Problem) -> None:
    friction = fit(problem, BOTH[:1], problem.simulator.start())
    assert unseen_rmse(problem, fit(problem, BOTH, friction.theta)) < 0.7 * unseen_rmse(problem, friction)


def test_a_step_in_reverse_alone_moves_the_gains_little(problem: Problem) -> None:
    """The ramp in reverse is left out: gain and friction in reverse are one, and their starts decide."""
    without_ramp = problem.restricted(
        problem.counted * (problem.data.run_of_row != 1)[:, None], problem.pose_counted
    )
    friction = fit(without_ramp, BOTH[:1], problem.simulator.start())
    pulled = fit(without_ramp, BOTH, friction.theta)
    far = friction.theta.copy()
    for name in ("left", "right"):
        far[problem.simulator.layout.index(f"direction_asymmetry.{name}")] = 0.8
    for one in (pulled, fit(without_ramp, BOTH, far, iterations=40)):
        assert one.value("direction_asymmetry.left") == pytest.approx(1.0, abs=0.02)
        assert one.value("direction_asymmetry.right") == pytest.approx(1.0, abs=0.02)
        assert 1.1 < one.value("direction_asymmetry.friction_left") < 1.4


def test_the_pull_hardly_moves_what_the_runs_determine(problem: Problem) -> None:
    friction = fit(problem, BOTH[:1], problem.simulator.start())
    pulled = fit(problem, BOTH, friction.theta)
    columns = tuple(replace(column, pull_mps=0.0) for column in pulled.columns)
    free = fit(problem, BOTH, friction.theta, columns=columns)
    errors = [problem.free_run_rmse(one.residual.speeds) for one in (pulled, free)]
    assert errors[0] < 1.03 * errors[1]


@pytest.mark.slow
def test_directions_are_named_beside_friction_and_exported(robot: RecordingSet) -> None:
    found = diagnose(robot)
    names = {effect.name: effect for effect in found.effects}
    assert "direction_asymmetry" in names
    ratios = names["direction_asymmetry"].parameters
    assert ratios["friction_left"].value == pytest.approx(1.35, rel=0.08)
    assert ratios["friction_right"].value == pytest.approx(1.25, rel=0.08)
    assert robot.baseline is not None
    model, _ = from_baseline(corrected_model(found, robot.baseline).baseline)
    assert model.left.reverse_friction == pytest.approx(ratios["friction_left"].value)
    assert model.effects()["direction_asymmetry"]["friction_right"] == model.right.reverse_friction
