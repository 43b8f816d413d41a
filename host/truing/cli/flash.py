"""`truing flash`: write the firmware image to a board."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from truing.cli.app import App
from truing.cli.options import json_option
from truing.errors import TruingError

_TOOLS = ("openocd", "st-flash", "stm32flash")


@click.command()
@click.argument("image", required=False, type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option(
    "--with",
    "tool_name",
    type=click.Choice(_TOOLS),
    help="openocd or st-flash write through an ST-LINK, stm32flash through the chip's ROM loader at --port.  "
    "[default: the first that is installed]",
)
@click.option(
    "--over-link",
    is_flag=True,
    help="Update the running firmware over its own link: serial or CAN.",
)
@click.option(
    "--port",
    "port_here",
    metavar="PORT",
    help="Serial port of the ROM loader, or the board's with --over-link.",
)
@click.option("--other-board", is_flag=True, help="Write it to a chip that holds another board's image, too.")
@click.option("--yes", is_flag=True, help="Do not ask whether the motors' supply is off.")
@json_option
def command(
    app: App,
    image: Path | None,
    tool_name: str | None,
    over_link: bool,
    port_here: str | None,
    other_board: bool,
    yes: bool,
) -> None:
    """Write the firmware image (an ELF file; the build's unless named) to a board, and read it back.

    An image that could not start is refused by what the file itself says, another chip by its id, and a board
    that holds another board's image by that image's name. Stored parameters stay as they are. When flashing
    is cut off the board runs nothing, and the same command puts that right.

    With --over-link no tool and no probe is needed, and IMAGE is an update (a .update file; the build's
    unless named): it goes into the slot that does not run, and stays if the board answers with it; if not,
    the board goes back to the image from before. When it is cut off, the same command goes on. The robot has
    to stand; the board starts anew, and its logs in memory are gone.

    \b
    Examples:
      truing flash                                          openocd or st-flash, whichever is installed
      truing flash --with stm32flash --port /dev/ttyUSB0    BOOT0 at 1, reset pressed
      truing --port /dev/ttyUSB0 flash --over-link          the board as it is, running
      truing --port can:socketcan:can0/2 flash --over-link  node 2 on the bus
    """
    if over_link:
        if tool_name or other_board:
            raise TruingError("--over-link takes neither --with nor --other-board")
        _over_link(app, image, port_here or app.port)
    else:
        _by_tool(app, image, tool_name, port_here, other_board, yes)


def _over_link(app: App, path: Path | None, port: str) -> None:
    from truing.board.connect import open_stream
    from truing.board.over_link import update_over_link
    from truing.flash.update_file import read_update
    from truing.link.client import Client
    from truing.workspace import image_path

    file = read_update(path or image_path().with_suffix(".update"))
    client = Client(open_stream(port))
    try:
        with app.progress(f"sending {file.header.name}") as progress:
            done = update_over_link(client, file, app.note, progress)
    finally:
        client.close()
    app.emit({"update": str(file.path), "port": port, **asdict(done)})
    app.say(
        f"{done.name}: {done.bytes - done.resumed_at} bytes sent; "
        f"it runs from slot {done.slot} and has checked in"
    )


def _by_tool(
    app: App, image: Path | None, tool_name: str | None, port_here: str | None, other_board: bool, yes: bool
) -> None:
    from truing.flash.image import read_image
    from truing.flash.tools import choose
    from truing.flash.write import check_board, check_chip, device_name, write_image
    from truing.workspace import image_path

    what = read_image(image or image_path())
    tool = choose(tool_name, port_here or app.port, what.chip)
    if not yes:
        if not app.asks:
            raise TruingError(
                "nobody is here who can say that the motors' supply is off", "switch it off and give --yes"
            )
        question = "Bridge inputs move while a board is flashed. Is the motors' supply off?"
        click.confirm(question, abort=True, err=True)
    seen = tool.chip()
    app.note(f"{tool.name}: chip {device_name(seen.device_id)}")
    check_chip(what, seen)
    if not other_board:
        check_board(tool, what)
    with app.progress(f"writing {what.chip.image_name} {what.version}") as progress:
        write_image(tool, what, app.note, progress)
    app.emit(
        {
            "image": str(what.path),
            "name": what.chip.image_name,
            "board": what.chip.board,
            "version": what.version,
            "tool": tool.name,
            "device_id": seen.device_id,
            "bytes": what.size,
        }
    )
    app.say(
        f"{what.chip.image_name} {what.version} ({what.chip.board}): {what.size} bytes written and verified; "
        f"{tool.after}"
    )
