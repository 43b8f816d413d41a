"""How much of the line a log's download uses."""

from __future__ import annotations

from pathlib import Path

from bench.figure import Figure
from hil_sim import VirtualRobot
from truing.device import Device
from truing.drive import drive
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream
from truing.plan import parse_plan
from truing_protocol import MAX_PAYLOAD, LogReadReply

BAUD = 921_600
# A full frame: payload, the reply's own fields, id, sequence number and CRC, COBS and the zeros around it.
FRAME_BYTES = MAX_PAYLOAD + 7 + (MAX_PAYLOAD + 7) // 254 + 1 + 1
PAYLOAD_LIMIT = BAUD / 10 * (MAX_PAYLOAD - LogReadReply.SIZE) / FRAME_BYTES


def measure(root: Path) -> list[Figure]:
    """Fill a log of about 40 kB on the virtual board and fetch it in virtual time."""
    plan = parse_plan(
        {"log_rate_hz": 200, "segment": [{"duration_s": 10.0, "effort": [0.3, 0.2]}]}, "long", "long"
    )
    with (
        VirtualRobot(root / "build/stm32f405/firmware/truing-f405.elf") as robot,
        Device(Client(VirtualStream(robot))) as device,
    ):
        drive(device, plan)
        report = device.read_log(device.log())[1]
    return [
        Figure(
            f"log download, {report.bytes / 1e3:.0f} kB",
            report.bytes_per_s / 1e3,
            "kB/s",
            "more",
            peer="the line's payload limit",
            peer_value=PAYLOAD_LIMIT / 1e3,
        )
    ]
