"""The robot of a virtual board, beside its link: its true pose, the walls around it, hands at its wheels."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
from typing import Any

import orjson

from truing.web.pose import Pose
from truing.web.process.board_note import notes_of
from truing.web.process.walls import walls_json
from truing.web.world.world_map import WorldMap

_CONNECT_S = 1.0
_TURN_S = 10.0


class RobotSide:
    """What every virtual robot offers, however its lines come and go."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self._truth: Pose | None = None
        self._turned = threading.Event()

    @property
    def truth(self) -> Pose | None:
        """The robot's true pose, from (0, 0, 0) at power-up."""
        return self._truth

    @property
    def is_open(self) -> bool:
        """Whether its lines still come."""
        raise NotImplementedError

    def set_walls(self, world: WorldMap, base: Pose) -> None:
        """Give the robot walls; `base` is where its own coordinates begin in the world.

        From one thread only.
        """
        self._write(walls_json(world, base))

    def turn(self, side: int) -> None:
        """Turn a wheel (0 left, 1 right) forward by one whole turn, as a hand does on a real robot."""
        self._turned.clear()
        self._write({"turn": side})
        self._turned.wait(_TURN_S)

    def close(self) -> None:
        """Let it go."""
        raise NotImplementedError

    def _write(self, content: dict[str, Any]) -> None:
        raise NotImplementedError

    def _take(self, line: bytes) -> dict[str, Any]:
        """A line from the robot; what it says besides pose and turns is returned."""
        try:
            content: dict[str, Any] = json.loads(line)
        except ValueError:
            return {}
        if "truth" in content:
            _, x, y, theta = content["truth"]
            self._truth = Pose(x, y, theta)
            return {}
        if "turned" in content:
            self._turned.set()
            return {}
        return content


class ServedRobot(RobotSide):
    """The robot of a `truing board` on this machine.

    Raises
    ------
    OSError : it is not there any more.
    """

    def __init__(self, address: tuple[str, int], seed: int) -> None:
        super().__init__(seed)
        self._socket = socket.create_connection(address, timeout=_CONNECT_S)
        self._socket.settimeout(None)
        self._ended = False
        threading.Thread(target=self._listen, name="robot", daemon=True).start()

    @property
    def is_open(self) -> bool:
        """Whether its lines still come."""
        return not self._ended

    def close(self) -> None:
        """Let it go; the board goes on."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def _write(self, content: dict[str, Any]) -> None:
        with contextlib.suppress(OSError):  # it has ended, which its link tells
            self._socket.sendall(orjson.dumps(content) + b"\n")

    def _listen(self) -> None:
        with contextlib.suppress(OSError, ValueError), self._socket.makefile("rb") as lines:
            for line in lines:
                self._take(line)
        self._ended = True


def served_robot(port: str) -> ServedRobot | None:
    """The virtual robot behind a board's port, if there is one on this machine that answers."""
    for note in notes_of(port):
        with contextlib.suppress(OSError):  # the note of a board that was killed
            return ServedRobot(note.world, note.seed)
    return None
