"""The ROM loader of an STM32 behind a pseudo-terminal: the commands of AN3155 on a flash of 1 MiB."""

from __future__ import annotations

import os
import pty
import select
import threading
import tty

ACK, NACK, INIT = b"\x79", b"\x1f", 0x7F
GET, GET_VERSION, GET_ID, READ, WRITE, EXTENDED_ERASE = 0x00, 0x01, 0x02, 0x11, 0x31, 0x44
FLASH = 0x0800_0000
# RM0090 table 5: sizes of the sectors in KiB.
SECTORS = [16, 16, 16, 16, 64] + [128] * 7


class DeadBoardError(Exception):
    """The board is dead."""


class RomLoader:
    """Answers at `path` until it is closed.

    Parameters
    ----------
    writes : after so many write commands the board dies; None: never.
    broken_at : a byte of flash that stays as it is, whatever is written.
    """

    def __init__(
        self, device_id: int = 0x413, writes: int | None = None, broken_at: int | None = None
    ) -> None:
        self.flash = bytearray(b"\xff" * (1 << 20))
        self.erased: list[int] = []
        self._device_id = device_id
        self._writes = writes
        self._broken_at = broken_at
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Answer nothing any more."""
        self._stop.set()
        self._thread.join()

    def close(self) -> None:
        self.stop()
        os.close(self._master)
        os.close(self._slave)

    def __enter__(self) -> RomLoader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _take(self, count: int) -> bytes:
        got = b""
        while len(got) < count:
            if self._stop.is_set():
                raise DeadBoardError
            if select.select([self._master], [], [], 0.05)[0]:
                got += os.read(self._master, count - len(got))
        return got

    def _give(self, data: bytes) -> None:
        os.write(self._master, data)

    def _serve(self) -> None:
        try:
            while self._take(1)[0] != INIT:
                pass
            self._give(ACK)
            while True:
                self._command()
        except (DeadBoardError, OSError):
            return

    def _command(self) -> None:
        code = self._take(1)[0]
        if code == INIT:
            self._give(NACK)  # the baud rate is known already
            return
        if self._take(1)[0] != code ^ 0xFF:
            self._give(NACK)
            return
        commands = {
            GET: self._get,
            GET_VERSION: lambda: self._give(b"\x31\x00\x00" + ACK),
            GET_ID: lambda: self._give(b"\x01" + self._device_id.to_bytes(2, "big") + ACK),
            READ: self._read,
            WRITE: self._write,
            EXTENDED_ERASE: self._erase,
        }
        if code not in commands:
            self._give(NACK)
            return
        self._give(ACK)
        commands[code]()

    def _get(self) -> None:
        # Version 3.1 and the commands of the F405 (AN2606): no Erase, Extended Erase instead.
        others = (0x21, 0x63, 0x73, 0x82, 0x92)
        codes = bytes([0x31, GET, GET_VERSION, GET_ID, READ, WRITE, EXTENDED_ERASE, *others])
        self._give(bytes([len(codes) - 1]) + codes + ACK)

    def _address(self) -> int | None:
        raw = self._take(5)
        check = raw[0] ^ raw[1] ^ raw[2] ^ raw[3] ^ raw[4]
        at = int.from_bytes(raw[:4], "big") - FLASH
        good = check == 0 and 0 <= at < len(self.flash)
        self._give(ACK if good else NACK)
        return at if good else None

    def _read(self) -> None:
        at = self._address()
        if at is None:
            return
        count, inverse = self._take(2)
        if count ^ inverse != 0xFF:
            self._give(NACK)
            return
        self._give(ACK + bytes(self.flash[at : at + count + 1]))

    def _write(self) -> None:
        at = self._address()
        if at is None:
            return
        count = self._take(1)[0] + 1
        data = self._take(count)
        check = self._take(1)[0] ^ (count - 1)
        for byte in data:
            check ^= byte
        if check:
            self._give(NACK)
            return
        if self._writes is not None:
            if self._writes == 0:
                raise DeadBoardError
            self._writes -= 1
        for i, byte in enumerate(data, start=at):
            if i != self._broken_at:
                self.flash[i] &= byte  # programming clears bits and sets none
        self._give(ACK)

    def _erase(self) -> None:
        count = int.from_bytes(self._take(2), "big") + 1
        sectors = self._take(2 * count)
        self._take(1)
        for i in range(0, len(sectors), 2):
            number = int.from_bytes(sectors[i : i + 2], "big")
            begin = 1024 * sum(SECTORS[:number])
            self.flash[begin : begin + 1024 * SECTORS[number]] = b"\xff" * (1024 * SECTORS[number])
            self.erased.append(number)
        self._give(ACK)
