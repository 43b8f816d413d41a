"""From what the user calls a port to an open stream."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from truing.errors import PortError
from truing.extras import require
from truing.link.stream import Stream
from truing.virtual.options import VirtualOptions

if TYPE_CHECKING:
    from truing.link.can_bus import CanBus

_KINDS = (
    "sim, auto, /dev/...[@BAUD], COM3[@BAUD], tcp:HOST:PORT, "
    "can:INTERFACE:CHANNEL[@BITRATE][/NODE], can:sim, can:virtual"
)
# Adapters of these vendors sit on robots' controllers; others (modems, phones) are listed, not tried.
_LIKELY_VENDORS = {
    0x0403: "FTDI",
    0x10C4: "Silicon Labs CP210x",
    0x1A86: "WCH CH34x",
    0x067B: "Prolific",
    0x0483: "STMicroelectronics",
    0x2E8A: "Raspberry Pi",
    0x15BA: "Olimex",
}


@dataclass(frozen=True, slots=True)
class Candidate:
    """A serial port that this machine has, and why it may lead to a board."""

    device: str
    description: str
    likely: bool


def list_ports() -> list[Candidate]:
    """The serial ports of this machine, likely ones first."""
    from serial.tools.list_ports import comports

    found = [
        Candidate(
            device=port.device,
            description=_LIKELY_VENDORS.get(port.vid or 0, "") or (port.description or "").replace("n/a", ""),
            likely=port.vid in _LIKELY_VENDORS,
        )
        for port in comports()
    ]
    return sorted(found, key=lambda c: (not c.likely, c.device))


def open_stream(port: str, virtual: VirtualOptions | None = None) -> Stream:
    """Open the port that the user named.

    Raises
    ------
    PortError : there is no such port, it is in use, or `auto` finds none or several.
    VirtualBoardError : the virtual board cannot start.
    """
    kind, _, rest = port.partition(":")
    if kind in _OPENERS:
        return _OPENERS[kind](rest, virtual or VirtualOptions())
    if port.startswith("/") or re.fullmatch(r"COM\d+(@\d+)?", port, re.IGNORECASE):
        return _open_serial(port)
    raise PortError(f"{port}: not a kind of port that truing knows", f"use one of: {_KINDS}")


def _open_sim(rest: str, virtual: VirtualOptions) -> Stream:
    from truing.link.virtual_stream import VirtualStream
    from truing.virtual.board import make_virtual_robot

    if rest:
        raise PortError(f"sim:{rest}: sim takes nothing after it", "use --robot and --seed")
    robot = make_virtual_robot(virtual)
    return VirtualStream(robot, on_close=robot.close)


def _open_tcp(rest: str, _virtual: VirtualOptions) -> Stream:
    from truing.link.tcp_stream import TcpStream

    host, _, number = rest.rpartition(":")
    host = host.strip("[]")
    if not host or not number.isdecimal() or not 0 < int(number) < 65_536:
        raise PortError(f"tcp:{rest}: not an address", "write tcp:HOST:PORT, for example tcp:localhost:7700")
    return TcpStream(host, int(number))


def open_can_bus(rest: str, virtual: VirtualOptions) -> tuple[CanBus, int]:
    """Open the bus that `INTERFACE:CHANNEL[@BITRATE][/NODE]` names; return it and the node.

    Raises
    ------
    PortError : it is no address, or the adapter cannot be opened.
    VirtualBoardError : virtual boards cannot start.
    """
    require("can")
    from truing.link.can_address import can_address
    from truing.link.can_bus import AdapterBus
    from truing.virtual.can import open_channel, open_simulated

    address = can_address(rest)
    if address.interface == "sim":
        return open_simulated(virtual, address.node, address.bit_rate), address.node
    if address.interface == "virtual":
        return open_channel(virtual, address.channel, address.node, address.bit_rate), address.node
    return AdapterBus(address.interface, address.channel, address.bit_rate), address.node


def _open_can(rest: str, virtual: VirtualOptions) -> Stream:
    require("can")
    from truing.link.can_stream import CanStream

    return CanStream(*open_can_bus(rest, virtual))


def _open_auto(_rest: str, _virtual: VirtualOptions) -> Stream:
    ports = list_ports()
    likely = [candidate for candidate in ports if candidate.likely]
    if len(likely) == 1:
        return _open_serial(likely[0].device)
    if not likely:
        others = ", ".join(candidate.device for candidate in ports) or "none at all"
        raise PortError(
            "auto: found no USB serial adapter that may lead to a board",
            f"plug it in, or name the port with --port; serial ports here: {others}",
        )
    listed = ", ".join(f"{candidate.device} ({candidate.description})" for candidate in likely)
    raise PortError(f"auto: {len(likely)} ports may lead to a board: {listed}", "choose one with --port")


def _open_serial(address: str) -> Stream:
    from truing.link.serial_stream import BAUD, SerialStream

    device, at, baud = address.rpartition("@")
    if at and baud.isdecimal():
        return SerialStream(device, int(baud))
    return SerialStream(address, BAUD)


_OPENERS: dict[str, Callable[[str, VirtualOptions], Stream]] = {
    "sim": _open_sim,
    "tcp": _open_tcp,
    "can": _open_can,
    "auto": _open_auto,
}
