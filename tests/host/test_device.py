"""The device: typed commands, and errors that say what to do."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

import truing_protocol as tp
from support.fake_board import FakeBoard, FakeLine
from support.faulty_stream import FaultyStream
from truing.board.device import Device
from truing.board.drive import Interrupts, drive
from truing.errors import (
    BoardFault,
    BoardRebooted,
    Interrupted,
    LinkClosed,
    LinkTimeout,
    ProtocolMismatch,
    Refused,
    TruingError,
)
from truing.link.client import Client
from truing.link.framing import Frame
from truing.plan import Kind, Plan, Segment, load_plan


def open_on(board: FakeBoard) -> Device:
    return Device(Client(FakeLine(board)))


def test_hello_says_who_the_board_is() -> None:
    info = open_on(FakeBoard()).info
    assert info.board_id == "000102030405060708090a0b"
    assert info.firmware_version == "0.0-fake"
    assert info.clock_source == "crystal_pll"


@pytest.mark.parametrize(
    ("board", "hint"),
    [
        (FakeBoard(protocol_version=tp.PROTOCOL_VERSION + 1), "update truing"),
        (FakeBoard(protocol_version=tp.PROTOCOL_VERSION - 1), "firmware is older"),
        (FakeBoard(schema_hash=0x1234), "built together"),
    ],
)
def test_another_version_is_told_with_both_sides_and_what_to_do(board: FakeBoard, hint: str) -> None:
    with pytest.raises(ProtocolMismatch) as caught:
        open_on(board)
    assert f"{board.schema_hash:08x}" in str(caught.value)
    assert f"{tp.SCHEMA_HASH:08x}" in str(caught.value)
    assert hint in caught.value.next_step
    assert board.handled == ["hello"], "nothing but hello may be sent to a board of another version"


def test_a_later_version_with_a_longer_hello_is_still_understood_as_one() -> None:
    class Later(FakeBoard):
        def hello(self, request: tp.HelloRequest) -> bytes:
            return super().hello(request) + b"more"

    with pytest.raises(ProtocolMismatch):
        open_on(Later(protocol_version=9))


def test_silence_and_noise_on_the_port_are_told_apart() -> None:
    with pytest.raises(LinkTimeout, match="not one byte came"):
        open_on(FakeBoard(silent=True))

    class Terminal(FakeLine):
        def read(self, timeout_s: float) -> bytes:
            self.sleep(timeout_s)
            return b"login: "

    with pytest.raises(LinkTimeout, match="bytes came, and no frame"):
        Device(Client(Terminal(FakeBoard())))


def test_all_parameters_are_listed_with_the_schemas_names() -> None:
    parameters = open_on(FakeBoard()).parameters()
    assert list(parameters) == [p.name for p in tp.PARAMETERS]
    assert parameters["wheelbase_m"].text == "0.283"
    assert parameters["wheelbase_m"].info.doc


def test_a_parameter_is_set_by_name() -> None:
    board = FakeBoard()
    device = open_on(board)
    assert device.set_parameter("wheelbase_m", 0.3).text == "0.3"
    assert device.get_parameter("wheelbase_m").value == pytest.approx(0.3)


def test_a_parameter_out_of_its_limits_is_refused_with_the_limits() -> None:
    with pytest.raises(Refused, match=r"wheelbase_m = 9: it must lie within 0.02 to 5 m"):
        open_on(FakeBoard()).set_parameter("wheelbase_m", 9)


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e300])
def test_what_is_no_single_precision_number_is_not_sent(value: float) -> None:
    board = FakeBoard()
    with pytest.raises(TruingError, match="wheelbase_m"):
        open_on(board).set_parameter("wheelbase_m", value)
    assert "param_set" not in board.handled


def test_a_mistyped_parameter_gets_a_suggestion() -> None:
    with pytest.raises(TruingError) as caught:
        open_on(FakeBoard()).set_parameter("wheel_base", 0.3)
    assert "wheelbase_m" in caught.value.next_step


def test_a_plan_of_any_length_arrives_whole_on_a_bad_line() -> None:
    board = FakeBoard()
    device = Device(Client(FaultyStream(FakeLine(board), share=0.01, seed=4)))
    plan = Plan("long", "long", tuple(Segment(Kind.EFFORT, 0.1, i / 256, -i / 256) for i in range(256)))
    uploaded = device.upload(plan)
    assert uploaded.duration_s == pytest.approx(25.6)
    assert len(board.sequence) == 256 * tp.Segment.SIZE
    assert device.client.counts.retries > 0


def test_a_plan_longer_than_this_boards_memory_is_refused_here() -> None:
    class Small(FakeBoard):
        def hello(self, request: tp.HelloRequest) -> bytes:
            reply = bytearray(super().hello(request))
            reply[58:60] = (3).to_bytes(2, "little")
            return bytes(reply)

    with pytest.raises(TruingError, match="more than the 3"):
        open_on(Small()).upload(load_plan("paper/XI"))


def test_a_drive_runs_to_its_end_and_reports_progress() -> None:
    board = FakeBoard()
    seen: list[float] = []
    driven = drive(open_on(board), load_plan("paper/XI"), progress=seen.append)
    assert driven.log_id == 1
    assert board.now_s > 9.0
    assert seen[-1] == 1.0
    assert len(seen) > 20


def test_a_start_waits_for_wheels_that_still_roll_but_not_for_ever_nor_for_anything_else() -> None:
    left = next(fault.mask for fault in tp.FAULTS if fault.name == "encoder_left_implausible")
    supply = next(fault.mask for fault in tp.FAULTS if fault.name == "battery_low")
    for bits, at_least, at_most in ((left, 2.0, 3.0), (left | supply, 0.0, 0.1), (supply, 0.0, 0.1)):
        board = FakeBoard(refuse={"seq_start": (tp.RefusalReason.SELF_CHECK_FAILED, bits)})
        device = open_on(board)
        sequence = device.upload(load_plan("paper/I"))
        began = board.now_s
        with pytest.raises(Refused, match="self_check_failed"):
            device.start(sequence)
        assert at_least <= board.now_s - began <= at_most


def test_an_interrupt_stops_the_wheels_at_once_and_says_so() -> None:
    board = FakeBoard()
    interrupts = Interrupts()
    said: list[str] = []

    def after_three_seconds(_share: float) -> None:
        interrupts.requested = board.now_s > 3.0

    with pytest.raises(Interrupted):
        drive(
            open_on(board),
            load_plan("paper/XI"),
            interrupts=interrupts,
            progress=after_three_seconds,
            say=said.append,
        )
    assert board.handled[-1] == "stop"
    assert board.now_s < 3.5
    assert said == ["wheels stopped: the board has acknowledged the stop"]


def test_an_interrupt_while_the_start_is_under_way_stops_as_well() -> None:
    """The answer to the start is lost: nobody knows whether the wheels turn, so they are stopped."""
    interrupts = Interrupts()

    class LosesTheAnswer(FakeBoard):
        def frame(self, frame: Frame) -> bytes:
            answer = super().frame(frame)
            if frame.id == tp.SeqStartRequest.ID:
                interrupts.requested = True
                return b""
            return answer

    board = LosesTheAnswer()
    said: list[str] = []
    with pytest.raises(Interrupted):
        drive(open_on(board), load_plan("paper/XI"), interrupts=interrupts, say=said.append)
    assert board.handled[-2:] == ["seq_start", "stop"]
    assert said == ["wheels stopped: the board has acknowledged the stop"]


def test_when_the_link_is_cut_the_user_learns_what_the_robot_does_now() -> None:
    for unattended, words in ((False, "stops it by itself"), (True, "until its plan ends")):
        stream = FaultyStream(FakeLine(FakeBoard()), cut_after_bytes=600)
        said: list[str] = []
        plan = replace(load_plan("paper/XI"), unattended=unattended)
        with pytest.raises(LinkClosed):
            drive(Device(Client(stream)), plan, say=said.append)
        assert ("runs unattended" in said[0]) == unattended
        assert "COULD NOT STOP" in said[-1]
        assert words in said[-1]


def test_a_fault_on_the_way_is_named() -> None:
    board = FakeBoard()

    def battery_sags(_share: float) -> None:
        board.latched = next(f for f in tp.FAULTS if f.name == "battery_low").mask

    with pytest.raises(BoardFault, match="battery_low") as caught:
        drive(open_on(board), load_plan("paper/XI"), progress=battery_sags)
    assert caught.value.faults == ("battery_low",)
    assert "charge" in caught.value.next_step


def test_a_board_that_starts_anew_on_the_way_is_named() -> None:
    board = FakeBoard()

    def reboots(_share: float) -> None:
        board.boot_id += 1
        board.sequence, board.started_at = b"", None

    with pytest.raises(BoardRebooted, match="power_on"):
        drive(open_on(board), load_plan("paper/XI"), progress=reboots, say=lambda _: None)


def test_a_drive_that_somebody_else_ends_is_named() -> None:
    board = FakeBoard()

    def other_host_stops(_share: float) -> None:
        board.ended = True

    with pytest.raises(TruingError, match="ended before its time"):
        drive(open_on(board), load_plan("paper/XI"), progress=other_host_stops, say=lambda _: None)


def test_a_board_whose_time_runs_slow_is_waited_for() -> None:
    """A virtual board that is paced below real time, or on a busy machine."""

    class Slow(FakeLine):
        def sleep(self, seconds: float) -> None:
            super().sleep(seconds / 10)

        def now_s(self) -> float:
            return 10 * super().now_s()

        def read(self, timeout_s: float) -> bytes:
            return super().read(timeout_s / 10)

    board = FakeBoard()
    drive(Device(Client(Slow(board))), load_plan("paper/XI"))
    assert board.now_s > 9.0
