"""A stack that has run out of SRAM: the flashed image brakes, keeps what it can, and starts over."""

from __future__ import annotations

import pytest

from hil_sim import VirtualRobot
from support.driving import BRAKE, host

STKERR = 1 << 12
FLOATING = ((-1.0, -1.0), (-1.0, -1.0))  # during the reset


@pytest.mark.parametrize("room", [0, 16, 100])
def test_an_overflow_ends_in_a_named_fault_with_the_wheels_braked(robot: VirtualRobot, room: int) -> None:
    """Bytes of room above the bottom of SRAM; an interrupt's frame takes 32 or 104."""
    device = host(robot)
    device.set_effort(0.5, 0.5)
    robot.run_us(300_000)
    assert (robot.bridge(0), robot.bridge(1)) != BRAKE
    resets = robot.stats().resets
    robot.set_stack_pointer(robot.symbol("__stack_limit")[0] + room)
    braked_us = 0
    while (robot.bridge(0), robot.bridge(1)) not in {BRAKE, FLOATING} and braked_us < 5_000:
        robot.run_us(10)
        braked_us += 10
    print(f"{room} B of room: not driven after {braked_us} us")
    assert braked_us <= 1_000, "with the first interrupt, the next tick's at the latest"
    robot.run_us(1_000)
    assert not robot.stats().locked_up
    assert robot.stats().resets == resets + 1, "by the fault's handler, not the watchdog"
    for _ in range(300):
        robot.run_us(100)
        assert (robot.bridge(0), robot.bridge(1)) in {BRAKE, FLOATING}
    again = host(robot)
    assert "program_fault" in {fault.name for fault in again.status().latched}
    record = again.fault_record()
    assert record is not None
    assert record.exception == "BusFault"
    assert record.cfsr & STKERR
    assert record.pc is None, "there was no frame to take it from"
