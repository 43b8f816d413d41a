"""Boards on a virtual CAN bus for tests, and hosts on it."""

from __future__ import annotations

from pathlib import Path

from hil_sim import VirtualRobot
from support.chain import Chain
from truing.board.device import Device
from truing.link.can_stream import CanStream
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream
from truing.virtual.can import SimulatedBus, free, make_bus_of_boards
from truing.virtual.options import VirtualOptions

START_US = 20_000


class CanChain:
    """Virtual robots on one bus; the n-th has node n."""

    def __init__(self, image: Path, boards: int = 1, bit_rate: int = 1_000_000) -> None:
        self.image = image
        self.bus = make_bus_of_boards(VirtualOptions(image=image), range(1, boards + 1), bit_rate)
        self.robots = tuple(self.bus.robots)

    def __enter__(self) -> CanChain:
        return self

    def __exit__(self, *_: object) -> None:
        free(self.bus)

    def serial_host(self, robot: VirtualRobot) -> Device:
        """A host on the robot's serial line."""
        robot.run_us(START_US)
        return Device(Client(VirtualStream(robot)))

    def host(self, node: int = 1) -> Device:
        """A host on the bus."""
        return Device(Client(CanStream(SimulatedBus(self.bus), node)))

    def in_ram(self, offset: int, length: int, node: int = 1) -> bytes:
        """Bytes of a board's log by absolute offset, straight from its RAM."""
        return Chain.around(self.robots[node - 1], self.image).in_ram(offset, length)
