"""A virtual robot's host, and what its bridges do with both motors."""

from __future__ import annotations

from hil_sim import VirtualRobot
from truing.board.device import Device
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream

Bridges = tuple[tuple[float, float], tuple[float, float]]

# Both inputs of both bridges high; no pin driven.
BRAKE: Bridges = ((1.0, 1.0), (1.0, 1.0))
NOT_DRIVEN: Bridges = ((-1.0, -1.0), (-1.0, -1.0))


def host(robot: VirtualRobot) -> Device:
    """A host of its own, in the robot's process."""
    return Device(Client(VirtualStream(robot)))


def bridges(robot: VirtualRobot) -> Bridges:
    """Shares of time that the inputs of the left and the right bridge are high."""
    return robot.bridge(0), robot.bridge(1)
