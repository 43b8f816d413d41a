"""`sz` and `rz` (lrzsz) over a line of a given speed that damages bytes, in real time."""

from __future__ import annotations

import random
import select
import socket
import subprocess
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

STEP_S = 0.002
# What an adapter's driver would take. (Not a pseudo-terminal: there `sz` flushes its own last two bytes.)
AHEAD = 512


@dataclass
class Lane:
    """One direction: bytes enter when there is room and leave at the line's pace."""

    bytes_per_s: float
    share: float
    dice: random.Random
    waiting: bytearray = field(default_factory=bytearray)
    credit: float = 0.0

    def enter(self, data: bytes) -> None:
        """Half of the spoiled bytes vanish, the others change."""
        for byte in data:
            if self.dice.random() >= self.share:
                self.waiting.append(byte)
            elif self.dice.random() < 0.5:
                self.waiting.append(byte ^ self.dice.randrange(1, 256))

    def leave(self, passed_s: float) -> bytes:
        """What has got through after so much more time."""
        self.credit = min(self.credit + passed_s * self.bytes_per_s, len(self.waiting))
        count = int(self.credit)
        out = bytes(self.waiting[:count])
        del self.waiting[:count]
        self.credit -= count
        return out


@dataclass(frozen=True)
class Transfer:
    """How long it took, s; `whole` is false when it was given up or arrived damaged."""

    seconds: float
    whole: bool


def transfer(
    content: bytes, folder: Path, bytes_per_s: float, share: float, seed: int, patience_s: float
) -> Transfer:
    """Send `content` from one process to the other, as a board's log would be fetched with ZMODEM."""
    source, target = folder / "log.bin", folder / "arrived"
    source.write_bytes(content)
    target.mkdir(exist_ok=True)
    with ExitStack() as stack:
        ends = []
        for command, where in ((["sz", "-b", "-q", str(source)], folder), (["rz", "-b", "-q", "-y"], target)):
            near, far = (stack.enter_context(end) for end in socket.socketpair())
            process = subprocess.Popen(
                command, stdin=far, stdout=far, stderr=subprocess.DEVNULL, cwd=where, start_new_session=True
            )
            near.setblocking(False)
            stack.callback(process.wait)
            stack.callback(process.kill)
            ends.append((near, process))
        seconds = _carry(ends, bytes_per_s, share, seed, patience_s)
    arrived = target / source.name
    return Transfer(seconds, arrived.is_file() and arrived.read_bytes() == content)


def _carry(
    ends: list[tuple[socket.socket, subprocess.Popen[bytes]]],
    bytes_per_s: float,
    share: float,
    seed: int,
    patience_s: float,
) -> float:
    """Carry bytes both ways until both ends have left; return how long that took."""
    lanes = [Lane(bytes_per_s, share, random.Random(seed + side)) for side in range(2)]
    began = last = time.perf_counter()
    while any(process.poll() is None for _, process in ends) and last - began < patience_s:
        select.select([near for near, _ in ends], [], [], STEP_S)
        now = time.perf_counter()
        for side, lane in enumerate(lanes):
            if len(lane.waiting) < AHEAD:
                lane.enter(_read(ends[side][0]))
            _write(ends[1 - side][0], lane.leave(now - last))
        last = now
        time.sleep(STEP_S)
    return last - began


def _read(near: socket.socket) -> bytes:
    try:
        return near.recv(AHEAD)
    except OSError:  # nothing there, or the process has left
        return b""


def _write(near: socket.socket, data: bytes) -> None:
    try:
        near.send(data)
    except OSError:
        return
