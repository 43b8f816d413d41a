"""A debugger that halts the core brakes the wheels, and nothing moves when it lets the core go on."""

from __future__ import annotations

import pytest

from hil_sim import VirtualRobot
from support.driving import BRAKE
from truing.board.device import Device
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream
from truing.plan import Kind, Plan, Segment


@pytest.mark.parametrize("effort", [1.0, -1.0, 0.3])
@pytest.mark.parametrize("at_us", range(0, 1000, 130))
def test_a_halted_core_brakes_at_once_for_as_long_as_it_is_halted(
    robot: VirtualRobot, effort: float, at_us: int
) -> None:
    device = Device(Client(VirtualStream(robot)))
    plan = Plan("long", "", (Segment(Kind.EFFORT, 20.0, effort, -effort),))
    device.start(device.upload(plan), unattended=True)
    robot.run_us(300_000 + at_us)
    assert (robot.bridge(0), robot.bridge(1)) != BRAKE
    robot.set_halted(True)
    resets = robot.stats().resets
    for _ in range(300):
        assert (robot.bridge(0), robot.bridge(1)) == BRAKE
        robot.run_us(10_000)
    assert robot.stats().resets == resets, "the watchdog ended the debugging session"
    robot.set_halted(False)
    robot.run_us(2_000)
    for _ in range(100):
        assert (robot.bridge(0), robot.bridge(1)) == BRAKE, "it drove on when the core went on"
        robot.run_us(1000)
    assert "loop_overrun" in {fault.name for fault in device.status().latched}


def test_a_board_that_is_halted_at_rest_goes_on_as_if_nothing_had_been(robot: VirtualRobot) -> None:
    device = Device(Client(VirtualStream(robot)))
    robot.set_halted(True)
    robot.run_us(5_000_000)
    robot.set_halted(False)
    robot.run_us(300_000)
    assert device.status().latched == ()
    device.set_effort(0.2, 0.2)
    robot.run_us(2_000)
    assert (robot.bridge(0), robot.bridge(1)) != BRAKE
