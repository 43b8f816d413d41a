"""Starts the view's own virtual board as a process."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import threading
from typing import Any

import orjson

from truing.errors import VirtualBoardError
from truing.virtual.options import VirtualOptions
from truing.web.process.robot_side import RobotSide

_START_S = 30.0


class VirtualBoardProcess(RobotSide):
    """A virtual board as a child process, reachable at `port`."""

    def __init__(self, options: VirtualOptions) -> None:
        super().__init__(options.seed)
        content = {
            "seed": options.seed,
            "image": None if options.image is None else str(options.image),
            "robot": None if options.robot is None else str(options.robot),
        }
        self._process = subprocess.Popen(
            [sys.executable, "-m", "truing.web.process.virtual_board_main", json.dumps(content)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            # Ctrl-C in the terminal must reach only the view, which stops the robot first.
            start_new_session=True,
        )
        self.port = ""
        ready = threading.Event()
        self._problem = ("its process ended immediately", "")
        threading.Thread(target=self._listen, args=(ready,), name="truth", daemon=True).start()
        if not ready.wait(_START_S) or not self.port:
            self.close()
            raise VirtualBoardError(f"the virtual board cannot start: {self._problem[0]}", self._problem[1])

    @property
    def is_open(self) -> bool:
        """Whether its process runs."""
        return self._process.poll() is None

    def close(self) -> None:
        """End the board."""
        self._process.terminate()
        if self._process.stdin is not None:
            with contextlib.suppress(OSError):
                self._process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(5.0)
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _write(self, content: dict[str, Any]) -> None:
        assert self._process.stdin is not None
        with contextlib.suppress(OSError, ValueError):  # it has ended, which its link tells
            self._process.stdin.write(orjson.dumps(content) + b"\n")
            self._process.stdin.flush()

    def _listen(self, ready: threading.Event) -> None:
        assert self._process.stdout is not None
        with contextlib.suppress(ValueError, OSError):  # closed by close()
            for line in self._process.stdout:
                content = self._take(line)
                if content:
                    self.port = content.get("port", "")
                    self._problem = content.get("error", ""), content.get("next", "")
                    ready.set()
        ready.set()
