"""The flashed image with flash wait states counted: its deadlines hold as they do without."""

from __future__ import annotations

import pytest

import truing_protocol as tp
from hil_sim import VirtualRobot
from support.driving import BRAKE, host
from truing.board.device import Device
from truing.link.framing import Frame, encode


@pytest.fixture
def driving(robot: VirtualRobot) -> tuple[VirtualRobot, Device]:
    """A robot that is driven in velocity mode with all its reads of flash counted, from its start on."""
    robot.count_flash_waits()
    robot.power_cycle()
    robot.run_us(20_000)
    device = host(robot)
    for _ in range(10):
        device.set_velocity(0.35, 0.30)
        robot.run_us(100_000)
    assert (robot.bridge(0), robot.bridge(1)) != BRAKE
    return robot, device


def until_braked_us(robot: VirtualRobot) -> int:
    began = robot.time_us
    while (robot.bridge(0), robot.bridge(1)) != BRAKE and robot.time_us - began < 100_000:
        robot.run_us(10)
    return robot.time_us - began


def test_it_drives_without_a_fault_and_goes_at_its_speed(driving: tuple[VirtualRobot, Device]) -> None:
    robot, device = driving
    assert device.status().latched == ()
    assert robot.truth().speed_mps == pytest.approx(0.325, rel=0.05)
    assert robot.warnings() == []
    tick = robot.cost(15)
    per_instruction = tick.cycles / tick.instructions
    print(f"{per_instruction:.2f} cycles an instruction, worst tick {tick.worst_cycles / 168:.1f} us")
    assert per_instruction > 2, "1.7 without wait states"
    assert tick.worst_cycles < 168 * 100


def test_a_stop_brakes_within_2_ms(driving: tuple[VirtualRobot, Device]) -> None:
    robot, _ = driving
    robot.link_write(encode(Frame(tp.StopRequest.ID, 999)))
    took_us = until_braked_us(robot)
    print(f"stop: {took_us} us")
    assert took_us <= 2_000


def test_a_hung_main_loop_brakes_within_50_ms(driving: tuple[VirtualRobot, Device]) -> None:
    robot, _ = driving
    robot.write_flash(robot.symbol("log_feed_drain")[0] & ~1, b"\xfe\xe7")  # b .
    took_us = until_braked_us(robot)
    print(f"hung: {took_us} us")
    assert took_us <= 50_000
