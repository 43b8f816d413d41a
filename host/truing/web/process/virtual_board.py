"""Starts the virtual board's process and reads the true pose that it publishes."""

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
from truing.web.pose import Pose
from truing.web.process.walls import walls_json
from truing.web.world.world_map import WorldMap

_START_S = 30.0


class VirtualBoardProcess:
    """A virtual board as a child process, reachable at `port`."""

    def __init__(self, options: VirtualOptions) -> None:
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
        self._truth: Pose | None = None
        self.port = ""
        ready = threading.Event()
        self._problem = ("its process ended immediately", "")
        threading.Thread(target=self._listen, args=(ready,), name="truth", daemon=True).start()
        if not ready.wait(_START_S) or not self.port:
            self.close()
            raise VirtualBoardError(f"the virtual board cannot start: {self._problem[0]}", self._problem[1])

    @property
    def truth(self) -> Pose | None:
        """The robot's true pose, from (0, 0, 0) at power-up."""
        return self._truth

    def set_walls(self, world: WorldMap, base: Pose) -> None:
        """Give the robot walls; `base` is where its own coordinates begin in the world.

        From one thread only.
        """
        assert self._process.stdin is not None
        with contextlib.suppress(OSError, ValueError):  # it has ended, which its link tells
            self._process.stdin.write(orjson.dumps(walls_json(world, base)) + b"\n")
            self._process.stdin.flush()

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

    def _listen(self, ready: threading.Event) -> None:
        assert self._process.stdout is not None
        with contextlib.suppress(ValueError, OSError):  # closed by close()
            for line in self._process.stdout:
                try:
                    content: dict[str, Any] = json.loads(line)
                except ValueError:
                    continue
                if "truth" in content:
                    _, x, y, theta = content["truth"]
                    self._truth = Pose(x, y, theta)
                    continue
                self.port = content.get("port", "")
                self._problem = content.get("error", ""), content.get("next", "")
                ready.set()
        ready.set()
