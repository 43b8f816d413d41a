"""A virtual robot in the world of a view: its true pose out; walls, and hands that turn its wheels, in.

Lines of JSON, over the standard streams of the view's own virtual board, or over a port of `truing board`.
The true pose takes the place of an external tracking camera: simulated sensors measure from there.
"""

from __future__ import annotations

import contextlib
import json
import queue
import socket
import threading
from collections.abc import Callable
from typing import Any, Protocol

from truing.web.pose import Pose
from truing.web.process.walls import Collisions, Movable, Walls
from truing.web.world.world_map import BODY_M

_TRUTH_EVERY_US = 20_000


class Robot(Movable, Protocol):
    """What is needed of a virtual robot."""

    @property
    def time_us(self) -> int:
        """Virtual time since power-up."""

    def truth(self) -> Any:
        """The true pose: `time_s`, `x_m`, `y_m`, `theta_rad`."""

    def turn_by_hand(self, wheel: int) -> None:
        """Turn a lifted wheel by one turn; takes virtual time."""


class RobotWorld:
    """Carries out what a view asks of a virtual robot, and tells it the true pose.

    Parameters
    ----------
    publish : takes a line for the view; called from the thread that steps.
    """

    def __init__(self, robot: Robot, publish: Callable[[bytes], None]) -> None:
        self._robot = robot
        self._publish = publish
        self._due_us = 0
        self._collisions = Collisions(robot)
        self._turns: queue.SimpleQueue[int] = queue.SimpleQueue()

    def receive(self, line: bytes) -> None:
        """A line from the view, from any thread."""
        content: dict[str, Any] = json.loads(line)
        if "turn" in content:
            self._turns.put(1 if content["turn"] else 0)
        else:
            self._collisions.walls = Walls.of_json(content, BODY_M)

    def forget(self) -> None:
        """The view has gone, and its walls with it."""
        self._collisions.walls = None

    def step(self) -> None:
        """Once in each time slice of the robot."""
        while not self._turns.empty():
            side = self._turns.get()
            self._robot.turn_by_hand(side)
            self._publish(_line({"turned": side}))
        if self._collisions.walls is not None:
            truth = self._robot.truth()
            self._collisions.step(self._robot.time_us, Pose(truth.x_m, truth.y_m, truth.theta_rad))
        if self._robot.time_us < self._due_us:
            return
        self._due_us = self._robot.time_us + _TRUTH_EVERY_US
        truth = self._robot.truth()
        self._publish(_line({"truth": [truth.time_s, truth.x_m, truth.y_m, truth.theta_rad]}))


class WorldPort:
    """The same at a TCP port of this machine, for one view at a time; called after each time slice."""

    def __init__(self, robot: Robot) -> None:
        self._world = RobotWorld(robot, self._send)
        self._listener = socket.create_server(("127.0.0.1", 0), backlog=1)
        self._view: socket.socket | None = None
        self.address: tuple[str, int] = self._listener.getsockname()[:2]
        threading.Thread(target=self._serve, name="world", daemon=True).start()

    def __call__(self) -> bool:
        """Step, while a view is there; never asks the server to stop."""
        if self._view is not None:
            self._world.step()
        return False

    def close(self) -> None:
        """No view is served any more."""
        self._listener.close()
        if self._view is not None:
            self._view.close()

    def _serve(self) -> None:
        with contextlib.suppress(OSError):  # closed
            while True:
                view, _ = self._listener.accept()
                view.settimeout(None)
                self._view = view
                with view, view.makefile("rb") as lines, contextlib.suppress(OSError, ValueError, KeyError):
                    for line in lines:
                        self._world.receive(line)
                self._view = None
                self._world.forget()

    def _send(self, line: bytes) -> None:
        view = self._view
        if view is not None:
            # A view that does not read gets the next pose; the board never waits for it.
            with contextlib.suppress(OSError):
                view.send(line, socket.MSG_DONTWAIT)


def _line(content: dict[str, object]) -> bytes:
    return (json.dumps(content) + "\n").encode()
