"""Process that runs a virtual board in real time and writes the robot's true pose to standard output.

In a process of its own the emulated CPU neither delays the pages nor waits for them. The true pose takes the
place of an external tracking camera: simulated sensors measure from there. Standard input brings the walls of
the world, with which the robot collides.
"""

from __future__ import annotations

import json
import os
import sys
import threading
from pathlib import Path

from hil_sim import VirtualRobot
from hil_sim.serve import ServeOptions, Server
from truing.errors import TruingError
from truing.virtual.board import make_virtual_robot
from truing.virtual.options import VirtualOptions
from truing.web.pose import Pose
from truing.web.process.walls import Collisions, Walls
from truing.web.world.world_map import BODY_M

_TRUTH_EVERY_US = 20_000


def main(arguments: list[str]) -> int:
    """Serve the board that the JSON in the first argument describes until the parent process ends."""
    options = json.loads(arguments[0])
    virtual = VirtualOptions(
        options["seed"],
        *(None if options[name] is None else Path(options[name]) for name in ("image", "robot")),
    )
    try:
        with make_virtual_robot(virtual) as robot:
            server = Server(robot, ServeOptions(tcp=("127.0.0.1", 0)))
            assert server.tcp is not None
            _write_line({"port": "tcp:{}:{}".format(*server.tcp.address)})
            os.set_blocking(sys.stdout.fileno(), False)
            server.run(_TruthPublisher(robot))
    except TruingError as error:
        _write_line({"error": error.message, "next": error.next_step})
        return error.exit_code
    return 0


class _TruthPublisher:
    """Stop condition that the server calls after every time slice; it also publishes the true pose."""

    def __init__(self, robot: VirtualRobot) -> None:
        self._robot = robot
        self._parent = os.getppid()
        self._due_us = 0
        self._collisions = Collisions(robot)
        threading.Thread(target=self._read_walls, name="walls", daemon=True).start()

    def __call__(self) -> bool:
        if self._collisions.walls is not None:
            truth = self._robot.truth()
            self._collisions.step(self._robot.time_us, Pose(truth.x_m, truth.y_m, truth.theta_rad))
        if self._robot.time_us < self._due_us:
            return False
        self._due_us = self._robot.time_us + _TRUTH_EVERY_US
        truth = self._robot.truth()
        try:
            _write_line({"truth": [truth.time_s, truth.x_m, truth.y_m, truth.theta_rad]})
        except BlockingIOError:
            pass  # a slow reader gets the next one
        except OSError:
            return True
        return os.getppid() != self._parent

    def _read_walls(self) -> None:
        """The world from standard input, a line of JSON for each state of it."""
        for line in sys.stdin.buffer:
            self._collisions.walls = Walls.of_json(json.loads(line), BODY_M)


def _write_line(content: dict[str, object]) -> None:
    # One write of one short line is atomic on a pipe.
    os.write(sys.stdout.fileno(), (json.dumps(content) + "\n").encode())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
