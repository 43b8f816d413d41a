"""One board of a CAN bus as a stream: its frames travel as ISO-TP messages.

On CAN a frame goes without COBS, since ISO-TP marks its ends; here it is put on and off again, so that
everything above is the same as on a serial line. See protocol/SPEC.md, "CAN".
"""

from __future__ import annotations

import contextlib
import logging
from collections import deque
from dataclasses import dataclass

import isotp

from truing.errors import LinkClosed, StuffingError
from truing.link import cobs
from truing.link.can_bus import CanBus
from truing_protocol import (
    CAN_BOARD_TO_HOST,
    CAN_HOST_TO_BOARD,
    CAN_NODES,
    CanAnnounce,
    HelloRequest,
    StopRequest,
)

# Boards answer a call within 64 ms, whatever their number.
_CALL_WAIT_S = 0.15
_CALLS = 5
# A peer that leaves a message hanging for so long has lost a frame of it; the board allows as much.
_SILENCE_S = 0.1
# Frames that wait for the bus; beyond them the oldest, which has been asked again since, is lost.
_UNSENT = 16
_LOGGER = "truing.link.isotp"
# Each lost frame of a message would make all its others a warning.
logging.getLogger(_LOGGER).setLevel(logging.ERROR)
_PARAMETERS = {
    "logger_name": _LOGGER,
    "stmin": 0,
    "blocksize": 0,
    "rx_consecutive_frame_timeout": 10_000,
    "rx_flowcontrol_timeout": 10_000,
    "max_frame_size": 4095,
}


@dataclass(frozen=True, slots=True)
class Node:
    """A board that answered a call: its number, its schema, and a mark of its chip."""

    node: int
    schema_hash: int
    board: int


def discover(bus: CanBus) -> list[Node]:
    """Call all boards of a bus; return who answers, by number. Two with one number are both there.

    The call is repeated until it brings nobody new, and a few times where nobody answers at all: an adapter
    may lose a frame, and a machine that is busy listens late.
    """
    found: set[Node] = set()
    for _ in range(_CALLS):
        new = _answers(bus) - found
        if found and not new:
            break
        found |= new
    return sorted(found, key=lambda node: (node.node, node.board))


def _answers(bus: CanBus) -> set[Node]:
    """Who answers one call."""
    found: set[Node] = set()
    bus.send(CAN_HOST_TO_BOARD, bytes([HelloRequest.ID]))
    deadline = bus.now_s() + _CALL_WAIT_S
    while (left := deadline - bus.now_s()) > 0:
        frame = bus.receive(left)
        if frame is None:
            break
        can_id, data = frame
        if 0 < can_id - CanAnnounce.BASE <= CAN_NODES and len(data) == CanAnnounce.SIZE:
            said = CanAnnounce.unpack(data)
            found.add(Node(can_id - CanAnnounce.BASE, said.schema_hash, said.board))
    return found


def stop_all(bus: CanBus) -> None:
    """Let every board of a bus brake; none answers."""
    bus.send(CAN_HOST_TO_BOARD, bytes([StopRequest.ID]))


class CanStream:
    """The line to one board of a bus.

    Parameters
    ----------
    bus : belongs to the stream from now on, which closes it.
    node : the board's number, 1 to 63.
    """

    def __init__(self, bus: CanBus, node: int) -> None:
        self.bus = bus
        self.node = node
        self._open = True
        self._waiting: deque[isotp.CanMessage] = deque()
        self._begun = b""
        self._unsent: deque[bytes] = deque(maxlen=_UNSENT)
        self._silent_s = 0.0
        address = isotp.Address(
            isotp.AddressingMode.Normal_11bits, txid=CAN_HOST_TO_BOARD + node, rxid=CAN_BOARD_TO_HOST + node
        )
        # Losses are nothing special: the client asks again.
        self._layer = isotp.TransportLayerLogic(
            self._next_frame,
            self._send_frame,
            address,
            error_handler=lambda _: None,
            params=dict(_PARAMETERS),
        )

    @property
    def name(self) -> str:
        """The bus's name and the node."""
        return f"{self.bus.name}/{self.node}"

    @property
    def virtual(self) -> bool:
        """Whether the bus's clock is virtual time."""
        return self.bus.virtual

    def write(self, data: bytes) -> None:
        """Send the frames in `data`; zeros end them."""
        self._check()
        # What has come is answered before anything is added: the board may wait for leave to go on.
        self._fetch(0.0)
        self._layer.process()
        *ended, self._begun = (self._begun + data).split(b"\0")
        for stuffed in ended:
            # What is no frame cannot be sent as one; a serial line would carry it to be dropped there.
            with contextlib.suppress(StuffingError):
                frame = cobs.decode(stuffed)
                # One that is asked again while it still waits here goes once.
                if frame and frame not in self._unsent:
                    self._unsent.append(frame)
        self._send()

    def read(self, timeout_s: float) -> bytes:
        """Return what has arrived, waiting up to `timeout_s` for the first message."""
        self._check()
        deadline = self.bus.now_s() + timeout_s
        while True:
            self._layer.process()
            self._send()
            received = bytearray()
            while (message := self._layer.recv()) is not None:
                received += cobs.encode(bytes(message)) + b"\0"
            if received:
                return bytes(received)
            left = deadline - self.bus.now_s()
            if left <= 0:
                return b""
            self._fetch(left)

    def sleep(self, seconds: float) -> None:
        """Let time pass; what arrives meanwhile is kept."""
        self.bus.sleep(seconds)

    def now_s(self) -> float:
        """Return the time on the bus's clock."""
        return self.bus.now_s()

    def close(self) -> None:
        """Leave the bus."""
        if self._open:
            self._open = False
            self.bus.close()

    def _send(self) -> None:
        """Hand over what waits, one message after the other; most of them need the board's leave to go on."""
        while self._unsent and not self._layer.transmitting():
            self._layer.send(self._unsent.popleft())
            self._layer.process()

    def _fetch(self, timeout_s: float) -> None:
        """Wait for a frame of this board, and take all that are there with it.

        A peer that has said nothing for long while this side listened has lost a frame. Only listening
        counts, on the bus's own clock: what came while this program was busy elsewhere is in the adapter,
        and the layer's own time-outs run in real time, which a virtual bus outruns.
        """
        began = self.bus.now_s()
        frame = self.bus.receive(timeout_s)
        self._silent_s += min(self.bus.now_s() - began, timeout_s)
        while frame is not None:
            can_id, data = frame
            if can_id == CAN_BOARD_TO_HOST + self.node:
                self._silent_s = 0.0
                self._waiting.append(isotp.CanMessage(can_id, len(data), data))
            frame = self.bus.receive(0.0)
        hanging = self._layer.transmitting() or self._layer.is_rx_active()
        if hanging and not self._waiting and self._silent_s >= _SILENCE_S:
            self._layer.stop_sending()
            self._layer.stop_receiving()
            self._silent_s = 0.0

    def _next_frame(self, _timeout_s: float) -> isotp.CanMessage | None:
        return self._waiting.popleft() if self._waiting else None

    def _send_frame(self, message: isotp.CanMessage) -> None:
        self._silent_s = 0.0
        self.bus.send(message.arbitration_id, bytes(message.data))

    def _check(self) -> None:
        if not self._open:
            raise LinkClosed(f"{self.name}: the link is closed")
