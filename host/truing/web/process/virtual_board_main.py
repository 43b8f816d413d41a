"""Process that runs a virtual board in real time; its robot's side is on the standard streams.

In a process of its own the emulated CPU neither delays the pages nor waits for them.
"""

from __future__ import annotations

import json
import os
import sys
import threading
from pathlib import Path

from hil_sim.serve import ServeOptions, Server
from truing.errors import TruingError
from truing.virtual.board import make_virtual_robot
from truing.virtual.options import VirtualOptions
from truing.web.process.robot_world import Robot, RobotWorld


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
            server.run(_UntilTheParentEnds(robot))
    except TruingError as error:
        _write_line({"error": error.message, "next": error.next_step})
        return error.exit_code
    return 0


class _UntilTheParentEnds:
    """Stop condition that the server calls after every time slice; it also steps the robot's world."""

    def __init__(self, robot: Robot) -> None:
        self._parent = os.getppid()
        self._closed = False
        self._world = RobotWorld(robot, self._publish)
        threading.Thread(target=self._read, name="world", daemon=True).start()

    def __call__(self) -> bool:
        self._world.step()
        return self._closed or os.getppid() != self._parent

    def _publish(self, line: bytes) -> None:
        try:
            # One write of one short line is atomic on a pipe.
            os.write(sys.stdout.fileno(), line)
        except BlockingIOError:
            pass  # a slow reader gets the next one
        except OSError:
            self._closed = True

    def _read(self) -> None:
        for line in sys.stdin.buffer:
            self._world.receive(line)


def _write_line(content: dict[str, object]) -> None:
    os.write(sys.stdout.fileno(), (json.dumps(content) + "\n").encode())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
