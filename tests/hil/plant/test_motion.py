"""How the robot moves: energy, standstill, stopping, going straight, turning."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from hil_sim.plant import STEP_S, Plant, PlantState, RobotParameters

Place = Callable[..., Plant]


def stored_j(state: PlantState) -> float:
    return state.kinetic_energy_j + state.magnetic_energy_j


def rolling(place: Place, left: float, right: float) -> Plant:
    plant = place()
    plant.drive(left, right)
    plant.advance_s(1.5)
    return plant


def steps_to_rest(plant: Plant) -> int:
    for step in range(200_000):
        if plant.state().wheel_speed_radps == (0.0, 0.0):
            return step
        plant.advance(1)
    pytest.fail("still rolling after 10 s")


@pytest.mark.parametrize("duties", [(0.0, 0.0), (1.0, 1.0), (0.4, 0.4)], ids=["coast", "brake", "mixed"])
@pytest.mark.parametrize("efforts", [(0.6, 0.6), (0.6, 0.0), (0.5, -0.4)])
def test_an_unpowered_robot_only_loses_energy(
    place: Place, duties: tuple[float, float], efforts: tuple[float, float]
) -> None:
    plant = rolling(place, *efforts)
    for wheel in (0, 1):
        plant.set_bridge(wheel, *duties)
    before = stored_j(plant.state())
    assert before > 0.1
    for _ in range(30_000):
        plant.advance(1)
        now = stored_j(plant.state())
        assert now <= before
        before = now
    plant.advance_s(10.0)
    assert stored_j(plant.state()) == 0.0


def test_no_step_makes_more_energy_than_the_battery_gives(place: Place, robot: RobotParameters) -> None:
    states = [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.0, 0.0), (0.7, 0.2), (0.1, 0.6)]
    plant = place()
    dice = random.Random(7)
    state = plant.state()
    for step in range(100_000):
        if step % 500 == 0:
            for wheel in (0, 1):
                plant.set_bridge(wheel, *dice.choice(states))
        plant.advance(1)
        after = plant.state()
        bridges_a = after.battery_current_a - robot.battery.electronics_a
        given_j = state.battery_v * bridges_a * STEP_S
        assert stored_j(after) - stored_j(state) <= given_j + 1e-15
        state = after


def breakaway_effort(robot: RobotParameters) -> float:
    motor = robot.left.motor
    stall_nm = motor.emf_v_per_radps * motor.gear_ratio / motor.resistance_ohm
    return robot.left.friction.breakaway_nm / (stall_nm * robot.battery.full_v)


def test_a_wheel_stands_exactly_still_below_breakaway(place: Place, robot: RobotParameters) -> None:
    plant = place()
    effort = 0.97 * breakaway_effort(robot)
    plant.drive(effort, -effort)
    plant.advance_s(3.0)
    state = plant.state()
    assert state.wheel_angle_rad == (0.0, 0.0)
    assert state.wheel_speed_radps == (0.0, 0.0)
    assert (state.x_m, state.y_m, state.theta_rad) == (0.0, 0.0, 0.0)
    assert state.motor_current_a[0] > 0.0 > state.motor_current_a[1]


def test_a_wheel_turns_above_breakaway(place: Place, robot: RobotParameters) -> None:
    effort = 1.05 * breakaway_effort(robot)
    plant = place()
    plant.drive(effort, effort)
    plant.advance_s(0.5)
    assert min(plant.state().wheel_speed_radps) > 0.0


def test_braking_stops_sooner_than_coasting(place: Place) -> None:
    braked, coasting = rolling(place, 0.5, 0.5), rolling(place, 0.5, 0.5)
    assert braked.state() == coasting.state()
    for wheel in (0, 1):
        braked.set_bridge(wheel, 1.0, 1.0)
        coasting.set_bridge(wheel, 0.0, 0.0)
    assert 3 * steps_to_rest(braked) < steps_to_rest(coasting)


def test_a_stopped_robot_stays_where_it_stopped(place: Place) -> None:
    plant = rolling(place, 0.5, 0.3)
    plant.drive(0.0, 0.0)
    steps_to_rest(plant)
    plant.advance_s(0.1)
    there = plant.state()
    plant.advance_s(5.0)
    state = plant.state()
    assert (state.x_m, state.y_m, state.theta_rad) == (there.x_m, there.y_m, there.theta_rad)
    assert state.wheel_angle_rad == there.wheel_angle_rad


def test_a_coasting_motor_carries_no_current(place: Place) -> None:
    plant = rolling(place, 0.5, 0.5)
    for wheel in (0, 1):
        plant.set_bridge(wheel, 0.0, 0.0)
    plant.advance_s(0.01)
    state = plant.state()
    assert min(state.wheel_speed_radps) > 1.0
    assert state.motor_current_a == (0.0, 0.0)


def test_a_symmetric_robot_drives_exactly_straight(place: Place) -> None:
    plant = rolling(place, 0.4, 0.4)
    plant.drive(-0.7, -0.7)
    plant.advance_s(3.0)
    state = plant.state()
    assert state.x_m < -1.0
    assert (state.y_m, state.theta_rad) == (0.0, 0.0)
    assert state.wheel_angle_rad[0] == state.wheel_angle_rad[1]


def test_a_mirrored_command_drives_the_mirrored_path(place: Place) -> None:
    one, other = rolling(place, 0.5, 0.2).state(), rolling(place, 0.2, 0.5).state()
    assert one.x_m == pytest.approx(other.x_m, rel=1e-12)
    assert one.y_m == pytest.approx(-other.y_m, rel=1e-12)
    assert one.theta_rad == pytest.approx(-other.theta_rad, rel=1e-12)
    assert one.theta_rad < 0.0, "a faster left wheel turns the robot to the right"


def test_reverse_is_forward_mirrored(place: Place) -> None:
    forward, reverse = rolling(place, 0.5, 0.5).state(), rolling(place, -0.5, -0.5).state()
    assert forward.x_m == -reverse.x_m


@pytest.mark.parametrize("effort", [0.15, 0.30, 0.60])
def test_a_pivoting_wheel_is_slower_than_one_going_straight(place: Place, effort: float) -> None:
    pivot, straight = place(), place()
    pivot.drive(effort, 0.0)
    straight.drive(effort, effort)
    for plant in (pivot, straight):
        plant.advance_s(6.0)
    assert pivot.state().wheel_speed_radps[0] < straight.state().wheel_speed_radps[0]
    assert pivot.state().wheel_angle_rad[1] == 0.0, "the braked wheel is what the robot turns about"


def test_a_pivot_is_a_circle_of_one_wheelbase_about_the_standing_wheel(
    place: Place, robot: RobotParameters
) -> None:
    plant = place()
    half = robot.chassis.wheelbase_m / 2.0
    plant.drive(0.4, 0.0)
    for _ in range(50):
        plant.advance_s(0.1)
        state = plant.state()
        assert state.x_m**2 + (state.y_m + half) ** 2 == pytest.approx(half**2, rel=1e-6)
    turned = robot.left.radius_m * state.wheel_angle_rad[0] / robot.chassis.wheelbase_m
    assert state.theta_rad == pytest.approx(-turned, rel=1e-12)


def test_scrub_hardly_holds_back_a_robot_that_rolls_along_a_wide_arc(
    place: Place, robot: RobotParameters
) -> None:
    smooth = robot.changed(chassis__scrub_nm=0.0)
    with_scrub, without = place(), place(smooth)
    for plant in (with_scrub, without):
        plant.drive(0.50, 0.51)
        plant.advance_s(4.0)
    turned = with_scrub.state().theta_rad
    assert turned > 0.05
    assert turned < without.state().theta_rad


def test_full_effort_reaches_the_papers_top_speed(place: Place) -> None:
    plant = place()
    plant.drive(1.0, 1.0)
    plant.advance_s(5.0)
    assert 1.40 < plant.state().speed_mps < 1.55
