"""Effort changes no faster than its limit; returned energy, and heat of the motors, stop the robot."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hil_sim import VirtualRobot
from hil_sim.plant import RobotParameters
from support.driving import BRAKE, bridges, host
from truing.board.device import Device
from truing.errors import Refused
from truing.plan import Kind, Plan, Segment

LEFT, RIGHT = 0, 1
TICK_US = 1000


def applied(robot: VirtualRobot, wheel: int, ms: int) -> NDArray[np.float64]:
    """Effort at the bridge's pins in each of the next milliseconds."""
    efforts = []
    for _ in range(ms):
        in1, in2 = robot.bridge(wheel)
        efforts.append(in1 - in2)
        robot.run_us(TICK_US)
    return np.array(efforts)


def test_a_reversal_in_effort_mode_takes_twenty_milliseconds_at_the_bridge(robot: VirtualRobot) -> None:
    device = host(robot)
    plan = Plan("reversal", "", (Segment(Kind.EFFORT, 0.3, 1.0, -1.0), Segment(Kind.EFFORT, 0.3, -1.0, 1.0)))
    device.start(device.upload(plan), unattended=True)
    efforts = applied(robot, LEFT, 590)
    changing = np.flatnonzero(np.abs(np.diff(efforts)) > 1e-9)
    ramps = np.split(changing, np.flatnonzero(np.diff(changing) > 50) + 1)
    largest = np.abs(np.diff(efforts)).max()
    print(f"largest change in a tick {largest:.3f}, ramps of {[len(r) for r in ramps]} ms")
    assert [len(ramp) for ramp in ramps] == [10, 20]
    assert largest <= 0.1 + 1e-3
    assert efforts.max() == 1.0
    assert efforts.min() == -1.0


@pytest.mark.parametrize("slew_per_s", [1.0, 500.0])
def test_no_limit_that_the_board_takes_allows_a_reversal_within_a_tick(
    robot: VirtualRobot, slew_per_s: float
) -> None:
    device = host(robot)
    device.set_parameter("effort_mode_slew_per_s", slew_per_s)
    plan = Plan("reversal", "", (Segment(Kind.EFFORT, 1.2, 1.0, 1.0), Segment(Kind.EFFORT, 2.2, -1.0, -1.0)))
    device.start(device.upload(plan), unattended=True)
    efforts = applied(robot, LEFT, 3_300)
    assert np.abs(np.diff(efforts)).max() <= slew_per_s / 1000 + 1e-3
    assert efforts.min() == -1.0


def test_a_stop_is_not_delayed_by_the_limit(robot: VirtualRobot) -> None:
    device = host(robot)
    device.set_parameter("effort_mode_slew_per_s", 1.0)
    device.set_effort(1.0, 1.0)
    robot.run_us(400_000)
    assert bridges(robot) != BRAKE
    device.stop()
    assert bridges(robot) == BRAKE


def test_energy_that_no_battery_takes_is_kept_from_the_supply_and_named(robot: VirtualRobot) -> None:
    """A battery whose protection opens while the robot slows down from full speed."""
    device = host(robot)
    device.set_parameter("battery_high_v", 16.0)
    device.set_effort(1.0, 1.0)
    for _ in range(10):
        robot.run_us(200_000)
        device.set_effort(1.0, 1.0)
    device.set_effort(0.35, 0.35)
    robot.run_us(8_000)
    robot.set_battery_cut_off(True)
    highest_v = 0.0
    took_us = 0
    while bridges(robot) != BRAKE:
        robot.run_us(100)
        highest_v = max(highest_v, robot.truth().battery_v)
        took_us += 100 if robot.truth().battery_v > 16.0 else 0
        assert took_us < 20_000
    speed_mps = robot.truth().speed_mps
    assert {fault.name for fault in device.status().latched} == {"battery_high"}
    after_ms = took_us / 1000
    print(f"battery_high: braked {after_ms:.1f} ms after 16 V, at {highest_v:.1f} V, {speed_mps:.2f} m/s")
    assert took_us <= 3_000
    assert speed_mps > 0.8
    assert highest_v < 20.0
    while robot.truth().speed_mps > 0.05:
        before_v = robot.truth().battery_v
        robot.run_us(5_000)
        assert robot.truth().battery_v <= before_v, "the short returns nothing to the supply"
    robot.set_battery_cut_off(False)
    robot.run_us(10_000)
    device.clear_faults()


MOTOR = RobotParameters.msrp().left
RESISTANCE_OHM = MOTOR.motor.resistance_ohm
EMF_VS_PER_M = MOTOR.motor.emf_v_per_radps * MOTOR.motor.gear_ratio / MOTOR.radius_m


