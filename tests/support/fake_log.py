"""Coded logs for tests: the board's coding written a second time, from SPEC.md."""

from __future__ import annotations

import random

import truing_protocol as tp
from support.fake_board import FakeBoard, FakeLog, pack_block

Record = tuple[int, ...]


def code_record(record: Record, last: list[int], before: list[int]) -> bytes:
    """One record's mask and varints; moves the history on."""
    mask, body = 0, b""
    for i, value in enumerate(record):
        predicted = 2 * last[i] - before[i] if tp.LOG_PREDICT_LINE[i] else last[i]
        difference = (value - predicted + 2**31) % 2**32 - 2**31
        if difference:
            mask |= 1 << i
            code = (difference << 1) ^ (difference >> 31)
            code &= 0xFFFF_FFFF
            while code >= 0x80:
                body += bytes([code & 0x7F | 0x80])
                code >>= 7
            body += bytes([code])
        before[i], last[i] = last[i], value
    return mask.to_bytes(2, "little") + body


def code_log(records: list[Record], log_id: int = 1, first_block: int = 0) -> bytes:
    """Whole sealed blocks."""
    blocks: list[bytes] = []
    fields = len(tp.LOG_PREDICT_LINE)
    held: list[bytes] = []
    last, before = [0] * fields, [0] * fields
    for record in records:
        trial_last, trial_before = list(last), list(before)
        coded = code_record(record, trial_last, trial_before)
        if tp.LogHeader.SIZE + sum(map(len, held)) + len(coded) > tp.LOG_BLOCK_SIZE:
            blocks.append(pack_block(first_block + len(blocks), log_id, held))
            held, trial_last, trial_before = [], [0] * fields, [0] * fields
            coded = code_record(record, trial_last, trial_before)
        held.append(coded)
        last, before = trial_last, trial_before
    if held:
        blocks.append(pack_block(first_block + len(blocks), log_id, held))
    return b"".join(blocks)


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


def board_with_log(count: int = 1200, first_block: int = 3, log_id: int = 4) -> FakeBoard:
    """A board whose ring holds one log of that many records."""
    data = code_log(drive_records(count), log_id, first_block)
    entry = tp.LogEntry(
        log_id,
        tp.LogEnd.FINISHED,
        0,
        20,
        first_block,
        len(data) // tp.LOG_BLOCK_SIZE,
        count,
        1000,
        1000 + 50 * count,
        0,
    )
    return FakeBoard(logs=[FakeLog(entry, data)])
