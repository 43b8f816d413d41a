"""How much faster than real time the virtual board runs the flashed image."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bench.figure import Figure
from hil_sim import VirtualRobot
from truing.board.device import Device
from truing.board.drive import drive
from truing.link.client import Client
from truing.link.framing import Frame, FrameDecoder, encode
from truing.link.virtual_stream import VirtualStream
from truing.plan import load_plan
from truing_protocol import REPLY_BIT, LogReadRequest, StatusRequest

PLAN = "paper/XI"
# ArduPilot's account of Renode's STM32F405: 5 to 33 times slower than real time; the better end is the peer.
RENODE = "Renode's F405 (ArduPilot), at best"
RENODE_SPEED = 1 / 5
LINE_BYTES_PER_S = 921_600 / 10
SLICE_US = 1000
# The best of these counts: other programs on the machine only ever slow a run down.
ROUNDS = 3


def measure(root: Path) -> list[Figure]:
    """Drive the demo's plan as a user does, with both lanes of the link full, and asked for too much."""
    image = root / "build/stm32f405/firmware/truing-f405.elf"
    full = _best(lambda: _drive_saturated(image, reads_under_way=4, filler=_broken_frame()))
    flooded = _best(lambda: _drive_saturated(image, reads_under_way=4, filler=_frame(StatusRequest(), 0)))
    alone = max(_speed_of_demo(image) for _ in range(ROUNDS))
    return [
        _speed(f"virtual board, {PLAN}", alone, bar=10),
        _speed("virtual board, link saturated", full.speed, bar=3),
        _lane("its link, host to board", full.received_bytes_per_s),
        _lane("its link, board to host", full.sent_bytes_per_s),
        _speed("virtual board, more asked than the line can answer", flooded.speed, bar=None),
    ]


def _speed(name: str, value: float, bar: float | None) -> Figure:
    return Figure(name, value, "x real time", "more", bar, RENODE, RENODE_SPEED)


def _lane(name: str, bytes_per_s: float) -> Figure:
    return Figure(name, bytes_per_s / 1e3, "kB/s", "more", peer="the line", peer_value=LINE_BYTES_PER_S / 1e3)


def _frame(request: LogReadRequest | StatusRequest, sequence: int) -> bytes:
    return encode(Frame(request.ID, sequence, request.pack()))


def _broken_frame() -> bytes:
    """A frame that the board reads to its end and then throws away."""
    whole = bytearray(encode(Frame(StatusRequest.ID, 0, bytes(range(1, 101)))))
    whole[50] ^= 1
    return bytes(whole)


def _speed_of_demo(image: Path) -> float:
    """Virtual seconds per second from power-on over upload and drive to the sequence's end."""
    began = time.perf_counter()
    with VirtualRobot(image) as robot, Device(Client(VirtualStream(robot))) as device:
        drive(device, load_plan(PLAN))
        return robot.time_s / (time.perf_counter() - began)


@dataclass(frozen=True)
class Saturated:
    """What a drive with a full link came to; `speed` in virtual seconds per second."""

    speed: float
    received_bytes_per_s: float
    sent_bytes_per_s: float


def _best(drive_once: Callable[[], Saturated]) -> Saturated:
    return max((drive_once() for _ in range(ROUNDS)), key=lambda one: one.speed)


def _drive_saturated(image: Path, reads_under_way: int, filler: bytes) -> Saturated:
    """Drive the plan while log reads keep one lane full and `filler` the rest of the other."""
    with VirtualRobot(image) as robot, Device(Client(VirtualStream(robot))) as device:
        plan = load_plan(PLAN)
        drive(device, plan)  # leaves a log to read while the plan runs again
        log = device.log()
        device.start(device.upload(plan), unattended=True)

        read = LogReadRequest(offset=log.offset, length=min(1000, log.length))
        decoder = FrameDecoder()
        asked = answered = written = 0
        began, began_s = time.perf_counter(), robot.time_s
        while robot.time_s - began_s < plan.duration_s:
            while asked - answered < reads_under_way:
                asked += 1
                written += _send(robot, _frame(read, asked & 0xFFFF))
            while robot.link_pending() < 2 * SLICE_US * 1e-6 * LINE_BYTES_PER_S:
                written += _send(robot, filler)
            robot.run_us(SLICE_US)
            answered += sum(frame.id == read.ID | REPLY_BIT for frame in decoder.feed(robot.link_read()))
        span_s = robot.time_s - began_s
        speed = span_s / (time.perf_counter() - began)
        return Saturated(speed, (written - robot.link_pending()) / span_s, decoder.counts.bytes / span_s)


def _send(robot: VirtualRobot, data: bytes) -> int:
    robot.link_write(data)
    return len(data)
