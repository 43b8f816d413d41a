"""The proposed run separates the explanations that are left, within the robot's limits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from support.recorded_sets import COUNTS, RADIUS_M, WHEELBASE_M, Columns, recordings
from truing.diagnose.data.set_data import set_data
from truing.diagnose.next_experiment import propose
from truing.diagnose.profiles import PROFILES, Limits, Robot, candidate_plans
from truing.diagnose.result import Explanation, SignalNoise
from truing.diagnose.simulation.simulator import SetSimulator
from truing.floor import MotionModel, estimate_floor

NOISE = tuple(
    SignalNoise(f"vel_{side}_mps", 0.004, 0.008, 0.009, 0.05, "made up") for side in ("left", "right")
)
POSE_NOISE = tuple(
    SignalNoise(signal, 0.0, sigma, sigma, 0.0, "made up", unit)
    for signal, sigma, unit in (
        ("truth_x_m", 0.002, "m"),
        ("truth_y_m", 0.002, "m"),
        ("truth_theta_rad", 0.004, "rad"),
    )
)
ROBOT = Robot(1.45, 0.35, 0.283)


def explanation(simulator: SetSimulator, **values: float) -> Explanation:
    theta = simulator.start()
    for key, value in values.items():
        theta[simulator.layout.index(key.replace("__", "."))] = value
    return Explanation(tuple(dict.fromkeys(key.split("__")[0] for key in values)), theta)


@pytest.fixture(scope="module")
def simulator() -> SetSimulator:
    return SetSimulator(set_data(recordings(4)))


@pytest.mark.parametrize("robot", [ROBOT, Robot(18.0, 0.35, 0.6), Robot(0.5, 1.5, 0.2)])
@pytest.mark.parametrize("floor_m", [1.0, 4.0, 20.0])
def test_every_drive_of_the_library_stays_within_its_limits(robot: Robot, floor_m: float) -> None:
    plans = [plan for _, plan in candidate_plans(robot, Limits(effort=0.8, floor_m=floor_m), 20.0)]
    assert plans, "there is always something to propose"
    model = MotionModel(robot.gain_mps, robot.gain_mps, robot.time_constant_s, robot.wheelbase_m)
    for plan in plans:
        assert max(max(abs(s.a), abs(s.b)) for s in plan.segments) <= 0.8
        assert estimate_floor(plan, model).radius_m <= floor_m
        assert plan.segments[0].a == plan.segments[-1].b == 0.0, "it begins and ends at rest"


@pytest.mark.parametrize("floor_m", [1.0, math.inf])
def test_a_single_axis_is_asked_for_nothing_that_takes_two_wheels(floor_m: float) -> None:
    plans = [plan for _, plan in candidate_plans(ROBOT, Limits(floor_m=floor_m, alike=True), 20.0)]
    assert len(plans) > 5
    assert all(segment.a == segment.b for plan in plans for segment in plan.segments)
    assert not any("spot" in plan.title or "half a turn" in plan.title for plan in plans)


def test_a_usual_robot_has_every_profile_to_choose_from() -> None:
    names = {profile.name for profile, _ in candidate_plans(ROBOT, Limits(floor_m=4.0), 20.0)}
    assert names == {profile.name for profile in PROFILES}


@pytest.mark.slow
def test_friction_and_dead_band_are_distinguished_far_above_the_noise(simulator: SetSimulator) -> None:
    found = propose(
        (
            explanation(simulator, coulomb_friction__left=0.05, coulomb_friction__right=0.05),
            explanation(simulator, driver_deadband__deadband=0.05),
        ),
        recordings(4),
        NOISE,
    )
    assert found is not None
    assert found.expected_difference_over_noise > 4.0
    assert found.separates == (("coulomb_friction",), ("driver_deadband",))
    assert "dry friction" in found.why


def test_delay_and_lag_are_distinguished_by_quick_reversals(simulator: SetSimulator) -> None:
    found = propose(
        (
            explanation(simulator, input_delay__delay=0.06),
            explanation(simulator, driver_lag__time_constant=0.06),
        ),
        recordings(4),
        NOISE,
    )
    assert found is not None
    assert found.plan.name.startswith(("chirp", "reversals", "full_reversals"))
    assert found.expected_difference_over_noise > 4.0


def test_what_no_run_separates_is_said_and_not_promised(simulator: SetSimulator) -> None:
    # Seen from the wheels alone, a side that is stronger is a side that counts more.
    gain = explanation(simulator, side_asymmetry__gain_ratio=1.05)
    scale = explanation(simulator, encoder_scale__left=1.025, encoder_scale__right=0.9756)
    found = propose((gain, scale), recordings(4), NOISE)
    assert found is not None
    assert found.expected_difference_over_noise < 2.0
    assert "No safe run" in found.why


def with_a_truth(_: str, values: Columns) -> None:
    travel = [2.0 * np.pi * RADIUS_M / COUNTS * values[f"ticks_{side}"] for side in ("left", "right")]
    values["truth_theta_rad"] = (travel[1] - travel[0]) / WHEELBASE_M
    for axis, way in (("x", np.cos), ("y", np.sin)):
        steps = np.diff(0.5 * (travel[0] + travel[1]), prepend=0.0)
        values[f"truth_{axis}_m"] = np.cumsum(steps * way(values["truth_theta_rad"]))


def test_the_pose_distinguishes_what_it_can_and_the_rest_needs_a_direct_measurement(
    simulator: SetSimulator,
) -> None:
    found = propose(
        (
            explanation(simulator, heading_drift__drift=0.05),
            explanation(simulator, wheel_radius_error__left=1.01, wheel_radius_error__right=1.01),
            explanation(simulator, encoder_scale__left=0.99, encoder_scale__right=0.99),
        ),
        recordings(4, with_a_truth),
        NOISE + POSE_NOISE,
    )
    assert found is not None
    assert found.expected_difference_over_noise > 2.0, "a drift bends, equal radii only stretch"
    assert "no drive distinguishes" in found.why
    assert "direct measurement" in found.why


def test_one_explanation_needs_no_run(simulator: SetSimulator) -> None:
    assert propose((explanation(simulator, driver_deadband__deadband=0.05),), recordings(4), NOISE) is None
