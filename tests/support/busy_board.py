"""What the image costs its chip: the virtual board at rest and under the heaviest load a host can make."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import truing_protocol as tp
from hil_sim import VirtualRobot
from hil_sim.robot import EncoderFault, ExceptionCost
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream

BRAKED = ((1.0, 1.0), (1.0, 1.0))
SYSTICK = 15
CHUNK = 1020
BYTES_AHEAD = 400  # 4 ms of the line
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
    """Shares of the core's time, 0 to 1."""

    ticks: float
    awake: float


@dataclass(frozen=True)
class Costs:
    """What was seen of the image on the virtual board.

    Attributes
    ----------
    handlers : by exception number.
    stack : bytes of the stack that were ever written to.
    """

    braked_after_us: int
    answers_after_us: int
    resting: Load
    busy: Load
    handlers: dict[int, ExceptionCost]
    stack: int
    core_hz: int


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
    client.request(tp.SeqStartRequest(crc))


def _fill_the_line(client: Client, robot: VirtualRobot, until_us: int) -> None:
    """Both directions full: log bytes come up, and requests go down, answered or not, without a gap."""
    ends = client.request(tp.LogListRequest(0))
    offset = ends.oldest_offset
    while robot.time_us < until_us:
        client.post(tp.LogReadRequest(offset, min(CHUNK, ends.end_offset - offset)))
        offset = offset + CHUNK if offset + CHUNK < ends.end_offset else ends.oldest_offset
        while robot.link_pending() < BYTES_AHEAD:
            client.post(tp.StatusRequest())
        client.receive(0.002)
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


def measure(image: Path) -> Costs:
    """Power up, rest, drive with the line full both ways, and end it by a fault."""
    with VirtualRobot(image) as robot:
        while (robot.bridge(0), robot.bridge(1)) != BRAKED:
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
        with _load(robot) as busy:
            _fill_the_line(client, robot, robot.time_us + 3_000_000)
        robot.set_encoder_fault(0, EncoderFault.UNPLUGGED)
        robot.run_us(500_000)
        assert client.request(tp.StatusRequest()).state == tp.State.STOPPED
        return Costs(
            braked_us,
            answers_us,
            resting[0],
            busy[0],
            {n: cost for n, cost in robot.costs().items() if n},
            _stack_seen(robot),
            robot.stats().core_hz,
        )
