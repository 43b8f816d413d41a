"""Runs a virtual robot behind a TCP port, a pseudo-terminal or both, paced for people or at full speed."""

from __future__ import annotations

import contextlib
import selectors
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from hil_sim.can_bus import VirtualCanBus
from hil_sim.ports import Port, PtyPort, TcpPort
from hil_sim.robot import VirtualRobot
from hil_sim.slcan import SlcanPort

SLICE_US = 1000
"""Virtual time between two polls of the ports, microseconds."""

_LONGEST_LAG_S = 0.2  # a lag beyond this is accepted and not made up for


@dataclass(frozen=True)
class ServeOptions:
    """Where and how fast.

    Attributes
    ----------
    tcp : address and port to listen at (port 0: any free one); None: no TCP.
    pty : whether to make a pseudo-terminal.
    pty_link : where to put a symbolic link to it.
    slcan_link : where to put a symbolic link to a pseudo-terminal that is a CAN adapter (slcan); the board is
        then on a bus, and so are those that the caller has put on it.
    factor : virtual seconds in one real second; None: as fast as it can.
    """

    tcp: tuple[str, int] | None = ("127.0.0.1", 0)
    pty: bool = False
    pty_link: Path | None = None
    slcan_link: Path | None = None
    factor: float | None = 1.0


class Server:
    """A virtual robot and the ports it can be reached at.

    Parameters
    ----------
    robot : the board that is served; it belongs to the caller.
    options : where and how fast.
    announce : called with one line for everything a person wants to know: ports, clients, refusals.

    Raises
    ------
    OSError : a port cannot be opened.
    ValueError : the pace is not positive.
    """

    def __init__(
        self, robot: VirtualRobot, options: ServeOptions, announce: Callable[[str], None] = lambda _: None
    ) -> None:
        if options.factor is not None and not options.factor > 0.0:
            raise ValueError(f"a pace of {options.factor} is not positive")
        self.robot = robot
        self.options = options
        self.lag_s = 0.0
        self._ports: list[Port] = []
        self._selector = selectors.DefaultSelector()
        self.tcp: TcpPort | None = None
        self.pty: PtyPort | None = None
        self.slcan: SlcanPort | None = None
        try:
            if options.tcp is not None:
                self.tcp = TcpPort(options.tcp, self._selector, announce)
                self._ports.append(self.tcp)
            if options.pty or options.pty_link is not None:
                self.pty = PtyPort(options.pty_link, self._selector, announce)
                self._ports.append(self.pty)
            if options.slcan_link is not None:
                bus = robot.can_bus or VirtualCanBus()
                if robot.can_bus is None:
                    bus.attach(robot)
                self.slcan = SlcanPort(bus, options.slcan_link, self._selector, announce)
        except OSError:
            self.close()
            raise

    def close(self) -> None:
        """Close the ports; the robot is unchanged."""
        for port in self._ports:
            port.close()
        if self.slcan is not None:
            self.slcan.close()
        self._ports.clear()
        self._selector.close()

    def run(self, stop: Callable[[], bool] = lambda: False) -> None:
        """Serve until `stop` returns True or Ctrl-C; the ports are closed afterwards."""
        try:
            with contextlib.suppress(KeyboardInterrupt):
                self._run(stop)
        finally:
            self.close()

    def _run(self, stop: Callable[[], bool]) -> None:
        origin_s, origin_us = time.monotonic(), self.robot.time_us
        while not stop():
            wait_s = 0.0
            if self.options.factor is not None:
                due_s = origin_s + (self.robot.time_us + SLICE_US - origin_us) * 1e-6 / self.options.factor
                wait_s = due_s - time.monotonic()
                if wait_s < -_LONGEST_LAG_S:
                    self.lag_s -= wait_s
                    origin_s -= wait_s
            self._collect(max(0.0, wait_s))
            if self.slcan is not None:
                self.slcan.exchange()
            self.robot.run_us(SLICE_US)
            sent = self.robot.link_read()
            for port in self._ports:
                port.send(sent)

    def _collect(self, wait_s: float) -> None:
        """Read from the clients until the slice is due, however much they send."""
        until = time.monotonic() + wait_s
        while True:
            for key, _ in self._selector.select(max(0.0, until - time.monotonic())):
                port: Port = key.data
                port.ready(key.fileobj)
            for port in self._ports:
                data = port.received()
                if data:
                    self.robot.link_write(data)
            if time.monotonic() >= until:
                return


def serve(
    robot: VirtualRobot, options: ServeOptions, announce: Callable[[str], None] = lambda _: None
) -> None:
    """Serve a virtual robot until Ctrl-C."""
    with (
        contextlib.suppress(KeyboardInterrupt),
        contextlib.closing(Server(robot, options, announce)) as server,
    ):
        server.run()
