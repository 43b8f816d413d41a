"""`truing ports`: the serial ports of this machine."""

from __future__ import annotations

from dataclasses import asdict

import click

from truing.cli.app import App
from truing.cli.options import json_option


@click.command()
@json_option
def command(app: App) -> None:
    """List where a board may be.

    \b
    Example:
      truing ports
    """
    from rich.table import Table

    from truing.link.connect import list_ports

    ports = list_ports()
    app.emit([asdict(port) for port in ports])
    if not ports:
        app.say("This machine has no serial port. A virtual board needs none: --port sim")
        return
    table = Table("port", "adapter", "may be a board")
    for port in ports:
        table.add_row(port.device, port.description, "yes" if port.likely else "")
    app.show(table)
