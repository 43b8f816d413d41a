"""What the image costs its chip: the virtual board at rest and under the heaviest load a host can make."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import truing_protocol as tp
from hil_sim import CanFrame, VirtualCanBus, VirtualRobot
from hil_sim.robot import EncoderFault, ExceptionCost
from support.driving import BRAKE
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream

SYSTICK = 15
CHUNK = 1020
BYTES_AHEAD = 400  # 4 ms of the line
BUSY_US = 3_000_000
CAN_TURN_S = 0.0002  # two frames of the bus
CAN_REQUESTS_AHEAD = 3
STACK_PAINT = b"\xc5\xc5\xc5\xc5"
LOG_RATE_HZ = 200
ROUGH_RIDE = (
    tp.Segment(tp.SegmentKind.VELOCITY, 700, 0.35, 0.30),
    tp.Segment(tp.SegmentKind.TWIST, 700, 0.30, 0.80),
    tp.Segment(tp.SegmentKind.VELOCITY, 700, -0.35, 0.02),
    tp.Segment(tp.SegmentKind.EFFORT, 700, 0.90, 0.90),
    tp.Segment(tp.SegmentKind.EFFORT, 60_000, 0.50, -0.50),
)


@dataclass(frozen=True)
class Load:
    """Shares of the CPU's time, 0 to 1."""

    ticks: float
    awake: float


@dataclass(frozen=True)
class Costs:
    """What was seen of the image on the virtual board.

    Attributes
    ----------
    bus_share : of the bits that CAN can carry in the busy time, 0 to 1.
    handlers : by exception number.
    stack : bytes of the stack that were ever written to.
    """

    braked_after_us: int
    answers_after_us: int
    resting: Load
    busy: Load
    bus_share: float
    handlers: dict[int, ExceptionCost]
    stack: int
    cpu_hz: int


class CanLoad:
    """A host on the bus that asks for the status again and again, a few requests ahead of the replies."""

    def __init__(self, robot: VirtualRobot) -> None:
        self.bus = VirtualCanBus()
        self.bus.attach(robot)
        self._node = int(next(p.default for p in tp.PARAMETERS if p.name == "can_node"))
        self._sent = self.answers = 0

    def _send(self, data: bytes) -> None:
        self.bus.write(CanFrame(tp.CAN_HOST_TO_BOARD + self._node, data.ljust(8, b"\0")))

    def turn(self) -> None:
        """Give leave to the messages that have begun, and ask anew for those that ended."""
        while (frame := self.bus.read()) is not None:
            if frame.id != tp.CAN_BOARD_TO_HOST + self._node:
                continue
            if frame.data[0] >> 4 == 1:  # ISO 15765-2: a first frame; the whole message may follow at once
                self.answers += 1
                self._send(bytes([0x30, 0, 0]))
        while self._sent - self.answers < CAN_REQUESTS_AHEAD:
            self._sent += 1
            request = struct.pack("<BH", tp.StatusRequest.ID, self._sent & 0xFFFF)
            message = request + struct.pack("<I", zlib.crc32(request))
            self._send(bytes([len(message)]) + message)


@contextmanager
def _load(robot: VirtualRobot) -> Iterator[list[Load]]:
    """One `Load`, of the time that goes by inside."""
    found: list[Load] = []
    stats, tick = robot.stats(), robot.cost(SYSTICK)
    yield found
    after = robot.stats()
    spent = after.cycles - stats.cycles
    asleep = after.sleep_cycles - stats.sleep_cycles
    found.append(Load((robot.cost(SYSTICK).cycles - tick.cycles) / spent, 1 - asleep / spent))


def _start(client: Client) -> None:
    crc = zlib.crc32(b"".join(segment.pack() for segment in ROUGH_RIDE))
    client.request(tp.SeqBeginRequest(len(ROUGH_RIDE), LOG_RATE_HZ))
    client.request(tp.SeqSegmentsRequest(0, ROUGH_RIDE))
    client.request(tp.SeqCommitRequest(crc))
    hello = client.request(tp.HelloRequest(tp.PROTOCOL_VERSION, tp.SCHEMA_HASH))
    client.request(tp.ArmRequest(hello.boot_id))
    client.request(tp.SeqStartRequest(crc, 1))


def _fill_the_line(client: Client, robot: VirtualRobot, can: CanLoad, until_us: int) -> None:
    """Both directions without a gap: log bytes come up, requests go down, answered or not; and CAN beside."""
    ends = client.request(tp.LogListRequest(0))
    offset = ends.oldest_offset
    while robot.time_us < until_us:
        client.post(tp.LogReadRequest(offset, min(CHUNK, ends.end_offset - offset)))
        offset = offset + CHUNK if offset + CHUNK < ends.end_offset else ends.oldest_offset
        while robot.link_pending() < BYTES_AHEAD:
            client.post(tp.StatusRequest())
        for _ in range(10):
            client.receive(CAN_TURN_S)
            can.turn()
    while client.receive(0.05):
        pass


def _stack_seen(robot: VirtualRobot) -> int:
    bottom, _ = robot.symbol("__stack_limit")
    top, _ = robot.symbol("__stack_top")
    stack = robot.read_memory(bottom, top - bottom)
    clean = 0
    while stack[clean : clean + 4] == STACK_PAINT:
        clean += 4
    return len(stack) - clean


def measure(image: Path, *, flash_waits: bool) -> Costs:
    """Power up, rest, drive with the line full both ways, and end it by a fault.

    With `flash_waits` the CPU's cycles include flash wait states.
    """
    with VirtualRobot(image) as robot:
        if flash_waits:
            robot.count_flash_waits()
        while (robot.bridge(0), robot.bridge(1)) != BRAKE:
            robot.run_us(10)
        braked_us = robot.time_us
        client = Client(VirtualStream(robot))
        while not robot.link_read():
            client.post(tp.StatusRequest())
            robot.run_us(500)
        answers_us = robot.time_us
        robot.run_us(300_000)
        robot.link_read()
        with _load(robot) as resting:
            robot.run_us(1_000_000)
        _start(client)
        robot.run_us(500_000)
        can = CanLoad(robot)
        robot.run_us(1000)
        before = can.bus.totals().bits
        with _load(robot) as busy:
            _fill_the_line(client, robot, can, robot.time_us + BUSY_US)
        bus_share = (can.bus.totals().bits - before) / BUSY_US
        assert can.answers > 1000
        robot.run_us(20_000)  # the host's last frame leaves, which would hold a shorted bus for ever
        can.bus.set_shorted(True)
        robot.run_us(300_000)
        robot.set_encoder_fault(0, EncoderFault.UNPLUGGED)
        robot.run_us(500_000)
        assert client.request(tp.StatusRequest()).state == tp.State.STOPPED
        robot.set_supply(2.9)
        robot.run_us(2_000)
        return Costs(
            braked_us,
            answers_us,
            resting[0],
            busy[0],
            bus_share,
            {n: cost for n, cost in robot.costs().items() if n},
            _stack_seen(robot),
            robot.stats().cpu_hz,
        )
