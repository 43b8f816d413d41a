"""A robot that rolls down a ramp, braked, can be caught by a live command, also after a fault."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

import truing_protocol as tp
from hil_sim import VirtualRobot
from hil_sim.unmodelled_effects import UnmodelledEffects
from support.driving import host
from truing.board.device import Device
from truing.errors import Refused
from truing.plan import Kind, Plan, Segment


def tilt(robot: VirtualRobot, degrees: float, *, forward: bool) -> None:
    """Put the robot on a ramp that falls away ahead of it, or behind it."""
    effects = UnmodelledEffects()
    uphill_rad = math.pi if forward else 0.0
    load = replace(effects.load, slope_rad=math.radians(degrees), uphill_rad=uphill_rad)
    robot.set_unmodelled_effects(replace(effects, load=load))


def hold_for(robot: VirtualRobot, device: Device, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        device.set_velocity(0.0, 0.0)
        robot.run_us(100_000)


@pytest.mark.parametrize("forward", [True, False], ids=["ahead", "back"])
@pytest.mark.parametrize("degrees", [5.0, 8.0])
def test_a_robot_that_rolls_down_a_ramp_is_caught_by_a_command_to_stand(
    robot: VirtualRobot, degrees: float, forward: bool
) -> None:
    device = host(robot)
    tilt(robot, degrees, forward=forward)
    robot.run_us(4_000_000)
    rolls_mps = robot.truth().speed_mps
    assert abs(rolls_mps) > 0.05
    assert device.status().active == ()
    began = robot.truth()
    hold_for(robot, device, 2.0)
    status = device.status()
    way_m = math.hypot(robot.truth().x_m - began.x_m, robot.truth().y_m - began.y_m)
    print(f"{degrees:g} degrees: caught from {rolls_mps:+.2f} m/s within {way_m:.2f} m")
    assert status.latched == ()
    assert status.state == tp.State.LIVE
    assert abs(robot.truth().speed_mps) < 0.05
    assert way_m < 0.5


@pytest.mark.parametrize("forward", [True, False], ids=["ahead", "back"])
@pytest.mark.parametrize("degrees", [5.0, 8.0, 12.0, 16.0])
def test_on_a_steep_ramp_it_is_caught_by_effort(robot: VirtualRobot, degrees: float, forward: bool) -> None:
    device = host(robot)
    tilt(robot, degrees, forward=forward)
    robot.run_us(4_000_000)
    rolls_mps = robot.truth().speed_mps
    effort = -math.copysign(0.8, rolls_mps)
    began_s = robot.time_s
    while robot.truth().speed_mps * rolls_mps > 0:
        device.set_effort(effort, effort)
        robot.run_us(10_000)
        assert robot.time_s - began_s < 3.0
    print(f"{degrees:g} degrees: {rolls_mps:+.2f} m/s turned round within {robot.time_s - began_s:.2f} s")
    assert device.status().latched == ()


def test_one_that_a_fault_let_roll_is_cleared_and_caught(robot: VirtualRobot) -> None:
    device = host(robot)
    tilt(robot, 8.0, forward=True)
    device.set_velocity(0.1, 0.1)
    robot.run_us(3_000_000)
    assert [fault.name for fault in device.status().latched] == ["host_silent"]
    assert robot.truth().speed_mps > 0.05
    device.clear_faults()
    hold_for(robot, device, 2.0)
    assert device.status().latched == ()
    assert abs(robot.truth().speed_mps) < 0.05


def test_a_sequence_still_begins_from_rest_alone(robot: VirtualRobot) -> None:
    device = host(robot)
    tilt(robot, 8.0, forward=True)
    robot.run_us(4_000_000)
    sequence = device.upload(Plan("short", "", (Segment(Kind.EFFORT, 1.0, 0.3, 0.3),)))
    device.arm()
    with pytest.raises(Refused, match="implausible"):
        device.client.request(tp.SeqStartRequest(sequence.crc32, 1))
