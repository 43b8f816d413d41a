"""What the image owes its chip, seen on the virtual board: clocks, brakes, time budget, a clean record."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest

import truing_protocol as tp
from hil_sim import VirtualRobot
from support.driving import BRAKE, NOT_DRIVEN
from truing.link.client import Client
from truing.link.framing import Frame, encode
from truing.link.refusals import faults_in
from truing.link.virtual_stream import VirtualStream

THREAD, SYSTICK, USART3, SENT = 0, 15, 16 + 39, 16 + 14  # SENT: DMA1 stream 3
RING = 4096  # bytes that wait for the main loop
TICK_US = 1000
FAULT_MAGIC = 0xFA17ED
NMI = 2
MIXED = (
    tp.Segment(tp.SegmentKind.VELOCITY, 1000, 0.35, 0.30),
    tp.Segment(tp.SegmentKind.TWIST, 1000, 0.30, 0.80),
    tp.Segment(tp.SegmentKind.EFFORT, 1000, 0.50, -0.50),
)


@pytest.fixture
def robot(image: Path, native_library: Path) -> Iterator[VirtualRobot]:
    """Just switched on."""
    with VirtualRobot(image) as fresh:
        yield fresh


def connect(robot: VirtualRobot, boot_us: int = 100_000) -> Client:
    """A client, once the board has had time to start: what it is sent before that is lost."""
    robot.run_us(boot_us)
    return Client(VirtualStream(robot))


def hello(client: Client) -> tp.HelloReply:
    return client.request(tp.HelloRequest(tp.PROTOCOL_VERSION, tp.SCHEMA_HASH))


def inputs(robot: VirtualRobot) -> tuple[tuple[float, float], tuple[float, float]]:
    return robot.bridge(0), robot.bridge(1)


def words(robot: VirtualRobot, symbol: str) -> tuple[int, ...]:
    address, size = robot.symbol(symbol)
    return struct.unpack(f"<{size // 4}I", robot.read_memory(address, size))


def start(client: Client, segments: tuple[tp.Segment, ...], log_rate_hz: int) -> None:
    """Upload and start a sequence, once the board has had time to look at its sensors."""
    crc = zlib.crc32(b"".join(segment.pack() for segment in segments))
    client.request(tp.SeqBeginRequest(len(segments), log_rate_hz))
    client.request(tp.SeqSegmentsRequest(0, segments))
    client.request(tp.SeqCommitRequest(crc))
    client.stream.sleep(0.3)
    hello = client.request(tp.HelloRequest(tp.PROTOCOL_VERSION, tp.SCHEMA_HASH))
    client.request(tp.ArmRequest(hello.boot_id))
    client.request(tp.SeqStartRequest(crc, 1))


def read_log(client: Client) -> int:
    """Read all sealed bytes with the line kept full; return their number."""
    ends = client.request(tp.LogListRequest(0))
    offset, waiting, received = ends.oldest_offset, set[int](), 0
    while offset < ends.end_offset or waiting:
        while offset < ends.end_offset and len(waiting) < 2:
            length = min(1020, ends.end_offset - offset)
            waiting.add(client.post(tp.LogReadRequest(offset, length)))
            offset += length
        for frame in client.receive(0.1):
            waiting.remove(frame.sequence)
            received += len(tp.LogReadReply.unpack(frame.payload).data)
    return received


def test_the_bridges_are_never_driven_before_they_brake(robot: VirtualRobot) -> None:
    while inputs(robot) == NOT_DRIVEN:
        robot.run_us(10)
        assert robot.time_us < 20_000
    for _ in range(1000):
        assert inputs(robot) == BRAKE
        robot.run_us(100)


def test_it_answers_within_20_ms_of_power_up(robot: VirtualRobot) -> None:
    reply = hello(connect(robot, boot_us=15_000))
    print(f"hello answered {robot.time_us} us after power-up")
    assert robot.time_us < 20_000
    assert reply.clock_source == tp.ClockSource.CRYSTAL_PLL
    assert reply.reset_cause == tp.ResetCause.POWER_ON


def test_without_a_crystal_it_says_so_and_works_from_the_internal_oscillator(
    image: Path, native_library: Path
) -> None:
    with VirtualRobot(image, crystal=False) as robot:
        client = connect(robot)
        client.stream.sleep(0.3)
        assert hello(client).clock_source == tp.ClockSource.INTERNAL_PLL
        assert robot.stats().cpu_hz == 158_000_000
        active = faults_in(client.request(tp.StatusRequest()).faults_active)
        assert [fault.name for fault in active] == ["clock_fallback"]
        start(client, MIXED, 20)
        client.stream.sleep(0.5)
        assert client.request(tp.StatusRequest()).state == tp.State.SEQUENCE
        assert client.counts.retries == 0


def test_a_crystal_that_dies_on_the_move_stops_the_wheels(robot: VirtualRobot) -> None:
    client = connect(robot)
    before = hello(client).boot_id
    start(client, (tp.Segment(tp.SegmentKind.EFFORT, 5000, 0.5, 0.5),), 20)
    client.stream.sleep(1.0)
    assert inputs(robot) == ((1.0, 0.5), (1.0, 0.5))
    robot.set_crystal_alive(False)
    robot.run_us(200)
    assert inputs(robot) in (BRAKE, NOT_DRIVEN)
    robot.run_us(20_000)
    assert inputs(robot) == BRAKE
    client.stream.sleep(0.1)
    after = hello(client)
    assert after.boot_id != before
    assert after.clock_source == tp.ClockSource.INTERNAL_PLL
    assert after.reset_cause == tp.ResetCause.SOFTWARE
    magic, count, exception, *_ = words(robot, "last_fault")
    assert (magic, count, exception) == (FAULT_MAGIC, 1, NMI)


def test_the_tick_leaves_nine_tenths_of_its_millisecond(robot: VirtualRobot) -> None:
    client = connect(robot)
    start(client, MIXED, 200)
    client.stream.sleep(4.0)
    tick, serial = robot.cost(SYSTICK), robot.cost(USART3)
    per_us = robot.stats().cpu_hz // 1_000_000
    mean = tick.cycles / tick.activations
    print(f"tick: {mean / per_us:.1f} us mean, {tick.worst_cycles / per_us:.1f} us worst")
    print(f"serial interrupt: {serial.worst_cycles / per_us:.2f} us worst")
    assert tick.worst_cycles < per_us * TICK_US / 10
    # It stands above the tick and the main loop: no more than a byte's time of either.
    assert serial.worst_cycles < per_us * 3


def test_bytes_come_and_go_without_an_interrupt_each(robot: VirtualRobot) -> None:
    client = connect(robot)
    robot.run_us(10_000)
    thread, before = robot.cost(THREAD), (robot.cost(USART3).activations, robot.cost(SENT).activations)
    robot.link_write(bytes([1]) * 900)
    robot.run_us(11_000)
    instructions = robot.cost(THREAD).instructions - thread.instructions
    print(f"main loop: {instructions / 900:.1f} instructions for each byte")
    assert robot.cost(USART3).activations == before[0] + 1, "the line went idle once"
    # Reading, unstuffing and checking a byte takes 46; eleven ticks call the main loop besides.
    assert instructions < 60 * 900
    request = tp.ParamListRequest(0)
    sent = len(encode(Frame(request.ID | tp.REPLY_BIT, 1, client.request(request).pack())))
    assert sent > 50
    assert robot.cost(SENT).activations <= before[1] + 2, "a reply leaves in one run, or two around the ring"


@pytest.mark.parametrize("until_end", range(10))
def test_a_request_that_goes_round_the_end_of_the_ring_is_read(robot: VirtualRobot, until_end: int) -> None:
    client = connect(robot)
    (head,) = words(robot, "rx_head")
    robot.link_write(bytes([1]) * (RING - until_end - 1 - head % RING) + b"\0")
    client.stream.sleep(0.06)
    (head,) = words(robot, "rx_head")
    assert head % RING == (RING - until_end) % RING
    assert hello(client).schema_hash == tp.SCHEMA_HASH
    assert client.counts.retries == 0
    assert words(robot, "usart_link_errors") == (0, 0, 0, 0)


def test_a_saturated_line_loses_nothing_and_breaks_no_rule_of_the_chip(robot: VirtualRobot) -> None:
    client = connect(robot)
    start(client, 4 * MIXED, 200)
    client.stream.sleep(13.0)
    began = robot.time_us
    received = read_log(client)
    print(f"{received} bytes of log in {(robot.time_us - began) / 1e6:.3f} s")
    assert received > 4000
    assert client.counts.retries == 0
    assert words(robot, "usart_link_errors") == (0, 0, 0, 0)
    assert robot.warnings() == []
    assert words(robot, "last_fault")[0] != FAULT_MAGIC
