"""A host on CAN that is slow, or whose frames get lost, keeps what it has."""

from __future__ import annotations

from cobs import cobs

from truing.link.can_stream import CanStream, discover
from truing_protocol import CAN_BOARD_TO_HOST, CAN_HOST_TO_BOARD, CanAnnounce

NODE = 3
GO_ON = bytes([0x30, 0, 0])


class ScriptedBus:
    """A bus on which a test lets frames come, with a clock that a test moves."""

    name = "scripted"
    virtual = True

    def __init__(self) -> None:
        self.time_s = 0.0
        self.here: list[tuple[int, bytes]] = []
        self.sent: list[tuple[int, bytes]] = []

    def comes(self, *frames: bytes) -> None:
        self.here += [(CAN_BOARD_TO_HOST + NODE, frame) for frame in frames]

    def send(self, can_id: int, data: bytes) -> None:
        self.sent.append((can_id, data))

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        if not self.here:
            self.time_s += timeout_s
            return None
        return self.here.pop(0)

    def sleep(self, seconds: float) -> None:
        self.time_s += seconds

    def now_s(self) -> float:
        return self.time_s

    def close(self) -> None:
        pass


def on_the_line(message: bytes) -> bytes:
    return cobs.encode(message) + b"\0"


def first_of(message: bytes) -> bytes:
    return bytes([0x10, len(message)]) + message[:6]


def test_what_came_while_the_host_was_busy_is_not_given_up() -> None:
    bus = ScriptedBus()
    stream = CanStream(bus, NODE)
    message = bytes(range(1, 21))
    bus.comes(first_of(message))
    assert stream.read(0.05) == b""
    assert bus.sent == [(CAN_HOST_TO_BOARD + NODE, GO_ON)]
    bus.comes(b"\x21" + message[6:13], b"\x22" + message[13:])
    bus.time_s += 30.0
    assert stream.read(0.05) == on_the_line(message)


def test_a_board_that_falls_silent_while_the_host_listens_is_given_up() -> None:
    bus = ScriptedBus()
    stream = CanStream(bus, NODE)
    message = bytes(range(1, 21))
    bus.comes(first_of(message))
    assert stream.read(0.05) == b""
    assert stream.read(0.2) == b""
    bus.comes(b"\x21" + message[6:13], b"\x22" + message[13:])
    assert stream.read(0.05) == b""


def test_leave_to_go_on_goes_out_before_a_new_request() -> None:
    bus = ScriptedBus()
    stream = CanStream(bus, NODE)
    bus.comes(first_of(bytes(20)))
    stream.write(on_the_line(b"ask"))
    assert [data for _, data in bus.sent] == [GO_ON, b"\x03ask"]


def test_a_request_that_still_waits_is_not_sent_twice() -> None:
    bus = ScriptedBus()
    stream = CanStream(bus, NODE)
    long = bytes(range(1, 11))
    for _ in range(5):
        stream.write(on_the_line(long))
        stream.write(on_the_line(b"short"))
    assert [data for _, data in bus.sent] == [first_of(long)]
    bus.comes(GO_ON)
    stream.read(0.01)
    assert [data for _, data in bus.sent[1:]] == [b"\x21" + long[6:], b"\x05short", first_of(long)]


def test_a_call_that_nobody_hears_is_repeated() -> None:
    bus = ScriptedBus()

    def answer_to_the_third(can_id: int, data: bytes) -> None:
        bus.sent.append((can_id, data))
        if len(bus.sent) == 3:
            bus.here.append((CanAnnounce.BASE + 9, CanAnnounce(1, 2).pack()))

    bus.send = answer_to_the_third  # type: ignore[method-assign]
    assert [node.node for node in discover(bus)] == [9]
    assert len(bus.sent) == 4


def test_a_bus_without_boards_is_called_a_few_times() -> None:
    bus = ScriptedBus()
    assert discover(bus) == []
    assert 0.5 < bus.time_s < 1.0
