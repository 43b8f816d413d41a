"""Enough of GDB's remote protocol to meddle with a processor inside QEMU."""

from __future__ import annotations

import socket
import time


class GdbStub:
    """A connection to a GDB stub; a context manager. The processor stands still while it is connected.

    Parameters
    ----------
    port : TCP port on the loopback interface.
    """

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=5.0)
        self._held = b""
        self._send("?")
        self._receive()
        # QEMU lets nobody set registers who has not asked which there are.
        self._ask("qXfer:features:read:target.xml:0,1000")

    def read_memory(self, address: int, length: int) -> bytes:
        """Bytes at `address`, as the processor sees them."""
        return bytes.fromhex(self._ask(f"m{address:x},{length:x}"))

    def write_memory(self, address: int, data: bytes) -> None:
        """Put bytes at `address` in RAM; QEMU does not pass them on to peripherals."""
        assert self._ask(f"M{address:x},{len(data):x}:{data.hex()}") == "OK"

    def write_register(self, number: int, value: int) -> None:
        """Set register r0 to r15 (13 the stack pointer, 15 the program counter)."""
        assert self._ask(f"P{number:x}={value.to_bytes(4, 'little').hex()}") == "OK"

    def close(self) -> None:
        """Let the processor go on, and hang up."""
        self._ask("D")
        self._socket.close()

    def __enter__(self) -> GdbStub:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ask(self, packet: str) -> str:
        self._send(packet)
        while (answer := self._receive()).startswith("T"):
            pass  # the stub also reports, whenever it likes, that the processor has halted
        return answer

    def _send(self, packet: str) -> None:
        self._socket.sendall(f"${packet}#{sum(packet.encode()) & 0xFF:02x}".encode())

    def _receive(self) -> str:
        deadline = time.monotonic() + 5.0
        while time.monotonic() < deadline:
            start, end = self._held.find(b"$"), self._held.find(b"#")
            if 0 <= start < end and len(self._held) >= end + 3:
                packet = self._held[start + 1 : end]
                self._held = self._held[end + 3 :]
                self._socket.sendall(b"+")
                return packet.decode()
            self._held += self._socket.recv(4096)
        raise TimeoutError("the GDB stub does not answer")
