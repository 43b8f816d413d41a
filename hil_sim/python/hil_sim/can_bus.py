"""A CAN bus in virtual time that several virtual robots share, and the host's node on it."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any, Protocol

from hil_sim import native


class CanNode(Protocol):
    """A board as the bus sees it.

    Attributes
    ----------
    can_bus : the bus it is on; `VirtualCanBus.attach` and `detach` set it.
    """

    can_bus: VirtualCanBus | None

    @property
    def rig_handle(self) -> int | None:
        """The board's rig in the native library."""

    @property
    def time_s(self) -> float:
        """Virtual time since creation, seconds."""

    def close(self) -> None:
        """Free the board."""


@dataclass(frozen=True, slots=True)
class CanFrame:
    """One frame of classic CAN.

    Attributes
    ----------
    id : 11 bits, or 29 when `extended`.
    time_us : virtual time at which it ended; 0 for frames to be sent.
    """

    id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False
    time_us: int = 0


@native.mirror("can_bus_totals")
@dataclass(frozen=True)
class CanTotals:
    """Totals of a bus: complete frames, all bits, and failed attempts."""

    frames: int
    bits: int
    damaged: int
    unacknowledged: int


_Frame: Any = native.HEADERS.structs["can_bus_frame"]


class VirtualCanBus:
    """A bus with the host as one node; boards are plugged in with `attach` and then share its time.

    Parameters
    ----------
    bit_rate : of the host's node, bit/s; each board has its own setting.
    """

    def __init__(self, bit_rate: float = 1e6) -> None:
        self._library = native.load()
        self._bus: int | None = self._library.can_bus_create(bit_rate)
        if self._bus is None:
            raise MemoryError("no memory for a CAN bus")
        self.robots: list[CanNode] = []

    def close(self) -> None:
        """Unplug all boards and free the bus."""
        if self._bus is not None:
            for robot in tuple(self.robots):
                self.detach(robot)
            self._library.can_bus_destroy(self._bus)
            self._bus = None

    def __del__(self) -> None:
        self.close()

    def attach(self, robot: CanNode) -> None:
        """Plug a board in.

        Raises
        ------
        ValueError : its time is not that of the others, it is on a bus already, or there are 16 boards.
        """
        if robot.can_bus is not None or not self._library.can_bus_attach(self._bus, robot.rig_handle):
            raise ValueError("a board joins one bus, at the time of the boards that are there, 16 at most")
        robot.can_bus = self
        self.robots.append(robot)

    def detach(self, robot: CanNode) -> None:
        """Unplug a board."""
        self._library.can_bus_detach(self._bus, robot.rig_handle)
        robot.can_bus = None
        self.robots.remove(robot)

    def run_us(self, n: int) -> None:
        """Advance the virtual time of all boards by `n` microseconds."""
        self._library.can_bus_run_us(self._bus, n)

    @property
    def time_s(self) -> float:
        """Virtual time of the boards, seconds."""
        return self.robots[0].time_s if self.robots else 0.0

    def write(self, frame: CanFrame) -> bool:
        """Let the host send a frame, from now on; False: 1024 wait already."""
        raw = _Frame(id=frame.id, extended=frame.extended, remote=frame.remote, length=len(frame.data))
        ctypes.memmove(raw.data, frame.data, len(frame.data))
        return bool(self._library.can_bus_write(self._bus, ctypes.byref(raw)))

    def read(self) -> CanFrame | None:
        """Return the oldest unread frame of the boards; None: there is none."""
        raw = _Frame()
        if not self._library.can_bus_read(self._bus, ctypes.byref(raw)):
            return None
        return CanFrame(
            raw.id, bytes(raw.data[: raw.length]), bool(raw.extended), bool(raw.remote), raw.time_us
        )

    def set_bit_rate(self, bit_rate: float) -> None:
        """Set the bit rate of the host's node; nodes that misread a frame destroy it."""
        self._library.can_bus_bit_rate(self._bus, bit_rate)

    def set_bit_timing(self, before: int, after: int, jump: int) -> None:
        """Divide a bit of the host's node: quanta up to its sample point, after it, and the jump width."""
        self._library.can_bus_bit_timing(self._bus, before, after, jump)

    def set_delay_ns(self, delay_ns: float) -> None:
        """Set the way from node to node, transceivers included; 150 ns at first, 5 for each metre more."""
        self._library.can_bus_delay(self._bus, delay_ns)

    def set_host_connected(self, connected: bool) -> None:
        """Unplug the host: it neither acknowledges nor receives."""
        self._library.can_bus_connect_host(self._bus, connected)

    def set_shorted(self, shorted: bool) -> None:
        """Short the two wires: every attempt to send fails at its first bit."""
        self._library.can_bus_short(self._bus, shorted)

    def damage(self, frames: int) -> None:
        """Damage this many of the next frames on the wire; their senders repeat them."""
        self._library.can_bus_damage(self._bus, frames)

    def totals(self) -> CanTotals:
        """Return the bus's totals."""
        raw = native.new(CanTotals)
        self._library.can_bus_totals(self._bus, ctypes.byref(raw))
        return native.from_struct(CanTotals, raw)
