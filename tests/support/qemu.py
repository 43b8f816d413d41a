"""The image on QEMU's own model of the STM32F405: a second opinion besides the virtual board."""

from __future__ import annotations

import socket
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from support.gdb_stub import GdbStub
from truing.link.client import Client, Timing
from truing.link.tcp_stream import TcpStream

# USART3, our link, is the third serial port of QEMU's models of the chip.
_OPTIONS = ("-display", "none", "-monitor", "stdio")
_OTHER_PORTS = ("-serial", "null", "-serial", "null")
_QUIT_S = 5.0


@dataclass(frozen=True)
class Model:
    """A board with the STM32F405 that a QEMU has."""

    program: str
    machine: str


NETDUINO = Model("qemu-system-arm", "netduinoplus2")
"""Another board with the same chip, in Debian 12's QEMU 7.2."""

OLIMEX = Model(
    str(Path(__file__).resolve().parents[2] / ".cache/qemu-10/root/usr/bin/qemu-system-arm"),
    "olimex-stm32-h405",
)
"""The board that the image is made for, in the QEMU 10 that `./run test` unpacks from Debian's backports."""


def _listening(name: str, server: socket.socket) -> str:
    """QEMU's words for a socket that it inherits."""
    return f"socket,id={name},fd={server.fileno()},server=on,wait=off"


class Qemu:
    """A running QEMU with the link on a loopback port; a context manager.

    Parameters
    ----------
    image : the ELF file that is flashed.
    model : the board.
    """

    def __init__(self, image: Path, model: Model = NETDUINO) -> None:
        # QEMU inherits sockets that already listen: nobody can take their ports in between.
        with socket.create_server(("127.0.0.1", 0)) as link, socket.create_server(("127.0.0.1", 0)) as gdb:
            self.port: int = link.getsockname()[1]
            self._gdb_port: int = gdb.getsockname()[1]
            arguments = [model.program, "-M", model.machine, *_OPTIONS, "-kernel", str(image), *_OTHER_PORTS]
            arguments += ["-chardev", _listening("link", link), "-serial", "chardev:link"]
            arguments += ["-chardev", _listening("gdb", gdb), "-gdb", "chardev:gdb"]
            self._process = subprocess.Popen(
                arguments,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                pass_fds=(link.fileno(), gdb.fileno()),
            )
        self.started_at = time.monotonic()

    def connect(self) -> Client:
        """A client of the host's own; close it before connecting again, QEMU takes one at a time."""
        if self._process.poll() is not None:
            assert self._process.stderr is not None
            raise RuntimeError(f"QEMU ended with {self._process.returncode}: {self._process.stderr.read()}")
        # On a busy machine the model runs slower than the chip.
        return Client(
            TcpStream("127.0.0.1", self.port),
            timing=Timing(first_wait_s=0.25, longest_wait_s=0.5, patience_s=20.0),
        )

    def debugger(self) -> GdbStub:
        """Halt the processor, to look at it or meddle with it; it goes on when the debugger is closed."""
        return GdbStub(self._gdb_port)

    def reset(self) -> None:
        """Press the board's reset button."""
        assert self._process.stdin is not None
        self._process.stdin.write("system_reset\n")
        self._process.stdin.flush()

    def close(self) -> None:
        """End QEMU; closing twice is harmless."""
        self._process.terminate()
        try:
            self._process.wait(_QUIT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for pipe in (self._process.stdin, self._process.stderr):
            if pipe is not None:
                pipe.close()

    def __enter__(self) -> Qemu:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
