"""SocketCAN without the kernel's CAN: python-can's driver on a pair of datagram sockets."""

from __future__ import annotations

import contextlib
import errno
import itertools
import socket
import struct

import can
import pytest
from can.interfaces.socketcan import socketcan

from hil_sim import CanFrame, VirtualCanBus

_FRAME = struct.Struct("=IB3x8s")  # struct can_frame of linux/can.h
_EXTENDED, _REMOTE, _ERROR = 1 << 31, 1 << 30, 1 << 29


class DatagramCan:
    """Takes the place of an interface such as `can0`, with a virtual bus behind it.

    A datagram socket carries the same `struct can_frame`, and the kernel's time stamp, as a CAN socket; what
    is missing is the kernel's own part, its bit timing and its filters.
    """

    def __init__(self, bus: VirtualCanBus, patch: pytest.MonkeyPatch) -> None:
        self._bus = bus
        self.taken = self.passed_on = 0
        self.bound_to: list[str] = []
        self._near, self._far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        for end in (self._near, self._far):
            end.bind(("127.0.0.1", 0))
        self._near.connect(self._far.getsockname())
        self._far.connect(self._near.getsockname())
        self._far.setblocking(False)
        patch.setattr(socketcan, "create_socket", lambda: self._near)
        patch.setattr(socketcan, "bind_socket", lambda _, channel: self.bound_to.append(channel))

    def exchange(self) -> None:
        """Take what has come, pass on what the bus has brought."""
        with contextlib.suppress(BlockingIOError):
            while True:
                can_id, length, data = _FRAME.unpack(self._far.recv(64))
                assert not can_id & (_EXTENDED | _REMOTE | _ERROR)
                assert self._bus.write(CanFrame(can_id, data[:length]))
                self.taken += 1
        while (frame := self._bus.read()) is not None:
            self._far.send(_FRAME.pack(frame.id, len(frame.data), frame.data.ljust(8, b"\0")))
            self.passed_on += 1

    def tell_error(self) -> None:
        """Say what the kernel says of a bus error: a frame that is none."""
        self._far.send(_FRAME.pack(_ERROR | 0x80, 8, bytes(8)))

    def refuse_every_third(self, patch: pytest.MonkeyPatch) -> list[int]:
        """Let the interface's queue be full at every third frame; return the list of refusals."""
        refused: list[int] = []
        send, calls = socketcan.SocketcanBus._send_once, itertools.count(1)

        def send_or_refuse(bus: socketcan.SocketcanBus, data: bytes, channel: str | None = None) -> int:
            if (call := next(calls)) % 3 == 0:
                refused.append(call)
                raise can.CanOperationError("No buffer space available", errno.ENOBUFS)
            return send(bus, data, channel)

        patch.setattr(socketcan.SocketcanBus, "_send_once", send_or_refuse)
        return refused

    def go_down(self, patch: pytest.MonkeyPatch) -> None:
        """As `ip link set can0 down` does."""

        def refuse(_bus: socketcan.SocketcanBus, _data: bytes, _channel: str | None = None) -> int:
            raise can.CanOperationError("Network is down", errno.ENETDOWN)

        patch.setattr(socketcan.SocketcanBus, "_send_once", refuse)

    def close(self) -> None:
        """Close both ends."""
        self._near.close()
        self._far.close()
