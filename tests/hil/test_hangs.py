"""Whatever hangs, in whatever state: the wheels are let go within 50 ms, and it is named."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import truing_protocol as tp
from hil_sim import VirtualRobot
from support.driving import BRAKE, host
from truing.board.device import Device
from truing.errors import Refused
from truing.link.framing import Frame, encode
from truing.plan import Kind, Plan, Segment

OFF = ((-1.0, -1.0), (-1.0, -1.0))  # not driven: between a reset and the first instructions
BAR_MS = 50.0
ENDLESS = struct.pack("<H", 0xE7FE)  # b .
UNDEFINED = struct.pack("<H", 0xDE00)  # udf #0
BROKEN = ("battery_update", "fault_entry", "log_feed_drain")
TIM3 = 29
RECEIVE_RING = 4096  # bytes
SLOWEST_HZ, NOMINAL_HZ, FASTEST_HZ = 17_000, 32_000, 47_000  # datasheet DocID022152, section 5.3.9


@pytest.fixture
def robot(image: Path, native_library: Path) -> Iterator[VirtualRobot]:
    with VirtualRobot(image) as fresh:
        yield fresh


def overwrite(robot: VirtualRobot, function: str, code: bytes) -> None:
    robot.write_flash(robot.symbol(function)[0] & ~1, code)


def hang_main_loop(robot: VirtualRobot) -> None:
    overwrite(robot, "log_feed_drain", ENDLESS)


def hang_tick(robot: VirtualRobot) -> None:
    overwrite(robot, "battery_update", ENDLESS)


def hang_interrupt(robot: VirtualRobot) -> None:
    robot.set_interrupt_stuck(TIM3, True)


def lock_up(robot: VirtualRobot) -> None:
    """The fault handler faults itself: the core stops for good (ARMv7-M manual, section B1.5.15)."""
    overwrite(robot, "fault_entry", UNDEFINED)
    overwrite(robot, "battery_update", UNDEFINED)


HANGS: dict[str, Callable[[VirtualRobot], None]] = {
    "main loop": hang_main_loop,
    "tick": hang_tick,
    "interrupt": hang_interrupt,
    "core locked up": lock_up,
}


def at_rest(device: Device) -> None:
    device.stop()


def live(device: Device) -> None:
    device.set_effort(0.3, 0.3)


def in_sequence(device: Device) -> None:
    device.start(device.upload(Plan("long", "", (Segment(Kind.EFFORT, 20.0, 0.3, 0.3),))), unattended=True)


def stopped(device: Device) -> None:
    live(device)
    device.client.stream.sleep(0.6)
    assert [fault.name for fault in device.status().latched] == ["host_silent"]


STATES: dict[str, Callable[[Device], None]] = {
    "idle": at_rest,
    "live": live,
    "sequence": in_sequence,
    "stopped": stopped,
}


def safe(robot: VirtualRobot) -> bool:
    return (robot.bridge(0), robot.bridge(1)) in (BRAKE, OFF)


def until_safe_and_restarted(robot: VirtualRobot) -> tuple[float, float]:
    """Milliseconds until no bridge drives any more, and until the board has restarted."""
    began, resets = robot.time_us, robot.stats().resets
    safe_at: int | None = None
    while robot.stats().resets == resets:
        robot.run_us(100)
        if safe(robot):
            safe_at = robot.time_us if safe_at is None else safe_at
        else:
            assert safe_at is None, "the wheels were let go and then driven again"
        assert robot.time_us - began < 300_000, "it was never restarted"
    assert safe(robot)
    end = robot.time_us if safe_at is None else safe_at
    return (end - began) / 1000, (robot.time_us - began) / 1000


@pytest.mark.parametrize("lsi_hz", [SLOWEST_HZ, NOMINAL_HZ, FASTEST_HZ])
@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("hang", HANGS)
def test_a_hang_lets_go_of_the_wheels_within_50_ms_and_is_named(
    robot: VirtualRobot, image: Path, hang: str, state: str, lsi_hz: int
) -> None:
    robot.set_lsi_hz(lsi_hz)
    robot.power_cycle()
    robot.run_us(300_000)
    device = host(robot)
    STATES[state](device)
    robot.run_us(200_400)
    before = [robot.read_memory(robot.symbol(name)[0] & ~1, 2) for name in BROKEN]
    HANGS[hang](robot)
    safe_ms, reset_ms = until_safe_and_restarted(robot)
    print(f"{hang:15} {state:9} {lsi_hz} Hz: off after {safe_ms:5.1f} ms, reset after {reset_ms:5.1f} ms")
    assert safe_ms <= BAR_MS
    assert reset_ms <= 2 * BAR_MS
    # Mend what was broken, for the board to come up again.
    for name, code in zip(BROKEN, before, strict=True):
        overwrite(robot, name, code)
    robot.set_interrupt_stuck(TIM3, False)
    robot.run_us(300_000)
    assert (robot.bridge(0), robot.bridge(1)) == BRAKE
    again = host(robot)
    assert again.info.reset_cause == "watchdog"
    assert [fault.name for fault in again.status().latched] == ["watchdog_reset"]
    with pytest.raises(Refused, match="watchdog_reset"):
        again.set_effort(0.2, 0.2)


@pytest.mark.parametrize("lsi_hz", [SLOWEST_HZ, FASTEST_HZ])
@pytest.mark.parametrize("slow", [False, True], ids=["typical flash", "slowest flash"])
def test_an_erase_is_no_hang_and_ends_with_the_short_period_again(
    robot: VirtualRobot, lsi_hz: int, slow: bool
) -> None:
    robot.set_lsi_hz(lsi_hz)
    robot.set_flash_slow(slow)
    robot.power_cycle()
    robot.run_us(300_000)
    device = host(robot)
    for value in (1.0, 1.1, 1.2):
        device.set_parameter("speed_limit_mps", value)
        assert device.save_parameters().stall_s > 0.2
    assert host(robot).info.boot_id == device.info.boot_id
    live(device)
    robot.run_us(200_000)
    hang_tick(robot)
    safe_ms, _ = until_safe_and_restarted(robot)
    assert safe_ms <= BAR_MS


def test_a_receive_ring_whose_index_is_overwritten_replays_no_old_request(robot: VirtualRobot) -> None:
    robot.run_us(300_000)
    device = host(robot)
    live(device)
    device.stop()
    (head,) = struct.unpack("<I", robot.read_memory(robot.symbol("rx_head")[0], 4))
    robot.write_memory(robot.symbol("rx_tail")[0], struct.pack("<I", (head + 1) & 0xFFFFFFFF))
    for _ in range(500):
        robot.run_us(1000)
        assert safe(robot)
    assert host(robot).info.boot_id == device.info.boot_id


def until_safe(robot: VirtualRobot, limit_us: int) -> int:
    """Microseconds until no bridge drives any more."""
    began = robot.time_us
    while not safe(robot):
        robot.run_us(50)
        assert robot.time_us - began < limit_us, "the wheels are still driven"
    return robot.time_us - began


@pytest.mark.parametrize("at_us", range(0, 1000, 90))
@pytest.mark.parametrize(
    ("state", "payload"), [("live", b""), ("sequence", b""), ("live", b"\1\0\2"), ("sequence", bytes(40))]
)
def test_a_stop_brakes_within_2_ms_whatever_the_main_loop_does(
    robot: VirtualRobot, state: str, payload: bytes, at_us: int
) -> None:
    """The main loop is busy for ever, which is longer than any digest takes."""
    robot.run_us(300_000)
    device = host(robot)
    STATES[state](device)
    robot.run_us(200_000 + at_us)
    hang_main_loop(robot)
    robot.run_us(1_500)
    assert not safe(robot)
    device.client.stream.write(encode(Frame(tp.StopRequest.ID, 77, payload)))
    took_us = until_safe(robot, 2_000)
    print(f"stop with {len(payload)} bytes: {took_us / 1000:.2f} ms from its first bit")


@pytest.mark.parametrize(
    "payload", [b"", b"\1\0\2", bytes(range(250))], ids=["alone", "3 bytes", "250 bytes"]
)
def test_a_stop_brakes_within_2_ms_while_digests_are_asked(robot: VirtualRobot, payload: bytes) -> None:
    robot.run_us(300_000)
    device = host(robot)
    device.set_parameter("log_rate_hz", 200)
    device.set_parameter("command_timeout_s", 10.0)
    rounds, stop = 12, encode(Frame(tp.StopRequest.ID, 77, payload))
    for effort in (0.3, -0.3) * 20:
        device.set_effort(effort, -effort)
        robot.run_us(500_000)
    cells = device.logs()[-1].length
    digest = tp.LogDigestRequest(0, cells)
    worst = 0.0
    for at in range(rounds):
        device.stop()
        device.set_effort(0.3, 0.3)
        robot.run_us(200_000 + 83 * at)
        asked = b"".join(encode(Frame(digest.ID, 1000 + k, digest.pack())) for k in range(40))
        device.client.stream.write(asked)
        while robot.link_pending():
            robot.run_us(100)
        device.client.stream.write(stop)
        while robot.link_pending():  # with its last byte
            robot.run_us(50)
        worst = max(worst, until_safe(robot, 2_000) / 1000)
        robot.run_us(400_000)
        device.client.stream.read(100_000)
    print(f"{cells} bytes a digest, stop with {len(payload)} bytes: {worst:.2f} ms from its last bit")


@pytest.mark.parametrize("until_end", [1, 3, 5, 8])
def test_a_stop_that_goes_round_the_end_of_the_receive_ring_is_heard(
    robot: VirtualRobot, until_end: int
) -> None:
    robot.run_us(300_000)
    device = host(robot)
    in_sequence(device)
    robot.run_us(200_000)
    (head,) = struct.unpack("<I", robot.read_memory(robot.symbol("rx_head")[0], 4))
    device.client.stream.write(bytes([1]) * (RECEIVE_RING - until_end - 1 - head % RECEIVE_RING) + b"\0")
    robot.run_us(60_000)
    hang_main_loop(robot)
    robot.run_us(1_500)
    assert not safe(robot)
    stop = encode(Frame(tp.StopRequest.ID, 77, b""))
    device.client.stream.write(stop)
    robot.run_us(2_000)
    assert safe(robot)
    (head,) = struct.unpack("<I", robot.read_memory(robot.symbol("rx_head")[0], 4))
    assert head % RECEIVE_RING == len(stop) - until_end
