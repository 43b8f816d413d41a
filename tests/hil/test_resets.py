"""After any reset nothing moves by itself, whoever streams set-points, and unexpected ones are named."""

from __future__ import annotations

import pytest

import truing_protocol as tp
from hil_sim import VirtualRobot
from hil_sim.robot import ResetCause
from support.driving import BRAKE, NOT_DRIVEN, host
from truing.errors import BoardRebooted, Refused
from truing.link.client import Client
from truing.plan import Kind, Plan, Segment

NAMED = [
    (ResetCause.BROWNOUT, "brown_out"),
    (ResetCause.PIN, "unexpected_reset"),
    (ResetCause.SOFTWARE, "unexpected_reset"),
    (ResetCause.WATCHDOG, "watchdog_reset"),
]
IDS = [f"{cause.name}".lower() for cause, _ in NAMED]


def stream_set_points(robot: VirtualRobot, client: Client, seconds: float) -> set[str]:
    """Set-points every 20 ms of a host that looks at no answer; why they were refused."""
    refused = set()
    end_us = robot.time_us + round(seconds * 1e6)
    while robot.time_us < end_us:
        client.post(_Blind(0.4, 0.4))
        for frame in client.receive(0.02):
            if frame.id == tp.REFUSAL_ID:
                refused.add(tp.RefusalReason(tp.Refusal.unpack(frame.payload).reason).name.lower())
        robot.run_us(5000)
    return refused


class _Blind(tp.SetEffortRequest):
    CHANGES = False  # sent without waiting for the answer to the one before


@pytest.mark.parametrize(("cause", "name"), NAMED, ids=IDS)
def test_a_host_that_streams_on_through_a_reset_moves_nothing(
    robot: VirtualRobot, cause: ResetCause, name: str
) -> None:
    device = host(robot)
    device.set_effort(0.4, 0.4)
    assert stream_set_points(robot, device.client, 0.3) == set()
    assert robot.bridge(0) != (1.0, 1.0)
    robot.reset(cause)
    end_us = robot.time_us + 1_000_000
    refused: set[str] = set()
    while robot.time_us < end_us:
        refused |= stream_set_points(robot, device.client, 0.02)
        assert (robot.bridge(0), robot.bridge(1)) in (BRAKE, NOT_DRIVEN)
    assert refused == {"fault_latched"}
    again = host(robot)
    assert [fault.name for fault in again.status().latched] == [name]
    again.clear_faults()
    assert stream_set_points(robot, device.client, 0.5) == {"not_armed"}, "cleared, but not armed"
    assert (robot.bridge(0), robot.bridge(1)) == BRAKE
    with pytest.raises(BoardRebooted, match="started anew"):
        device.set_effort(0.4, 0.4)  # the host of the start before never drives this one
    again.set_effort(0.4, 0.4)
    robot.run_us(5000)
    assert robot.bridge(0) != (1.0, 1.0)


@pytest.mark.parametrize("cause", [ResetCause.PIN, ResetCause.SOFTWARE], ids=["button", "probe"])
def test_a_reset_at_rest_is_no_fault_but_needs_arming_too(robot: VirtualRobot, cause: ResetCause) -> None:
    device = host(robot)
    device.set_effort(0.4, 0.4)
    device.stop()
    robot.run_us(50_000)
    robot.reset(cause)
    robot.run_us(300_000)
    again = host(robot)
    assert again.status().latched == ()
    with pytest.raises(Refused, match="not_armed"):
        again.client.request(tp.SetEffortRequest(0.1, 0.1))
    with pytest.raises(BoardRebooted):
        device.set_effort(0.1, 0.1)


def test_a_power_cycle_needs_arming_and_ends_a_sequence_for_good(robot: VirtualRobot) -> None:
    device = host(robot)
    sequence = device.upload(Plan("long", "", (Segment(Kind.EFFORT, 20.0, 0.3, 0.3),)))
    device.start(sequence, unattended=True)
    robot.run_us(300_000)
    robot.power_cycle()
    robot.run_us(1_000_000)
    assert (robot.bridge(0), robot.bridge(1)) == BRAKE
    assert host(robot).status().latched == ()
    with pytest.raises(BoardRebooted):
        device.start(sequence)


def test_permission_for_another_start_is_refused(robot: VirtualRobot) -> None:
    device = host(robot)
    with pytest.raises(Refused, match="wrong_boot"):
        device.client.request(tp.ArmRequest(device.info.boot_id ^ 1))
    with pytest.raises(Refused, match="not_armed"):
        device.client.request(tp.SetVelocityRequest(0.1, 0.1))
