"""A sag of the board's own supply brakes, resets and is named, at every depth; option bytes are checked."""

from __future__ import annotations

from pathlib import Path

import pytest

import truing_protocol as tp
from hil_sim import VirtualRobot
from hil_sim.robot import FACTORY_OPTION_BYTES
from support.driving import BRAKE, NOT_DRIVEN, bridges, host
from truing.errors import Refused

SAGS_V = [volts / 10 for volts in range(32, -1, -1)]
LENGTHS_US = [20, 700, 40_000]


def expected(volts: float) -> set[str]:
    """By the typical thresholds: detector 2.93 V, brown-out 2.83 V, power-down 1.68 V, SRAM 1.2 V."""
    if volts >= 2.93:
        return set()
    if volts >= 2.83:
        return {"supply_dip"}
    return {"brown_out"} if volts >= 1.2 else set()


@pytest.mark.parametrize("length_us", LENGTHS_US)
@pytest.mark.parametrize("volts", [*SAGS_V, 2.95, 2.9, 2.85])
def test_a_sag_of_any_depth_brakes_or_resets_and_nothing_moves_afterwards(
    robot: VirtualRobot, volts: float, length_us: int
) -> None:
    device = host(robot)
    device.set_effort(0.6, -0.6)
    robot.run_us(100_000)
    assert bridges(robot) not in (BRAKE, NOT_DRIVEN)
    robot.set_supply(volts)
    robot.run_us(2)
    harmless = volts >= 2.93
    assert bridges(robot) == (BRAKE if 2.83 <= volts < 2.93 else NOT_DRIVEN) or harmless
    robot.run_us(length_us)
    robot.set_supply(3.3)
    robot.run_us(100_000)
    assert harmless or bridges(robot) == BRAKE
    again = host(robot)
    assert {fault.name for fault in again.status().latched} == expected(volts)
    if harmless:
        assert bridges(robot) != BRAKE
    else:
        with pytest.raises(Refused, match="fault_latched" if expected(volts) else "not_armed"):
            device.client.request(tp.SetEffortRequest(0.3, 0.3))
    assert robot.warnings() == []


def test_a_supply_that_stays_low_is_refused_until_it_has_recovered(robot: VirtualRobot) -> None:
    device = host(robot)
    device.set_effort(0.6, 0.6)
    robot.run_us(50_000)
    robot.set_supply(2.9)
    robot.run_us(50_000)
    with pytest.raises(Refused, match="supply_dip"):
        device.clear_faults()
    robot.set_supply(3.0)  # above 2.93 V, and not yet above 3.03 V
    robot.run_us(50_000)
    with pytest.raises(Refused, match="supply_dip"):
        device.clear_faults()
    robot.set_supply(3.3)
    robot.run_us(5_000)
    device.clear_faults()
    device.set_effort(0.6, 0.6)
    robot.run_us(5_000)
    assert bridges(robot) != BRAKE


def test_a_sag_at_rest_is_no_fault_and_the_robot_drives_afterwards(robot: VirtualRobot) -> None:
    device = host(robot)
    robot.set_supply(2.9)
    robot.run_us(5_000)
    with pytest.raises(Refused, match="supply_dip"):
        device.set_effort(0.6, 0.6)
    robot.set_supply(3.3)
    robot.run_us(5_000)
    assert device.status().latched == ()
    device.set_effort(0.6, 0.6)
    robot.run_us(5_000)
    assert bridges(robot) != BRAKE


def test_option_bytes_that_leave_the_brown_out_reset_off_are_named(image: Path, native_library: Path) -> None:
    for option_bytes in (FACTORY_OPTION_BYTES, 0x0FFFAAE4, 0x0FFFAAE8):
        with VirtualRobot(image, option_bytes=option_bytes) as robot:
            robot.run_us(300_000)
            assert [fault.name for fault in host(robot).status().active] == ["brown_out_reset_off"]
    with VirtualRobot(image) as robot:
        robot.run_us(300_000)
        assert host(robot).status().active == ()


def test_without_the_brown_out_reset_the_detector_still_brakes(image: Path, native_library: Path) -> None:
    with VirtualRobot(image, option_bytes=FACTORY_OPTION_BYTES) as robot:
        robot.run_us(300_000)
        device = host(robot)
        device.set_effort(0.6, 0.6)
        robot.run_us(50_000)
        robot.set_supply(2.4)
        robot.run_us(20)
        assert bridges(robot) == BRAKE
        robot.set_supply(3.3)
        robot.run_us(5_000)
        assert {fault.name for fault in device.status().latched} == {"supply_dip"}
