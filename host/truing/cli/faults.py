"""`truing faults`: what the board complains of, and clearing it."""

from __future__ import annotations

from dataclasses import asdict

import click

from truing.cli.app import App
from truing.cli.options import board_options


@click.command()
@click.option("--clear", is_flag=True, help="Unlatch all faults whose cause is gone.")
@board_options
def command(app: App, clear: bool) -> None:
    """Show the board's faults by name, cause and next step, or clear them.

    A latched fault keeps both wheels braked until it is cleared, even when its cause is gone.

    \b
    Examples:
      truing --port /dev/ttyUSB0 faults
      truing --port /dev/ttyUSB0 faults --clear
    """
    with app.open_device() as device:
        before = device.status()
        if clear:
            device.clear_faults()
        status = device.status()
        record = device.fault_record()
    app.emit(
        {"cleared": [f.name for f in before.latched if f not in status.latched]}
        | status.to_dict()
        | {"fault_record": record and asdict(record)}
    )
    if clear:
        names = ", ".join(fault.name for fault in before.latched) or "nothing was latched"
        app.say(f"cleared: {names}")
    for fault in dict.fromkeys(status.latched + status.active):
        app.say(f"{fault.name} ({'latched' if fault in status.latched else 'active'}): {fault.cause}")
        app.say(f"  next: {fault.next_step}")
    if not status.active and not status.latched:
        app.say("no faults")
    if record is not None:
        app.say("what the board kept of the last fault of its program:")
        for line in record.lines():
            app.say(f"  {line}")
