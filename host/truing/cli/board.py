"""`truing board`: a virtual board that stays, for other programs to connect to."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path

import click

from truing.cli.app import App
from truing.cli.options import crystal_option, json_option, virtual_options

DEFAULT_TCP = "127.0.0.1:7700"


class _Speed(click.ParamType[float | None]):
    """A factor of real time, or `max`."""

    name = "FACTOR|max"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> float | None:
        if value == "max":
            return None
        try:
            factor = float(str(value))
        except ValueError:
            factor = 0.0
        if not 0.01 <= factor <= 1000:
            self.fail(f"{value} is neither a factor from 0.01 to 1000 nor max", param, ctx)
        return factor


@click.command()
@click.option(
    "--tcp",
    metavar="[HOST:]PORT",
    default=DEFAULT_TCP,
    show_default=True,
    help="Where to listen; port 0 takes any free one, 'off' none.",
)
@click.option("--pty", is_flag=True, help="Offer a pseudo-terminal as well, as a serial port would be.")
@click.option(
    "--link",
    type=click.Path(path_type=Path),
    help="Make this symbolic link to the pseudo-terminal, whose own name changes.",
)
@click.option(
    "--can",
    type=click.Path(path_type=Path),
    help="Put the board on a CAN bus, reached through this link to a pseudo-terminal (slcan).",
)
@click.option("--speed", type=_Speed(), default="1", show_default=True, help="Pace: 1 is real time.")
@crystal_option
@virtual_options
@json_option
def command(
    app: App,
    tcp: str,
    pty: bool,
    link: Path | None,
    can: Path | None,
    speed: float | None,
    crystal_ppm: float,
    seed: int | None,
    robot: Path | None,
    image: Path | None,
) -> None:
    """Start a virtual board that runs the image that is flashed; Ctrl-C ends it.

    One host at a time can be connected. What the board holds (logs, parameters) stays while it runs.
    A `truing view` on this machine gives its robot the walls of the view's world.

    \b
    Examples:
      truing board                                then, elsewhere: truing --port tcp:127.0.0.1:7700 info
      truing board --tcp off --link /tmp/robot    then, elsewhere: truing --port /tmp/robot info
      truing board --speed max --seed 7
    """
    from hil_sim.serve import ServeOptions, Server
    from truing.errors import PortError
    from truing.virtual.board import make_virtual_robot
    from truing.virtual.options import VirtualOptions
    from truing.web.process.board_note import BoardNote, leave_note
    from truing.web.process.robot_world import WorldPort

    address = _address(tcp)
    if address is None and not pty and link is None and can is None:
        raise click.UsageError("nobody could connect: give --tcp, --pty, --link or --can")
    options = ServeOptions(
        tcp=address, pty=pty or link is not None, pty_link=link, slcan_link=can, factor=speed
    )
    virtual_board = VirtualOptions(1 if seed is None else seed, image, robot, crystal_ppm=crystal_ppm)
    with make_virtual_robot(virtual_board) as virtual:
        try:
            server = Server(virtual, options, app.note)
        except OSError as error:
            where = tcp if address is not None else link
            raise PortError(
                f"{where}: cannot be opened ({error.strerror or error})",
                "another virtual board may be running; choose another with --tcp PORT (0: any free one)",
            ) from error
        with (
            contextlib.closing(server),
            contextlib.closing(WorldPort(virtual)) as world,
            contextlib.suppress(KeyboardInterrupt),
        ):
            ports = []
            if server.tcp is not None:
                ports.append(f"tcp:{server.tcp.address[0]}:{server.tcp.address[1]}")
            if server.pty is not None:
                ports.append(str(link or server.pty.name))
            if can is not None:
                ports.append(f"can:slcan:{can}")
            app.emit({"ports": ports})
            for port in ports:
                app.say(f"connect with: truing --port {port} info")
            note = leave_note(BoardNote(ports, world.address, virtual_board.seed))
            # Whoever started this in the background waits for these lines.
            sys.stdout.flush()
            try:
                server.run(world)
            finally:
                note.unlink(missing_ok=True)
    app.note("virtual board stopped")


def _address(text: str) -> tuple[str, int] | None:
    if text == "off":
        return None
    host, _, number = text.rpartition(":")
    if not number.isdecimal() or int(number) > 65_535:
        raise click.BadParameter(f"{text} is neither [HOST:]PORT nor off", param_hint="--tcp")
    return host.strip("[]") or "127.0.0.1", int(number)
