"""A TCP connection as a stream: a virtual board or a serial server on the network."""

from __future__ import annotations

import select
import socket
import time

from truing.errors import LinkClosed, LinkTimeout, PortError

_RECEIVE_BYTES = 65_536
# A virtual board that is in use says so in plain text before it hangs up.
_REFUSED = b"refused: "
_FIRST_BYTES = 200
_CONNECT_TIMEOUT_S = 3.0
_WRITE_TIMEOUT_S = 2.0


class TcpStream:
    """A connected socket, small packets sent at once."""

    virtual = False

    def __init__(self, host: str, port: int) -> None:
        self._name = f"tcp:{host}:{port}"
        try:
            self._socket = socket.create_connection((host, port), timeout=_CONNECT_TIMEOUT_S)
        except (OSError, UnicodeError, OverflowError) as error:
            raise PortError(
                f"{self._name}: nobody answers there ({error})",
                "start a virtual board with `truing board --tcp PORT`, or check host and port number",
            ) from error
        # Requests are small and each waits for its reply: Nagle's algorithm would hold them up.
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)
        self._first = b""

    @property
    def name(self) -> str:
        """`tcp:host:port`."""
        return self._name

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        left = memoryview(data)
        deadline = time.monotonic() + _WRITE_TIMEOUT_S
        try:
            while left:
                wait = deadline - time.monotonic()
                if wait <= 0 or not select.select([], [self._socket], [], wait)[1]:
                    raise LinkTimeout(
                        f"{self._name}: the connection has taken no bytes for {_WRITE_TIMEOUT_S:g} seconds",
                        "check the network and the board at its other end",
                    )
                left = left[self._socket.send(left) :]
        except (OSError, ValueError) as error:
            raise self._closed(str(error)) from error

    def read(self, timeout_s: float) -> bytes:
        """Return what has arrived, waiting up to `timeout_s` for the first byte."""
        try:
            if not select.select([self._socket], [], [], max(timeout_s, 0.0))[0]:
                return b""
            data = self._socket.recv(_RECEIVE_BYTES)
        except (OSError, ValueError) as error:
            raise self._closed(str(error)) from error
        if not data:
            if self._first.startswith(_REFUSED):
                reason = self._first[len(_REFUSED) :].decode(errors="replace").strip()
                raise PortError(
                    f"{self._name}: another host is connected to this board ({reason})",
                    "close the other program, or start another board with `truing board --tcp 0`",
                )
            raise self._closed("the other end hung up")
        if len(self._first) < _FIRST_BYTES:
            self._first += data[:_FIRST_BYTES]
        return data

    def sleep(self, seconds: float) -> None:
        """Wait; the operating system keeps what arrives."""
        time.sleep(max(seconds, 0.0))

    def now_s(self) -> float:
        """Return the host's monotonic clock."""
        return time.monotonic()

    def close(self) -> None:
        """Hang up."""
        self._socket.close()

    def _closed(self, why: str) -> LinkClosed:
        return LinkClosed(
            f"{self._name}: the link to the board is gone ({why})",
            "see that the board is still there and that no other host is connected to it, then try again: "
            "a download resumes where it was cut",
        )
