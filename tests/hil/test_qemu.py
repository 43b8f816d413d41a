"""The flashed image on QEMU's STM32F405: it boots, talks, and will not move what it cannot feel.

QEMU's model has no clock tree, no converting ADC, no unique id, and counters that run by themselves; its
SysTick ticks some ten times too fast. The image knows nothing of that: each is a fault that a real board can
have too.
"""

from __future__ import annotations

import random
import shutil
import struct
import time
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile

import truing_protocol as tp
from support.qemu import NETDUINO, OLIMEX, Qemu
from truing.errors import Refused
from truing.link.client import Client
from truing.link.refusals import faults_in

pytestmark = pytest.mark.qemu

TIM2_CNT = 0x40000024
# What start-up fills the stack with.
STACK_PAINT = bytes.fromhex("c5c5c5c5")
SEGMENTS = tuple(tp.Segment(tp.SegmentKind.EFFORT, 2000, level, level) for level in (0.35, 0.50, 0.45, 0.0))


@pytest.fixture(scope="module", params=[NETDUINO, OLIMEX], ids=lambda model: model.machine)
def qemu(image: Path, request: pytest.FixtureRequest) -> Iterator[Qemu]:
    if shutil.which(NETDUINO.program) is None:
        pytest.fail("qemu-system-arm is not installed; run ./run setup", pytrace=False)
    if shutil.which(request.param.program) is None:
        pytest.skip("QEMU 10 could not be had from Debian's backports; rm -r .cache/qemu-10 to try again")
    with Qemu(image, request.param) as running:
        yield running


@pytest.fixture
def board(qemu: Qemu) -> Iterator[Client]:
    client = qemu.connect()
    yield client
    client.close()


def hello(board: Client) -> tp.HelloReply:
    return board.request(tp.HelloRequest(tp.PROTOCOL_VERSION, tp.SCHEMA_HASH))


def upload(board: Client) -> int:
    """Upload `SEGMENTS`; return their CRC."""
    crc = zlib.crc32(b"".join(segment.pack() for segment in SEGMENTS))
    board.request(tp.SeqBeginRequest(len(SEGMENTS), 0))
    board.request(tp.SeqSegmentsRequest(0, SEGMENTS))
    board.request(tp.SeqCommitRequest(crc))
    return crc


def test_it_boots_and_says_who_it_is(qemu: Qemu, board: Client) -> None:
    reply = hello(board)
    print(f"hello {time.monotonic() - qemu.started_at:.3f} s after QEMU was started")
    assert reply.protocol_version == tp.PROTOCOL_VERSION
    assert reply.schema_hash == tp.SCHEMA_HASH
    assert reply.parameter_count == len(tp.PARAMETERS)


def test_it_reports_what_the_chip_under_it_lacks(board: Client) -> None:
    reply = hello(board)
    assert reply.clock_source == tp.ClockSource.INTERNAL
    assert reply.board_id == (0,) * 12
    active = {fault.name for fault in faults_in(board.request(tp.StatusRequest()).faults_active)}
    assert "clock_fallback" in active
    assert "battery_unread" in active


def test_a_loop_overrun_is_the_models_two_clocks(qemu: Qemu, board: Client) -> None:
    """The image has set TIM2 to microseconds and SysTick to a millisecond of 16 MHz.

    The model's SysTick runs from 168 MHz and its TIM2 from 1 GHz: one counts 95 us, the other 16 ns each.
    """
    ticks, counts = [], []
    for _ in range(2):
        ticks.append(board.request(tp.StatusRequest()).uptime_ms)
        with qemu.debugger() as processor:
            counts.append(struct.unpack("<I", processor.read_memory(TIM2_CNT, 4))[0])
        time.sleep(0.5)
    per_tick = (counts[1] - counts[0]) % 2**32 / (ticks[1] - ticks[0])
    print(f"{per_tick:.0f} counts of TIM2 a tick")
    assert per_tick > 1500, "so each tick seems to come more than 1.5 ms after the one before"
    active = {fault.name for fault in faults_in(board.request(tp.StatusRequest()).faults_active)}
    assert "loop_overrun" in active


