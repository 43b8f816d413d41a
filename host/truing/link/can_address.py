"""What `--port can:...` says: which adapter, which bus, which board."""

from __future__ import annotations

from dataclasses import dataclass

from truing.errors import PortError

_BIT_RATE = 1_000_000
_INSIDE = ("sim", "virtual")  # these need no channel


@dataclass(frozen=True, slots=True)
class CanAddress:
    """Where on which CAN bus."""

    interface: str
    channel: str
    bit_rate: int = _BIT_RATE
    node: int = 1


def can_address(rest: str) -> CanAddress:
    """Take `INTERFACE:CHANNEL[@BITRATE][/NODE]` apart.

    A channel that is an absolute path takes a node only after a bit rate: in `/dev/pts/5` the 5 is none.

    Raises
    ------
    PortError : it is no such address.
    """
    where, at, tail = rest.partition("@")
    rate, slash, node = tail.partition("/")
    head, _, last = where.rpartition("/")
    if not at and ":/" not in where and head and last.isdecimal():
        where, slash, node = head, "/", last
    interface, _, channel = where.partition(":")
    good = (
        interface
        and (channel or interface in _INSIDE)
        and (not at or (rate.isdecimal() and 10_000 <= int(rate) <= 1_000_000))
        and (not slash or (node.isdecimal() and 1 <= int(node) <= 63))
    )
    if not good:
        raise PortError(
            f"can:{rest}: not an address on a CAN bus",
            "write can:INTERFACE:CHANNEL[@BITRATE][/NODE] with a node of 1 to 63, "
            "for example can:socketcan:can0/2 or can:slcan:/dev/ttyACM0@500000/2",
        )
    return CanAddress(interface, channel, int(rate) if at else _BIT_RATE, int(node) if slash else 1)
