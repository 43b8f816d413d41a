"""`truing stop`: brakes both wheels."""

from __future__ import annotations

import click

from truing.cli.app import App
from truing.cli.options import board_options


@click.command()
@board_options
def command(app: App) -> None:
    """Brake both wheels now, whatever the board does; a running sequence ends.

    \b
    Example:
      truing --port /dev/ttyUSB0 stop
    """
    with app.open_device() as device:
        device.stop()
        status = device.status()
    app.emit({"stopped": True, "state": status.state.name.lower()})
    app.say(f"wheels stopped: the board has acknowledged it and is {status.state.name.lower()}")