def test_it_lists_the_parameters_of_the_schema(board: Client) -> None:
    for info in tp.PARAMETERS:
        reply = board.request(tp.ParamListRequest(info.index))
        assert (reply.name, reply.unit, reply.kind) == (info.name, info.unit, info.kind)
        assert (reply.minimum, reply.maximum) == pytest.approx((info.minimum, info.maximum))
        assert reply.value == pytest.approx(info.default)


def test_it_sets_a_parameter_and_refuses_a_bad_value_by_name(board: Client) -> None:
    index = next(p.index for p in tp.PARAMETERS if p.name == "log_rate_hz")
    assert board.request(tp.ParamSetRequest(index, 50.0)).value == 50.0
    with pytest.raises(Refused) as caught:
        board.request(tp.ParamSetRequest(index, 1e9))
    assert caught.value.reason == "out_of_range"
    with pytest.raises(Refused) as caught:
        board.request(tp.ParamSetRequest(index, float("nan")))
    assert caught.value.reason == "not_finite"
    assert board.request(tp.ParamGetRequest(index)).value == 50.0


def test_it_accepts_a_sequence(board: Client) -> None:
    crc = upload(board)
    state = board.request(tp.SeqStateRequest())
    assert state.sequence_state == tp.SequenceState.READY
    assert state.crc32 == crc
    assert state.duration_ms == 8000


def test_it_does_not_start_and_names_encoders_and_supply(board: Client) -> None:
    crc = upload(board)
    hello = board.request(tp.HelloRequest(tp.PROTOCOL_VERSION, tp.SCHEMA_HASH))
    board.request(tp.ArmRequest(hello.boot_id))
    with pytest.raises(Refused) as caught:
        board.request(tp.SeqStartRequest(crc, 1))
    assert caught.value.reason in ("self_check_failed", "fault_latched")
    for fault in ("encoder_left_implausible", "encoder_right_implausible", "battery_unread"):
        assert fault in caught.value.message
    status = board.request(tp.StatusRequest())
    assert status.effort_e4 == (0, 0)
    assert board.request(tp.SeqStateRequest()).sequence_state == tp.SequenceState.READY


def test_it_does_not_turn_the_wheels_by_hand_either(board: Client) -> None:
    with pytest.raises(Refused):
        board.request(tp.SetEffortRequest(0.3, 0.3))
    assert board.request(tp.StatusRequest()).effort_e4 == (0, 0)


def test_noise_on_the_line_delays_no_request(board: Client) -> None:
    noise = random.Random(4).randbytes(20_000)
    for at in range(0, len(noise), 1000):
        board.stream.write(noise[at : at + 1000])
        assert hello(board).schema_hash == tp.SCHEMA_HASH
    assert board.request(tp.StatusRequest()).frames_dropped > 0


def test_requests_sent_in_one_go_are_answered_in_order(board: Client) -> None:
    sent = [board.post(tp.ParamListRequest(info.index)) for info in tp.PARAMETERS]
    got: list[int] = []
    until = time.monotonic() + 10.0
    while len(got) < len(sent) and time.monotonic() < until:
        got += [frame.sequence for frame in board.receive(0.2)]
    assert got == sent


def test_half_of_the_stack_stays_unused(qemu: Qemu, board: Client, image: Path) -> None:
    with image.open("rb") as file:
        symbols = ELFFile(file).get_section_by_name(".symtab")
        limit, top = (
            symbols.get_symbol_by_name(name)[0]["st_value"] for name in ("__stack_limit", "__stack_top")
        )
    upload(board)
    with qemu.debugger() as processor:
        stack = b"".join(processor.read_memory(at, 1024) for at in range(limit, top, 1024))
    untouched = next(i for i in range(0, len(stack), 4) if stack[i : i + 4] != STACK_PAINT)
    print(f"{len(stack) - untouched} of {len(stack)} bytes of stack used")
    assert untouched >= len(stack) // 2


def test_a_reset_gives_another_boot_id(qemu: Qemu, board: Client) -> None:
    before = hello(board).boot_id
    qemu.reset()
    time.sleep(0.5)
    assert hello(board).boot_id != before


def test_flash_that_takes_nothing_refuses_a_save_by_name(board: Client) -> None:
    before = hello(board).boot_id
    with pytest.raises(Refused) as caught:
        board.request(tp.ParamSaveRequest(), first_wait_s=3.0)
    assert caught.value.reason == "store_failed"
    assert board.request(tp.ParamStoreRequest()).sequence == 0
    assert hello(board).boot_id == before
