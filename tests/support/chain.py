"""The whole chain for tests: host, line, flashed image, simulated robot."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from hil_sim import VirtualRobot
from support.faulty_stream import FaultyStream
from truing.board.device import Device
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream
from truing_protocol import LOG_CELL_SIZE

# Core-coupled memory: address and size (RM0090 section 2.3.1).
CCM = (0x10000000, 65536)


class Chain:
    """A virtual robot with the flashed image, and hosts that come and go on its line.

    Parameters
    ----------
    on_time : called with the virtual time after every step of it, to break things on cue.
    """

    def __init__(self, image: Path, seed: int = 1, on_time: Callable[[float], None] | None = None) -> None:
        self.image = image
        self.robot = VirtualRobot(image, seed=seed)
        self.stream = VirtualStream(self.robot, on_time=on_time)

    def __enter__(self) -> Chain:
        return self

    def __exit__(self, *_: object) -> None:
        self.robot.close()

    def host(self) -> Device:
        """A host on the line as it is."""
        return Device(Client(self.stream))

    def host_on_bad_line(self, share: float, seed: int, cut_after_bytes: int | None = None) -> Device:
        """A host on a line that spoils that share of the bytes, in both directions."""
        return Device(Client(FaultyStream(self.stream, share, seed, cut_after_bytes)))

    def ring(self) -> bytes:
        """The log's ring as it lies in the board's two memories."""
        start, end = (self.robot.symbol(f"__log_memory_{edge}")[0] for edge in ("start", "end"))
        sram = self.robot.read_memory(start, (end - start) // LOG_CELL_SIZE * LOG_CELL_SIZE)
        return sram + self.robot.read_memory(*CCM)

    def in_ram(self, offset: int, length: int) -> bytes:
        """Bytes of the log by absolute offset, straight from RAM."""
        ring = self.ring()
        return bytes(ring[at % len(ring)] for at in range(offset, offset + length))

    @classmethod
    def around(cls, robot: VirtualRobot, image: Path) -> Chain:
        """The same for a robot that somebody else has made."""
        chain = cls.__new__(cls)
        chain.robot, chain.image, chain.stream = robot, image, VirtualStream(robot)
        return chain
