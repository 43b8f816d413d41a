"""Decoding logs: exact, quick, and a damaged block costs only itself."""

from __future__ import annotations

import json
import random
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import truing_protocol as tp
from support.fake_log import code_log, drive_records
from truing.log_columns import run_from_records
from truing.log_decode import decode_log

NAMES = tp.LOG_RECORD_DTYPE.names
assert NAMES is not None
FIELDS = [
    st.integers(int(np.iinfo(tp.LOG_RECORD_DTYPE[n]).min), int(np.iinfo(tp.LOG_RECORD_DTYPE[n]).max))
    for n in NAMES
]


def test_the_shared_vectors_decode_to_their_records(root: Path) -> None:
    log = json.loads((root / "protocol/vectors/vectors.json").read_text())["log"]
    assert log["fields"] == list(NAMES)
    coded = code_log([tuple(record) for record in log["records"]])
    decoded = decode_log(coded)
    assert not decoded.lost
    assert [list(row) for row in decoded.records.tolist()] == log["records"]


@given(st.lists(st.tuples(*FIELDS), max_size=30))
def test_any_record_survives_coding(records: list[tuple[int, ...]]) -> None:
    assert [tuple(r) for r in decode_log(code_log(records)).records.tolist()] == records


def test_five_thousand_records_decode_in_under_a_third_of_a_second() -> None:
    data = code_log(drive_records(5000))
    decode_log(data[:512])
    began = time.perf_counter()
    decoded = decode_log(data)
    took = time.perf_counter() - began
    assert len(decoded.records) == 5000
    assert took < 0.3, f"{took:.3f} s"


def test_a_damaged_block_costs_its_own_records_and_is_named() -> None:
    records = drive_records(600)
    data = bytearray(code_log(records))
    blocks = len(data) // tp.LOG_BLOCK_SIZE
    assert blocks > 6
    whole = decode_log(bytes(data))
    data[2 * tp.LOG_BLOCK_SIZE + 6 : 2 * tp.LOG_BLOCK_SIZE + 8] = b"\xff\xff"
    hurt = decode_log(bytes(data), first_offset=1024)
    assert [lost.offset for lost in hurt.lost] == [1024 + 2 * tp.LOG_BLOCK_SIZE]
    assert "claims 65535 bytes" in hurt.lost[0].reason
    kept = set(map(tuple, hurt.records.tolist()))
    assert kept < set(map(tuple, whole.records.tolist()))
    assert len(kept) > len(records) * (blocks - 2) // blocks


@given(st.integers(0, 2**32 - 1))
def test_no_bytes_make_the_decoder_raise(seed: int) -> None:
    dice = random.Random(seed)
    data = bytearray(code_log(drive_records(60)))
    for _ in range(dice.randrange(1, 40)):
        data[dice.randrange(len(data))] = dice.randrange(256)
    decode_log(bytes(data[: dice.randrange(len(data) + 1)]))
    decode_log(dice.randbytes(dice.randrange(2000)))


def test_another_logs_block_and_a_short_end_are_named() -> None:
    data = code_log(drive_records(20), log_id=1) + code_log(drive_records(20), log_id=2)[:100]
    lost = decode_log(data, log_id=1).lost
    assert lost[0].reason == "only 100 bytes of it are there"
    data = code_log(drive_records(20), log_id=1) + code_log(drive_records(20), log_id=2)
    assert decode_log(data, log_id=1).lost[0].reason == "belongs to log 2, not 1"


def test_columns_are_the_integers_in_si_units() -> None:
    decoded = decode_log(code_log(drive_records(50)))
    run = run_from_records(decoded.records, "run")
    last = decoded.records[-1]
    assert run.t_s[-1] == last["t_ms"] / 1000 == pytest.approx(2.45)
    assert run.columns["effort_left"][-1] == 0.35
    assert run.columns["cmd_right"][-1] == 0.35
    assert run.columns["vel_left_mps"][-1] == last["speed_left"] / 1000
    assert run.columns["ticks_left"][0] == 0
    assert run.columns["theta_rad"][-1] == last["theta_e4"] / 10_000
    assert run.columns["battery_v"][-1] == last["battery_10mv"] / 100
    assert set(run.mode or ()) == {"effort"}


def test_a_velocity_command_is_in_metres_per_second() -> None:
    records = np.zeros(2, tp.LOG_RECORD_DTYPE)
    records["mode"] = [tp.Mode.VELOCITY, tp.Mode.EFFORT]
    records["cmd_left"] = [350, 3500]
    run = run_from_records(records, "run")
    assert run.columns["cmd_left"].tolist() == [0.35, 0.35]
