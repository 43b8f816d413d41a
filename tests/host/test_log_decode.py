"""Decoding logs: exact, quick, and a damaged block costs only itself."""

from __future__ import annotations

import json
import random
import time
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import truing_protocol as tp
from support.fake_log import code_log, drive_records
from truing.log import decode as log_decode
from truing.log.columns import run_from_records
from truing.log.decode import decode_log

NAMES = tp.LOG_RECORD_DTYPE.names
assert NAMES is not None
FIELDS = [
    st.integers(int(np.iinfo(tp.LOG_RECORD_DTYPE[n]).min), int(np.iinfo(tp.LOG_RECORD_DTYPE[n]).max))
    for n in NAMES
]


Records = list[tuple[int, ...]]


@pytest.fixture(params=["plain", "compiled"], autouse=True)
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Both ways of decoding must do all of this: short logs go one, long ones the other."""
    monkeypatch.setattr(log_decode, "_MANY_RECORDS", 0 if request.param == "compiled" else 10**9)
    return str(request.param)


def test_the_shared_block_decodes_to_its_records(root: Path) -> None:
    log = json.loads((root / "protocol/vectors/vectors.json").read_text())["log"]
    assert log["fields"] == list(NAMES)
    decoded = decode_log(bytes.fromhex(log["block"]), log["cell"] * tp.LOG_CELL_SIZE, log_id=7)
    assert not decoded.lost
    assert [list(row) for row in decoded.records.tolist()] == log["records"]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.tuples(*FIELDS), max_size=30),
    st.sampled_from([3.14e-8, 0.00016624259, 1.5707964]),
    st.sampled_from([1e-9, 9.3492346e-05, 12.5]),
    st.integers(1, 200),
)
def test_any_record_survives_coding(records: Records, metres: float, turns: float, rate_hz: int) -> None:
    coded = code_log(records, metres_per_count=metres, turns_per_count=turns, rate_hz=rate_hz)
    assert [tuple(r) for r in decode_log(coded).records.tolist()] == records


def repeated(data: bytes, times: int) -> bytes:
    """The same blocks again and again, each moved to where it then lies in its log."""
    out = b""
    starts = block_starts(data)
    records = 0
    for start, end in list(zip(starts, [*starts[1:], len(data)], strict=True)) * times:
        header = tp.LogHeader.unpack(data[start : start + tp.LogHeader.SIZE])
        body = data[start + tp.LogHeader.SIZE : start + header.used]
        moved = replace(header, cell=len(out) // tp.LOG_CELL_SIZE, first_record=records)
        crc = zlib.crc32(body, zlib.crc32(moved.pack()[:-4]))
        out += replace(moved, crc32=crc).pack() + body + bytes(end - start - header.used)
        records += header.records
    return out


def test_half_an_hour_at_20_hz_decodes_in_half_a_second(way: str) -> None:
    if way == "plain":
        pytest.skip("long logs go the other way")
    data = repeated(code_log(drive_records(1200)), 30)
    decode_log(data[: block_starts(data)[1]])
    began = time.process_time()
    decoded = decode_log(data)
    took = time.process_time() - began
    print(f"{len(decoded.records)} records in {took:.3f} s")
    assert len(decoded.records) == 36_000
    assert not decoded.lost
    assert took < 0.5


def test_a_short_log_decodes_at_once_without_compiling(way: str) -> None:
    if way == "compiled":
        pytest.skip("short logs go the other way")
    data = code_log(drive_records(181))
    began = time.process_time()
    assert len(decode_log(data).records) == 181
    assert time.process_time() - began < 0.1


def block_starts(data: bytes) -> list[int]:
    starts, at = [], 0
    while at < len(data):
        starts.append(at)
        used = tp.LogHeader.unpack(data[at : at + tp.LogHeader.SIZE]).used
        at += -(-used // tp.LOG_CELL_SIZE) * tp.LOG_CELL_SIZE
    return starts


@pytest.mark.parametrize("at", [6, 20, 60, 300])
def test_a_damaged_block_costs_its_own_records_and_is_named(at: int) -> None:
    records = drive_records(2000)
    data = bytearray(code_log(records, first_cell=16))
    starts = block_starts(data)
    assert len(starts) > 6
    counts = [tp.LogHeader.unpack(bytes(data[s : s + tp.LogHeader.SIZE])).records for s in starts]
    data[starts[2] + at] ^= 0x55
    hurt = decode_log(bytes(data), first_offset=1024)
    assert [lost.offset for lost in hurt.lost] == [1024 + starts[2]]
    assert hurt.lost[0].records == counts[2]
    kept = [tuple(row) for row in hurt.records.tolist()]
    assert kept == records[: sum(counts[:2])] + records[sum(counts[:3]) :]


@pytest.mark.parametrize("cut", [1, 5, 64, 100])
def test_bytes_that_vanished_cost_the_blocks_they_were_part_of(cut: int) -> None:
    """Cells that slide are found again only where they begin a cell; the rest is counted as lost."""
    records = drive_records(2000)
    data = code_log(records)
    third = block_starts(data)[2]
    hurt = decode_log(data[: third + 10] + data[third + 10 + cut :])
    assert hurt.lost
    assert {tuple(row) for row in hurt.records.tolist()} <= set(records)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**32 - 1))
def test_no_bytes_make_the_decoder_raise(seed: int) -> None:
    dice = random.Random(seed)
    data = bytearray(code_log(drive_records(60), full=100))
    for _ in range(dice.randrange(1, 40)):
        data[dice.randrange(len(data))] = dice.randrange(256)
    decode_log(bytes(data[: dice.randrange(len(data) + 1)]))
    decode_log(dice.randbytes(dice.randrange(2000)))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=300), st.integers(0, 400), st.floats(width=32), st.floats(width=32))
def test_no_block_with_a_right_crc_makes_the_decoder_raise(
    body: bytes, records: int, metres: float, turns: float
) -> None:
    used = tp.LogHeader.SIZE + len(body)
    values = (0, 1, used, records, tp.LOG_RECORD_VERSION, 0, 2**32 - 1, 0, 0, 0, metres, turns, 0)
    head = tp.LogHeader(*values, 0).pack()
    crc = zlib.crc32(body, zlib.crc32(head[:-4]))
    decode_log(tp.LogHeader(*values, crc).pack() + body + bytes(-used % tp.LOG_CELL_SIZE))


def test_another_logs_block_and_a_short_end_are_named() -> None:
    one, two = code_log(drive_records(20), log_id=1), code_log(drive_records(20), log_id=2)
    lost = decode_log(one + two[: len(two) - 64], log_id=1).lost
    assert "bytes of it are there" in lost[0].reason
    again = code_log(drive_records(20), log_id=2, first_cell=len(one) // tp.LOG_CELL_SIZE)
    assert decode_log(one + again, log_id=1).lost[0].reason == "belongs to log 2, not 1"


def test_a_block_from_elsewhere_is_named() -> None:
    data = code_log(drive_records(20), first_cell=7)
    assert "cell 7 lies where cell 0 should" in decode_log(data, first_offset=0).lost[0].reason
    assert not decode_log(data).lost


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
