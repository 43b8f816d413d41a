"""A virtual board in a process of its own, in real time; it tells the robot's true pose on standard output.

The view's own process must stay free for pages; the emulated CPU in another one never waits for it. The true
pose stands in for a camera above the floor: simulated sensors see the world from there.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

from hil_sim import VirtualRobot
from hil_sim.serve import ServeOptions, Server
from truing.errors import TruingError
from truing.link.connect import VirtualOptions
from truing.virtual_board import make_virtual_robot

_TRUTH_EVERY_US = 20_000


def main(arguments: list[str]) -> int:
    """Serve the board that the JSON in the first argument describes until the parent is gone."""
    options = json.loads(arguments[0])
    virtual = VirtualOptions(
        options["seed"],
        *(None if options[name] is None else Path(options[name]) for name in ("image", "robot")),
    )
    try:
        with make_virtual_robot(virtual) as robot:
            server = Server(robot, ServeOptions(tcp=("127.0.0.1", 0)))
            assert server.tcp is not None
            _say({"port": "tcp:{}:{}".format(*server.tcp.address)})
            os.set_blocking(sys.stdout.fileno(), False)
            server.run(_Teller(robot))
    except TruingError as error:
        _say({"error": error.message, "next": error.next_step})
        return error.exit_code
    return 0


class _Teller:
    """Asked by the server after every slice whether to stop; tells the truth on the way."""

    def __init__(self, robot: VirtualRobot) -> None:
        self._robot = robot
        self._parent = os.getppid()
        self._due_us = 0

    def __call__(self) -> bool:
        if self._robot.time_us < self._due_us:
            return False
        self._due_us = self._robot.time_us + _TRUTH_EVERY_US
        truth = self._robot.truth()
        try:
            _say({"truth": [truth.time_s, truth.x_m, truth.y_m, truth.theta_rad]})
        except BlockingIOError:
            pass  # a reader that lags gets the next one
        except OSError:
            return True
        return os.getppid() != self._parent


def _say(content: dict[str, object]) -> None:
    # One write of one short line: it goes into the pipe whole or not at all.
    os.write(sys.stdout.fileno(), (json.dumps(content) + "\n").encode())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
