"""How long a drive the board's memory holds."""

from __future__ import annotations

from pathlib import Path

from bench.figure import Figure
from hil_sim import VirtualRobot
from support.paper_drives import drive_paper
from truing_protocol import LOG_RECORD_DTYPE


def measure(root: Path) -> list[Figure]:
    """Drive the paper's tests again and again until the first log is gone, and decode what is there."""
    with VirtualRobot(root / "build/stm32f405/firmware/truing-f405.elf", seed=3) as robot:
        held = drive_paper(robot)
    assert held.came_round
    raw = LOG_RECORD_DTYPE.itemsize
    name = f"log memory ({held.memory / 1024:.1f} KiB): the paper's tests at 20 Hz"
    return [
        Figure(name, held.minutes, "min", "more", 30, "as plain integers", held.memory / raw / 20 / 60),
        *(
            Figure(f"a record of the log, {mode} mode", held.bytes_per_record[mode], "B", "less", None,
                   "as plain integers", raw)
            for mode in ("effort", "velocity")
        ),
    ]  # fmt: skip
