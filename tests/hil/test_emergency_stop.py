"""The wired emergency stop brakes without the program, stays latched, and is named."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from hil_sim import VirtualRobot
from support.driving import BRAKE, bridges, host
from truing.errors import Refused

UNDEFINED = struct.pack("<H", 0xDE00)  # udf #0


@pytest.fixture
def image(each_image: Path) -> Path:
    """Each board wires bridges, enable pin and break inputs in its own way."""
    return each_image


@pytest.mark.parametrize("at_us", range(0, 1000, 130))
def test_it_brakes_at_once_is_latched_and_named(robot: VirtualRobot, at_us: int) -> None:
    device = host(robot)
    device.set_effort(0.6, -0.6)
    robot.run_us(100_000 + at_us)
    assert bridges(robot) != BRAKE
    robot.set_emergency_stop(True)
    assert bridges(robot) == BRAKE
    robot.run_us(2_000)
    assert {fault.name for fault in device.status().latched} == {"emergency_stop"}
    with pytest.raises(Refused, match="emergency_stop"):
        device.clear_faults()
    robot.set_emergency_stop(False)
    robot.run_us(100_000)
    assert bridges(robot) == BRAKE
    with pytest.raises(Refused, match="fault_latched"):
        device.set_effort(0.2, 0.2)
    device.clear_faults()
    robot.run_us(5_000)
    assert bridges(robot) == BRAKE
    device.set_effort(0.2, 0.2)
    robot.run_us(5_000)
    assert bridges(robot) != BRAKE


def test_a_touch_shorter_than_a_tick_is_latched_as_well(robot: VirtualRobot) -> None:
    device = host(robot)
    device.set_effort(0.6, 0.6)
    robot.run_us(100_300)
    robot.set_emergency_stop(True)
    robot.run_us(20)
    robot.set_emergency_stop(False)
    assert bridges(robot) == BRAKE
    robot.run_us(5_000)
    assert bridges(robot) == BRAKE
    assert {fault.name for fault in device.status().latched} == {"emergency_stop"}


def test_it_works_while_a_debugger_halts_the_core(robot: VirtualRobot) -> None:
    device = host(robot)
    device.set_effort(0.6, 0.6)
    robot.run_us(100_000)
    robot.set_halted(True)
    robot.set_emergency_stop(True)
    robot.set_emergency_stop(False)
    robot.set_halted(False)
    assert bridges(robot) == BRAKE, "the timer runs again, and not one instruction has"
    robot.run_us(5_000)
    assert bridges(robot) == BRAKE
    assert "emergency_stop" in {fault.name for fault in device.status().latched}


def test_it_works_while_the_core_is_locked_up(robot: VirtualRobot) -> None:
    device = host(robot)
    device.set_effort(0.6, 0.6)
    robot.run_us(100_000)
    for function in ("fault_entry", "battery_update"):
        robot.write_flash(robot.symbol(function)[0] & ~1, UNDEFINED)
    robot.run_us(3_000)
    assert robot.stats().locked_up
    assert bridges(robot) != BRAKE, "the watchdog has not come yet"
    robot.set_emergency_stop(True)
    assert bridges(robot) == BRAKE


def test_pressed_before_the_start_nothing_moves_and_the_save_of_parameters_undoes_nothing(
    robot: VirtualRobot,
) -> None:
    robot.set_emergency_stop(True)
    robot.power_cycle()
    robot.run_us(300_000)
    device = host(robot)
    with pytest.raises(Refused, match="emergency_stop"):
        device.set_effort(0.6, 0.6)
    robot.set_emergency_stop(False)
    device.set_parameter("speed_limit_mps", 1.25)
    device.save_parameters()
    with pytest.raises(Refused, match="emergency_stop"):
        device.set_effort(0.6, 0.6)
    device.clear_faults()
    robot.run_us(2_000)
    device.set_effort(0.6, 0.6)
