"""The paper's test plan, driven again and again with its rests, and how much of it the log's ring holds."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

from truing.board.device import Device
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream
from truing.log.decode import decode_log
from truing.plan import Kind, built_in_names, load_plan

PAPER_RATE_HZ = 20
BOOT_US, PAUSE_US = 500_000, 200_000


@dataclass(frozen=True)
class Held:
    """What the board's logs are; `bytes_per_record` is by mode, headers and whole cells included."""

    rate_hz: int
    records: int
    memory: int
    bytes_per_record: dict[str, float]
    came_round: bool

    @property
    def minutes(self) -> float:
        """Of driving that is in memory."""
        return self.records / self.rate_hz / 60

    @property
    def minutes_when_full(self) -> float:
        """The same, had the drives gone on until the memory was full."""
        return self.memory / self.bytes_per_record["all"] / self.rate_hz / 60


def drive_paper(robot: Any, rounds: int | None = None, rate_hz: int = PAPER_RATE_HZ) -> Held:
    """Drive tests I to XVII `rounds` times, or until the first log is gone; fetch and decode what is there.

    Parameters
    ----------
    robot : just switched on; a virtual robot with the flashed image, or a host robot.
    rate_hz : of the logs; the paper's rate by default.
    """
    plans = [load_plan(name) for name in built_in_names() if name.startswith("paper/")]
    assert len(plans) == 17
    modes: dict[int, str] = {}
    took: Counter[str] = Counter()
    counted: Counter[str] = Counter()
    robot.run_us(BOOT_US)
    with Device(Client(VirtualStream(robot))) as device:
        driven = 0
        while driven != rounds and not (driven and device.logs()[0].log_id > 1):
            driven += 1
            for plan in plans:
                assert plan.log_rate_hz == PAPER_RATE_HZ
                sequence = device.upload(replace(plan, log_rate_hz=rate_hz))
                log_id = device.start(sequence, unattended=True)
                velocity = any(segment.kind is Kind.VELOCITY for segment in plan.segments)
                modes[log_id] = "velocity" if velocity else "effort"
                robot.run_us(round(plan.duration_s * 1e6) + PAUSE_US)
        logs = device.logs()
        for log in logs:
            data, _ = device.read_log(log)
            decoded = decode_log(data, log.offset, log.log_id)
            assert not decoded.lost
            for name in ("all", modes[log.log_id]):
                took[name] += len(data)
                counted[name] += len(decoded.records)
    each = {name: took[name] / counted[name] for name in took}
    return Held(rate_hz, counted["all"], device.info.log_bytes, each, logs[0].log_id > 1)
