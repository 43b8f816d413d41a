"""Boards on a virtual CAN bus for tests, and hosts on it."""

from __future__ import annotations

from pathlib import Path

from hil_sim import VirtualCanBus, VirtualRobot
from truing.device import Device
from truing.link.can_bus import SimulatedBus
from truing.link.can_stream import CanStream
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream

START_US = 20_000


class CanChain:
    """Virtual robots on one bus; the n-th has node n, given over its serial line."""

    def __init__(self, image: Path, boards: int = 1, bit_rate: int = 1_000_000) -> None:
        self.image = image
        self.robots = [VirtualRobot(image, seed=n, board_id=bytes([n]) * 12) for n in range(1, boards + 1)]
        self.bus = VirtualCanBus(bit_rate)
        for node, robot in enumerate(self.robots, start=1):
            device = self.serial_host(robot)
            device.set_parameter("can_node", node)
            device.set_parameter("can_bitrate_kbps", bit_rate / 1000)
        latest = max(robot.time_us for robot in self.robots)
        for robot in self.robots:
            robot.run_us(latest - robot.time_us)
            self.bus.attach(robot)
        self.bus.run_us(START_US)

    def __enter__(self) -> CanChain:
        return self

    def __exit__(self, *_: object) -> None:
        self.bus.close()
        for robot in self.robots:
            robot.close()

    def serial_host(self, robot: VirtualRobot) -> Device:
        """A host on the robot's serial line."""
        robot.run_us(START_US)
        return Device(Client(VirtualStream(robot)))

    def host(self, node: int = 1) -> Device:
        """A host on the bus."""
        return Device(Client(CanStream(SimulatedBus(self.bus), node)))
