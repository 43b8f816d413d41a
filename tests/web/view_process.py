"""`truing view` as a process, talking to a virtual board over a link that a test can cut."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import subprocess
import sys
import threading
from pathlib import Path


class CutLink:
    """A TCP proxy in front of a board, which can be cut and restored."""

    def __init__(self, port: str) -> None:
        _, host, number = port.split(":")
        self._target = (host, int(number))
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = f"tcp:127.0.0.1:{self._listener.getsockname()[1]}"
        self._open: list[socket.socket] = []
        self._plugged = True
        threading.Thread(target=self._accept, daemon=True).start()

    def pull(self) -> None:
        """Cut the connections and refuse new ones."""
        self._plugged = False
        for end in self._open:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()
        self._open.clear()

    def plug(self) -> None:
        """Accept connections again."""
        self._plugged = True

    def close(self) -> None:
        """Close everything."""
        self.pull()
        self._listener.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                host, _ = self._listener.accept()
                if not self._plugged:
                    host.close()
                    continue
                board = socket.create_connection(self._target)
                for end in (host, board):
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._open += [host, board]
                for a, b in ((host, board), (board, host)):
                    threading.Thread(target=_carry, args=(a, b), daemon=True).start()


def _carry(source: socket.socket, target: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while data := source.recv(4096):
            target.sendall(data)
    for end in (source, target):
        with contextlib.suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)


class ViewProcess:
    """A running view; `address` is its page, results go to `out`."""

    def __init__(self, out: Path, *arguments: str, port: str = "sim") -> None:
        command = [sys.executable, "-m", "truing", "--port", port, "view", "--json", "--no-browser"]
        self.out = out
        # NiceGUI looks for pytest in the environment and then serves elsewhere.
        clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
        self.process = subprocess.Popen(
            [*command, "--port", "0", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=clean | {"TRUING_OUT": str(out)},
        )
        assert self.process.stdout is not None
        said = ""
        while not said.rstrip().endswith("}"):
            line = self.process.stdout.readline()
            assert line, f"the view did not start: {said}"
            said += line
        self.announced = json.loads(said)
        self.address: str = self.announced["address"]

    def close(self) -> None:
        """End it as Ctrl-C would."""
        self.process.terminate()
        try:
            self.process.wait(15)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait(5)
        if self.process.stdout is not None:
            self.process.stdout.close()
