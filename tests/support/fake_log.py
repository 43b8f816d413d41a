"""Coded logs for tests, by the coder that also makes the protocol's vectors."""

from __future__ import annotations

import random
import sys
from pathlib import Path

import truing_protocol as tp
from support.fake_board import FakeBoard, FakeLog

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "protocol"))

from generator import log_coder

Record = tuple[int, ...]
# The paper's robot, in single precision as the board has it.
METRES_PER_COUNT, TURNS_PER_COUNT = 0.00016624259355012327, 9.349234460387379e-05


def code_log(
    records: list[Record],
    log_id: int = 1,
    first_cell: int = 0,
    *,
    full: int = 560,
    metres_per_count: float = METRES_PER_COUNT,
    turns_per_count: float = TURNS_PER_COUNT,
    rate_hz: int = 20,
) -> bytes:
    """Whole sealed blocks; a block is closed when its records have taken `full` bytes."""
    log = log_coder.LogFormat(metres_per_count, turns_per_count, rate_hz, log_id)
    return log_coder.code_log([list(record) for record in records], log, first_cell, full)


def drive_records(count: int, seed: int = 1) -> list[Record]:
    """Records as a robot at 20 Hz might log them."""
    dice = random.Random(seed)
    rows = []
    for i in range(count):
        counts = 150 * i + dice.randrange(-3, 4)
        speed = 498 + dice.randrange(-6, 7)
        rows.append(
            (50 * i, 1, i // 40, 0, 3500, 3500, 3500, 3500 - dice.randrange(3),
             counts, counts + 4, speed, speed + 3, 25 * i, dice.randrange(-2, 3), 7 * i, 1200 - i // 30)
        )  # fmt: skip
    return rows


def noisy_records(count: int) -> list[Record]:
    """The same on a robot with bad sensors: some seven bytes a record."""
    dice = random.Random(3)
    rows = []
    for row in drive_records(count):
        noise = [dice.randrange(-40, 41) for _ in row]
        noise[0:6] = [0] * 6
        rows.append(tuple(value + off for value, off in zip(row, noise, strict=True)))
    return rows


def board_with_log(count: int = 1200, first_cell: int = 24, log_id: int = 4) -> FakeBoard:
    """A board whose ring holds one log of that many records."""
    data = code_log(noisy_records(count), log_id, first_cell)
    entry = tp.LogEntry(
        log_id,
        tp.LogEnd.FINISHED,
        0,
        20,
        first_cell,
        len(data) // tp.LOG_CELL_SIZE,
        count,
        1000,
        1000 + 50 * count,
        0,
    )
    return FakeBoard(logs=[FakeLog(entry, data)])
