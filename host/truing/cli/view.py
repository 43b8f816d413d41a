"""`truing view`: the Simulator View in the browser."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from truing.cli.app import App
from truing.cli.options import json_option, virtual_options

if TYPE_CHECKING:
    from truing.web.access.security import Access


@click.command()
@click.option(
    "--port",
    "http_port",
    type=click.IntRange(0, 65_535),
    default=7780,
    show_default=True,
    help="Where the page is served; 0 takes any free port. (The board's port comes before `view`.)",
)
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Address to serve at. Any but this machine's own needs the token that is printed.",
)
@click.option("--browser/--no-browser", default=True, help="Open the page in the browser.  [default: yes]")
@click.option(
    "--set",
    "folder",
    type=click.Path(file_okay=False, path_type=Path),
    help="Recording set that runs are added to.  [default: out/recordings/BOARD]",
)
@click.option(
    "--rate",
    "rate_hz",
    type=click.FloatRange(1.0, 200.0),
    default=30.0,
    show_default=True,
    help="Samples of the live picture in a second, as far as the link keeps up.",
)
@virtual_options
@json_option
def command(
    app: App,
    http_port: int,
    host: str,
    browser: bool,
    folder: Path | None,
    rate_hz: float,
    seed: int | None,
    robot: Path | None,
    image: Path | None,
) -> None:
    """See the robot, drive it, draw its path, and compare simulation and reality, in the browser.

    Without a board's port it starts a virtual board of its own, in real time. The robot stops when the page
    is lost; the space bar always stops it. Nothing is fetched from the internet. Ctrl-C stops the wheels and
    ends the view.

    \b
    Examples:
      truing view
      truing --port /dev/ttyUSB0 view --no-browser
      truing view --host 0.0.0.0 --port 8080
    """
    from truing.extras import require

    require("view")
    from truing.virtual.board import require_virtual_board
    from truing.virtual.options import VirtualOptions
    from truing.web.server import ServerOptions, serve
    from truing.web.session import ViewOptions, ViewSession

    def announce(address: str, access: Access) -> None:
        app.emit({"address": address, "token": access.token})
        app.say(f"the view is at {address}")
        if access.token is not None:
            app.note("that address holds the token, printed this once: whoever has it can drive the robot")
        # Whoever started this in the background waits for these lines.
        sys.stdout.flush()

    app.choose_virtual(seed, robot, image)
    if app.is_virtual:
        require_virtual_board()
    session = ViewSession(ViewOptions(app.port, VirtualOptions(app.seed, image, robot), folder, rate_hz))
    try:
        serve(session, ServerOptions(host, http_port, browser), announce)
    finally:
        session.close()
    app.note("view ended")