def set_motor(device: Device, continuous_a: float, thermal_s: float) -> None:
    device.set_parameter("motor_resistance_ohm", RESISTANCE_OHM)
    device.set_parameter("motor_emf_vs_per_m", EMF_VS_PER_M)
    device.set_parameter("motor_continuous_a", continuous_a)
    device.set_parameter("motor_thermal_s", thermal_s)


def drive_until_latched(
    robot: VirtualRobot, device: Device, effort: float, limit_s: float
) -> tuple[set[str], float]:
    """Names of the latched faults, and after how long, s; none within the limit."""
    began_s = robot.time_s
    while robot.time_s - began_s < limit_s:
        try:
            device.set_effort(effort, effort)
        except Refused:
            return {fault.name for fault in device.status().latched}, robot.time_s - began_s
        robot.run_us(20_000)
    return set(), limit_s


@pytest.mark.parametrize(("continuous_a", "thermal_s"), [(0.6, 10.0), (1.0, 5.0)])
def test_a_held_motor_stops_when_its_current_has_heated_it_as_long_as_it_bears(
    robot: VirtualRobot, continuous_a: float, thermal_s: float
) -> None:
    device = host(robot)
    device.set_parameter("stall_effort", 1.0)  # or the standing wheel stops the robot first
    set_motor(device, continuous_a, thermal_s)
    robot.hold_wheel(RIGHT, 10.0)
    robot.hold_wheel(LEFT, 10.0)
    latched, took_s = drive_until_latched(robot, device, 0.9, 4 * thermal_s)
    stall_a = 0.9 * robot.truth().battery_v / RESISTANCE_OHM
    expected_s = -thermal_s * np.log(1 - (continuous_a / stall_a) ** 2)
    print(f"motor hot after {took_s:.2f} s at {stall_a:.2f} A; I2t says {expected_s:.2f} s")
    assert latched == {"motor_left_hot", "motor_right_hot"}
    assert took_s == pytest.approx(expected_s, rel=0.15)
    assert bridges(robot) == BRAKE
    with pytest.raises(Refused, match="motor_left_hot"):
        device.clear_faults()
    robot.run_us(round(thermal_s * 0.3e6))
    device.clear_faults()


def test_a_motor_that_turns_freely_at_full_effort_never_gets_hot_nor_one_whose_numbers_are_unknown(
    robot: VirtualRobot,
) -> None:
    device = host(robot)
    set_motor(device, 0.6, 10.0)
    latched, _ = drive_until_latched(robot, device, 1.0, 20.0)
    assert latched == set()
    device.stop()
    robot.run_us(2_500_000)
    device.set_parameter("stall_effort", 1.0)
    device.set_parameter("motor_resistance_ohm", 0.0)
    robot.hold_wheel(RIGHT, 10.0)
    robot.hold_wheel(LEFT, 10.0)
    latched, _ = drive_until_latched(robot, device, 0.9, 4.0)
    assert latched == set()


def creeping_torque_nm(robot: VirtualRobot, effort: float, share: float) -> float:
    """What holds a wheel at this share of the speed at which back-EMF balances the effort."""
    motor = MOTOR.motor
    torque_per_a = motor.emf_v_per_radps * motor.gear_ratio
    held_nm = (1 - share) * effort * robot.truth().battery_v / RESISTANCE_OHM * torque_per_a
    return held_nm - MOTOR.friction.coulomb_nm


@pytest.mark.parametrize("effort", [0.6, 1.0])
def test_a_wheel_that_creeps_under_a_large_effort_is_stalled(robot: VirtualRobot, effort: float) -> None:
    device = host(robot)
    device.set_effort(effort, effort)
    robot.run_us(400_000)
    for wheel in (LEFT, RIGHT):
        robot.hold_wheel(wheel, creeping_torque_nm(robot, effort, 0.03))
    counts = device.status().counts[LEFT]
    latched, took_s = drive_until_latched(robot, device, effort, 5.0)
    moved = device.status().counts[LEFT] - counts
    print(f"creeping at {effort:.0%}: {latched} after {took_s:.2f} s and {moved} counts")
    assert latched
    assert latched <= {"wheel_left_stalled", "wheel_right_stalled"}
    assert took_s < 2.2
    assert moved > 50


@pytest.mark.parametrize("effort", [0.6, 1.0])
def test_a_wheel_that_climbs_at_a_quarter_of_its_speed_drives_on(robot: VirtualRobot, effort: float) -> None:
    device = host(robot)
    for wheel in (LEFT, RIGHT):
        robot.hold_wheel(wheel, creeping_torque_nm(robot, effort, 0.25))
    latched, _ = drive_until_latched(robot, device, effort, 5.0)
    assert latched == set()
    assert robot.truth().speed_mps > 0.1
