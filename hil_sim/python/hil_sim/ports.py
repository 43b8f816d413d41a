"""The two ways into a served virtual robot from outside: a TCP port and a pseudo-terminal."""

from __future__ import annotations

import contextlib
import os
import select
import selectors
import socket
import termios
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

_CHUNK = 4096
_BACKLOG_LIMIT = 1 << 20  # bytes kept for a client that does not read; a real line would lose them at once


class Port(Protocol):
    """One way in. `ready` is called when the selector finds one of its files readable."""

    def ready(self, file: object) -> None: ...

    def received(self) -> bytes: ...

    def send(self, data: bytes) -> None: ...

    def close(self) -> None: ...


class TcpPort:
    """A listening socket with at most one client at a time; a second one is refused with the reason.

    Parameters
    ----------
    address : host name and port number, 0 for any free one; `address` then holds the real one.
    """

    def __init__(
        self, address: tuple[str, int], selector: selectors.BaseSelector, announce: Callable[[str], None]
    ) -> None:
        self._selector = selector
        self._announce = announce
        self._client: socket.socket | None = None
        self._client_name = ""
        self._refused: set[socket.socket] = set()
        self._in = bytearray()
        self._out = bytearray()
        self._listener = socket.create_server(address, backlog=4)
        self._listener.setblocking(False)
        self.address: tuple[str, int] = self._listener.getsockname()[:2]
        selector.register(self._listener, selectors.EVENT_READ, self)
        announce(f"listening at tcp:{self.address[0]}:{self.address[1]}")

    def ready(self, file: object) -> None:
        """Take a new client, or what the present one sent."""
        if file is self._listener:
            self._accept()
        elif isinstance(file, socket.socket) and file in self._refused:
            self._see_off(file)
        elif self._client is not None:
            self._receive(self._client)

    def received(self) -> bytes:
        """Return what the client sent since the last call."""
        data = bytes(self._in)
        self._in.clear()
        return data

    def send(self, data: bytes) -> None:
        """Send to the client; without one the bytes are lost, as on an open line."""
        if self._client is None:
            return
        self._out += data
        if not self._out:
            return
        try:
            sent = self._client.send(self._out)
            del self._out[:sent]
        except BlockingIOError:
            pass
        except OSError as error:
            self._drop(f"lost ({error.strerror})")
        if len(self._out) > _BACKLOG_LIMIT:
            self._drop("dropped: it does not read what the board sends")

    def close(self) -> None:
        """Close the client and the listening socket."""
        if self._client is not None:
            self._drop("closed")
        for client in list(self._refused):
            self._forget(client)
        with contextlib.suppress(KeyError):
            self._selector.unregister(self._listener)
        self._listener.close()

    def _accept(self) -> None:
        try:
            client, address = self._listener.accept()
        except OSError:
            return
        name = f"{address[0]}:{address[1]}"
        if self._client is not None:
            self._announce(f"client {name} refused: {self._client_name} is connected")
            self._refuse(client)
            return
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client, self._client_name = client, name
        self._selector.register(client, selectors.EVENT_READ, self)
        self._announce(f"client {name} connected")

    def _refuse(self, client: socket.socket) -> None:
        """Send the reason, and read on until the other side has closed.

        To close at once would reset the connection over what the client had already sent, and it
        could lose the reason.
        """
        reason = f"this virtual board is in use by {self._client_name}; one client at a time"
        client.setblocking(False)
        self._refused.add(client)
        self._selector.register(client, selectors.EVENT_READ, self)
        try:
            client.sendall(f"refused: {reason}\r\n".encode())
            client.shutdown(socket.SHUT_WR)
        except OSError:
            self._forget(client)

    def _see_off(self, client: socket.socket) -> None:
        try:
            gone = not client.recv(_CHUNK)
        except BlockingIOError:
            return
        except OSError:
            gone = True
        if gone:
            self._forget(client)

    def _forget(self, client: socket.socket) -> None:
        self._selector.unregister(client)
        self._refused.discard(client)
        client.close()

    def _receive(self, client: socket.socket) -> None:
        try:
            data = client.recv(_CHUNK)
        except BlockingIOError:
            return
        except OSError as error:
            self._drop(f"lost ({error.strerror})")
            return
        if data:
            self._in += data
        else:
            self._drop("disconnected")

    def _drop(self, why: str) -> None:
        assert self._client is not None
        self._selector.unregister(self._client)
        self._client.close()
        self._client = None
        self._in.clear()
        self._out.clear()
        self._announce(f"client {self._client_name} {why}")


class PtyPort:
    """A pseudo-terminal that looks like a serial port; it outlives the programs that open it.

    Parameters
    ----------
    link : where to put a symbolic link to the terminal's name, which changes from run to run.
    """

    def __init__(
        self, link: Path | None, selector: selectors.BaseSelector, announce: Callable[[str], None]
    ) -> None:
        self._selector = selector
        self._master, slave = os.openpty()
        tty.setraw(slave, termios.TCSANOW)
        self.name = os.ttyname(slave)
        os.close(slave)  # from here on POLLHUP on the master shows whether the other end is open
        os.set_blocking(self._master, False)
        self._link = link
        self._in = bytearray()
        self._closed = False
        if link is not None:
            link.parent.mkdir(parents=True, exist_ok=True)
            if link.is_symlink():
                link.unlink()
            try:
                link.symlink_to(self.name)
            except OSError:
                os.close(self._master)
                raise
        announce(f"terminal at {link or self.name}")

    def ready(self, file: object) -> None:
        """Do nothing: the terminal is polled, because a hung-up one is always ready."""

    def received(self) -> bytes:
        """Return what was typed or sent since the last call."""
        if self._open_elsewhere():
            with contextlib.suppress(BlockingIOError, OSError):
                return os.read(self._master, _CHUNK)
        return b""

    def send_some(self, data: bytes) -> int:
        """Send what the terminal takes; return how much that was. Without a reader all of it is lost."""
        if not self._open_elsewhere():
            return len(data)
        with contextlib.suppress(BlockingIOError, OSError):
            return os.write(self._master, data)
        return 0

    def send(self, data: bytes) -> None:
        """Send to whoever has the terminal open; without one, or when its buffer is full, bytes are lost."""
        if data and self._open_elsewhere():
            with contextlib.suppress(BlockingIOError, OSError):
                os.write(self._master, data)

    def close(self) -> None:
        """Close the terminal and remove the link."""
        if self._closed:
            return
        self._closed = True
        os.close(self._master)
        if self._link is not None and self._link.is_symlink():
            self._link.unlink()

    def _open_elsewhere(self) -> bool:
        poller = select.poll()
        poller.register(self._master, select.POLLIN)
        return not any(event & select.POLLHUP for _, event in poller.poll(0))
