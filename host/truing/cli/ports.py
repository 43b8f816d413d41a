"""`truing ports`: the serial ports of this machine, or the boards on a CAN bus."""

from __future__ import annotations

from dataclasses import asdict

import click

from truing.cli.app import App
from truing.cli.options import json_option


@click.command()
@click.option(
    "--can", "can_bus", metavar="INTERFACE:CHANNEL[@BITRATE]", help="Call the boards on this CAN bus instead."
)
@json_option
def command(app: App, can_bus: str | None) -> None:
    """List where a board may be.

    \b
    Example:
      truing ports
      truing ports --can socketcan:can0
      truing ports --can virtual:robots,3         three virtual boards
    """
    if can_bus is not None:
        _list_nodes(app, can_bus)
        return
    from rich.table import Table

    from truing.board.connect import list_ports

    ports = list_ports()
    app.emit([asdict(port) for port in ports])
    if not ports:
        app.say("This machine has no serial port. A virtual board needs none: --port sim")
        return
    table = Table("port", "adapter", "may be a board")
    for port in ports:
        table.add_row(port.device, port.description, "yes" if port.likely else "")
    app.show(table)


def _list_nodes(app: App, where: str) -> None:
    from rich.table import Table

    from truing.board.connect import open_can_bus
    from truing.extras import require

    require("can")
    from truing.link.can_address import can_address
    from truing.link.can_stream import discover
    from truing.virtual.options import VirtualOptions
    from truing_protocol import SCHEMA_HASH

    address = can_address(where)
    bus, _ = open_can_bus(where, VirtualOptions())
    try:
        nodes = discover(bus)
    finally:
        bus.close()
    app.emit([asdict(node) for node in nodes])
    if not nodes:
        app.say(f"No board answers on {bus.name} at {address.bit_rate} bit/s.")
        return
    table = Table("port", "board", "")
    numbers = [node.node for node in nodes]
    for node in nodes:
        remark = "" if node.schema_hash == SCHEMA_HASH else "another firmware version"
        if numbers.count(node.node) > 1:
            remark = "two boards with one number: give one another can_node over its serial port"
        table.add_row(
            f"can:{where.partition('@')[0]}@{address.bit_rate}/{node.node}", f"{node.board:08x}", remark
        )
    app.show(table)
