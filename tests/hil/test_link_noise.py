"""The flashed image at a disturbed serial line: it counts, refuses what is damaged, and goes on."""

from __future__ import annotations

import struct

import pytest

import truing_protocol as tp
from hil_sim import VirtualRobot
from support.driving import host
from truing.link.framing import Frame, encode

REQUESTS = 200


def line_errors(robot: VirtualRobot) -> dict[str, int]:
    address, size = robot.symbol("usart_link_errors")
    names = ("overruns", "ring_overflow", "framing", "noise")
    return dict(zip(names, struct.unpack(f"<{size // 4}I", robot.read_memory(address, size)), strict=True))


def index_of(name: str) -> int:
    return next(p.index for p in tp.PARAMETERS if p.name == name)


@pytest.mark.parametrize("pulse_ns", [60, 500])
def test_no_damaged_request_is_obeyed_and_none_is_lost_for_good(robot: VirtualRobot, pulse_ns: int) -> None:
    """60 ns meet one sample of three and change nothing; half a bit changes or loses one byte in 25."""
    device = host(robot)
    robot.set_link_noise(270_003, pulse_ns)
    for value in range(REQUESTS):
        reply = device.client.request(tp.ParamSetRequest(index_of("log_rate_hz"), 1 + value % 200))
        assert reply.value == 1 + value % 200
    robot.set_link_noise(0, 0)
    errors, dropped = line_errors(robot), device.client.request(tp.StatusRequest()).frames_dropped
    print(f"{pulse_ns} ns: {errors}, {dropped} frames dropped, {device.client.counts.retries} asked again")
    assert errors["noise"] > 0
    assert (errors["overruns"], errors["ring_overflow"]) == (0, 0)
    assert (dropped > 0) == (device.client.counts.retries > 0) == (pulse_ns > 100)
    assert robot.warnings() == []


def test_a_host_of_another_speed_is_not_obeyed_and_does_not_stop_the_board(robot: VirtualRobot) -> None:
    device = host(robot)
    device.arm()
    before = device.client.request(tp.StatusRequest())
    robot.set_link_baud(921_600 / 2)
    for _ in range(20):
        robot.link_write(encode(Frame(tp.SetEffortRequest.ID, 7, tp.SetEffortRequest(0.5, 0.5).pack())))
        robot.run_us(2_000)
    robot.set_link_baud(921_600)
    robot.run_us(5_000)
    after = device.client.request(tp.StatusRequest())
    assert after.state == before.state
    assert after.faults_latched == before.faults_latched
    assert line_errors(robot)["framing"] > 0
