"""How much of the line a log's download uses, beside ZMODEM (`sz`, `rz`) over the same line."""

from __future__ import annotations

import tempfile
from pathlib import Path

from bench.figure import Figure
from hil_sim import VirtualRobot
from support.faulty_stream import FaultyStream
from support.zmodem import transfer
from truing.board.device import Device
from truing.board.drive import drive
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream
from truing.plan import parse_plan
from truing_protocol import MAX_PAYLOAD, LogReadReply

BAUD = 921_600
LINE_BYTES_PER_S = BAUD / 10
# A full frame: payload, the reply's own fields, id, sequence number and CRC, COBS and the zeros around it.
FRAME_BYTES = MAX_PAYLOAD + 7 + (MAX_PAYLOAD + 7) // 254 + 1 + 1
PAYLOAD_LIMIT = LINE_BYTES_PER_S * (MAX_PAYLOAD - LogReadReply.SIZE) / FRAME_BYTES
SHARES = (0.0, 0.0001, 0.001, 0.01)  # of the bytes, in both directions; half vanish, half change
SEED = 3
PATIENCE_S = 60.0
PLAN = {
    "log_rate_hz": 200,
    "segment": [
        {"duration_s": 3.0, "velocity_mps": [speed, speed / 2]}
        for speed in (0.2, 0.4, 0.3, 0.5)
        for _ in range(15)
    ],
}


def measure(root: Path) -> list[Figure]:
    """Fill a log of about 100 kB on the virtual board and fetch it in virtual time; `sz` takes real time."""
    figures = []
    with VirtualRobot(root / "build/stm32f405/firmware/truing-f405.elf") as robot:
        line = VirtualStream(robot)
        device = Device(Client(line))
        drive(device, parse_plan(PLAN, "long", "long"))
        log = device.log()
        for share in SHARES:
            data, report = Device(Client(FaultyStream(line, share, SEED))).read_log(log)
            speed = report.bytes_per_s / 1e3
            if share == 0:
                limit = PAYLOAD_LIMIT / 1e3
                name = f"log download, {report.bytes / 1e3:.0f} kB"
                figures.append(
                    Figure(name, speed, "kB/s", "more", 0.9 * limit, "the line's payload limit", limit)
                )
            figures.append(_beside_zmodem(share, speed, data))
    return figures


def _beside_zmodem(share: float, speed: float, data: bytes) -> Figure:
    with tempfile.TemporaryDirectory() as folder:
        done = transfer(data, Path(folder), LINE_BYTES_PER_S, share, SEED, PATIENCE_S)
    name = f"log download, {share:.2%} of the line's bytes spoiled"
    if not done.whole:
        return Figure(name, speed, "kB/s", "more", peer=f"sz/rz: not there after {PATIENCE_S:g} s")
    return Figure(name, speed, "kB/s", "more", peer="sz/rz", peer_value=len(data) / done.seconds / 1e3)
