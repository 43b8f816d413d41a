"""The drivers' enable pin is active only while the board is armed and nothing stops it."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from hil_sim import VirtualRobot
from support.driving import BRAKE, bridges, host
from truing.board.device import Device
from truing.errors import Refused

FLOATS, INACTIVE, ACTIVE = -1.0, 0.0, 1.0
ENDLESS = struct.pack("<H", 0xE7FE)  # b .
UNDEFINED = struct.pack("<H", 0xDE00)  # udf #0


@pytest.fixture
def image(each_image: Path) -> Path:
    """Each board wires bridges, enable pin and break inputs in its own way."""
    return each_image


def driving(robot: VirtualRobot) -> Device:
    device = host(robot)
    device.set_effort(0.5, 0.5)
    robot.run_us(100_000)
    assert robot.driver_enable() == ACTIVE
    return device


def until_inactive(robot: VirtualRobot, limit_us: int) -> int:
    """Microseconds until the pin is not held active any more."""
    began = robot.time_us
    while robot.driver_enable() == ACTIVE:
        robot.run_us(10)
        assert robot.time_us - began <= limit_us
    return robot.time_us - began


def overwrite(robot: VirtualRobot, function: str, code: bytes) -> None:
    robot.write_flash(robot.symbol(function)[0] & ~1, code)


def test_it_is_inactive_from_power_up_until_the_board_is_armed(image: Path, native_library: Path) -> None:
    with VirtualRobot(image) as robot:
        for _ in range(3000):
            assert robot.driver_enable() in (FLOATS, INACTIVE)
            robot.run_us(100)
        assert robot.driver_enable() == INACTIVE
        device = host(robot)
        device.status()
        assert robot.driver_enable() == INACTIVE
        device.arm()
        robot.run_us(2_000)
        assert robot.driver_enable() == ACTIVE
        device.set_effort(0.3, 0.3)
        device.stop()
        robot.run_us(2_000)
        assert robot.driver_enable() == ACTIVE, "the drivers are needed to brake"
        robot.reset()
        for _ in range(300):
            assert robot.driver_enable() in (FLOATS, INACTIVE)
            robot.run_us(1000)


def test_a_latched_fault_takes_it_away_until_it_is_cleared(robot: VirtualRobot) -> None:
    device = driving(robot)
    silent_us = until_inactive(robot, 600_000)
    assert [fault.name for fault in device.status().latched] == ["host_silent"]
    assert silent_us < 510_000
    robot.run_us(100_000)
    assert robot.driver_enable() == INACTIVE
    device.clear_faults()
    robot.run_us(2_000)
    assert robot.driver_enable() == ACTIVE


def hang_main_loop(robot: VirtualRobot) -> None:
    overwrite(robot, "log_feed_drain", ENDLESS)


def hang_tick(robot: VirtualRobot) -> None:
    overwrite(robot, "battery_update", ENDLESS)


def lock_up(robot: VirtualRobot) -> None:
    overwrite(robot, "fault_entry", UNDEFINED)
    overwrite(robot, "battery_update", UNDEFINED)


def nothing(_: VirtualRobot) -> None:
    pass


@pytest.mark.parametrize("at_us", [0, 130, 420, 990])
@pytest.mark.parametrize("trouble", [nothing, hang_main_loop, hang_tick, lock_up])
def test_the_emergency_stop_takes_it_away_without_a_program(
    robot: VirtualRobot, trouble: Callable[[VirtualRobot], None], at_us: int
) -> None:
    """In no time at all: the timer does it, before the next instruction."""
    device = driving(robot)
    trouble(robot)
    robot.run_us(3_000 + at_us)
    assert robot.driver_enable() == ACTIVE
    before = robot.stats().instructions
    robot.set_emergency_stop(True)
    assert robot.driver_enable() == INACTIVE
    assert robot.stats().instructions == before
    assert bridges(robot) == BRAKE
    robot.set_emergency_stop(False)
    for _ in range(100):
        assert robot.driver_enable() != ACTIVE
        robot.run_us(1000)
    if trouble is not nothing:
        return
    with pytest.raises(Refused, match="fault_latched"):
        device.set_effort(0.2, 0.2)
    device.clear_faults()
    robot.run_us(2_000)
    assert robot.driver_enable() == ACTIVE


def test_a_touch_of_the_emergency_stop_at_any_time_of_a_tick_is_enough(robot: VirtualRobot) -> None:
    device = driving(robot)
    for at_us in range(0, 1000, 45):
        robot.run_us(20_000 + at_us)
        robot.set_emergency_stop(True)
        robot.run_us(5)
        robot.set_emergency_stop(False)
        for _ in range(60):
            assert robot.driver_enable() == INACTIVE
            robot.run_us(50)
        device.clear_faults()
        robot.run_us(2_000)
        device.set_effort(0.5, 0.5)


def test_a_halted_core_takes_it_away(robot: VirtualRobot) -> None:
    driving(robot)
    robot.set_halted(True)
    assert robot.driver_enable() == INACTIVE


@pytest.mark.parametrize(
    ("trouble", "limit_ms"), [(hang_main_loop, 45.0), (hang_tick, 50.0), (lock_up, 50.0)]
)
def test_a_hang_takes_it_away_within_50_ms(
    robot: VirtualRobot, trouble: Callable[[VirtualRobot], None], limit_ms: float
) -> None:
    driving(robot)
    trouble(robot)
    took_ms = until_inactive(robot, round(1000 * limit_ms)) / 1000
    print(f"{trouble.__name__}: {took_ms:.2f} ms")


def test_a_fault_of_the_program_takes_it_away_before_the_reset(robot: VirtualRobot) -> None:
    driving(robot)
    resets = robot.stats().resets
    overwrite(robot, "battery_update", UNDEFINED)
    took_us = until_inactive(robot, 1_100)
    assert robot.stats().resets == resets or robot.driver_enable() == FLOATS
    print(f"program fault: {took_us} us, of which up to 1000 until the tick")


def test_a_sag_of_the_supply_takes_it_away_at_once(robot: VirtualRobot) -> None:
    device = driving(robot)
    robot.set_supply(2.9)
    took_us = until_inactive(robot, 20)
    robot.run_us(5_000)
    robot.set_supply(3.3)
    robot.run_us(5_000)
    assert robot.driver_enable() == INACTIVE
    assert [fault.name for fault in device.status().latched] == ["supply_dip"]
    print(f"supply sags: at most {took_us} us")


def test_drivers_that_have_the_input_let_the_motors_coast(robot: VirtualRobot) -> None:
    """And nothing else can drive them: a robot whose brake is wanted does not wire it."""
    speeds = []
    for wired in (False, True):
        robot.wire_driver_enable(wired)
        device = host(robot)
        device.set_effort(0.6, 0.6)
        for _ in range(10):
            robot.run_us(100_000)
            device.set_effort(0.6, 0.6)
        robot.set_emergency_stop(True)
        robot.run_us(150_000)
        speeds.append(robot.truth().speed_mps)
        robot.run_us(3_000_000)
        robot.set_emergency_stop(False)
        device.clear_faults()
    print(f"0.15 s after the emergency stop: braked {speeds[0]:.3f} m/s, coasting {speeds[1]:.3f} m/s")
    assert speeds[1] > 1.3 * speeds[0]
