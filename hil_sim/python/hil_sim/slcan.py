"""A CAN adapter with the serial-line protocol of LAWICEL's CAN232, as a pseudo-terminal."""

from __future__ import annotations

import contextlib
import selectors
from collections.abc import Callable
from pathlib import Path

from hil_sim.can_bus import CanFrame, VirtualCanBus
from hil_sim.ports import PtyPort

_BIT_RATES = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
_OK, _BELL = b"\r", b"\a"
_BACKLOG_LIMIT = 1 << 20
_DATA_MAX = 8


class SlcanPort:
    """The host's node on a virtual bus, reached through a pseudo-terminal; python-can calls it `slcan`.

    Parameters
    ----------
    link : where to put a symbolic link to the terminal, whose own name changes.

    Attributes
    ----------
    taken, passed_on : frames that came from the terminal for the bus, and from the bus for the terminal.
    """

    def __init__(
        self,
        bus: VirtualCanBus,
        link: Path | None,
        selector: selectors.BaseSelector,
        announce: Callable[[str], None],
    ) -> None:
        self._bus = bus
        self._pty = PtyPort(link, selector, announce)
        self.name = self._pty.name
        self._begun = b""
        self._out = bytearray()
        self._open = False
        self.taken = self.passed_on = 0

    def exchange(self) -> None:
        """Execute the client's commands, and pass on the frames of the bus."""
        *lines, self._begun = (self._begun + self._pty.received()).split(b"\r")
        for line in lines:
            self._out += self._obey(line)
        while (frame := self._bus.read()) is not None:
            if self._open:
                self._out += _as_text(frame)
                self.passed_on += 1
        self._flush()

    def close(self) -> None:
        """Close the terminal."""
        self._pty.close()

    def _flush(self) -> None:
        """Keep what a full terminal does not take, as an adapter's memory does."""
        if self._out:
            del self._out[: self._pty.send_some(bytes(self._out[:4096]))]
        if len(self._out) > _BACKLOG_LIMIT:
            self._out.clear()

    def _obey(self, line: bytes) -> bytes:
        command, rest = line[:1], line[1:]
        if command in (b"t", b"T", b"r", b"R"):
            return self._transmit(command, rest)
        if command == b"S":
            if self._open or not rest.isdigit() or int(rest) >= len(_BIT_RATES):
                return _BELL
            self._bus.set_bit_rate(_BIT_RATES[int(rest)])
        elif command in (b"O", b"L"):
            self._open = True
        elif command == b"C":
            self._open = False
        elif command == b"V":
            return b"V1013\r"
        elif command == b"N":
            return b"NSIM1\r"
        elif command == b"F":
            return b"F00\r"
        elif command:
            return _BELL
        return _OK

    def _transmit(self, command: bytes, rest: bytes) -> bytes:
        digits = 8 if command.isupper() else 3
        remote = command.lower() == b"r"
        try:
            can_id, length = int(rest[:digits], 16), int(rest[digits : digits + 1], 16)
            data = b"" if remote else bytes.fromhex(rest[digits + 1 :].decode("ascii"))
        except ValueError:
            return _BELL
        if not self._open or length > _DATA_MAX or (not remote and len(data) != length):
            return _BELL
        with contextlib.suppress(ValueError):
            if self._bus.write(CanFrame(can_id, data, extended=digits == 8, remote=remote)):
                self.taken += 1
                return b"Z\r" if digits == 8 else b"z\r"
        return _BELL


def _as_text(frame: CanFrame) -> bytes:
    letter = "r" if frame.remote else "t"
    head = f"{letter.upper()}{frame.id:08X}" if frame.extended else f"{letter}{frame.id:03X}"
    return f"{head}{len(frame.data)}{frame.data.hex().upper()}\r".encode()
