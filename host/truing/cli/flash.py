"""`truing flash`: write the firmware image to a board."""

from __future__ import annotations

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
@click.option("--port", "port_here", metavar="PORT", help="Serial port of the ROM loader.")
@click.option("--other-board", is_flag=True, help="Write it to a chip that holds another board's image, too.")
@click.option("--yes", is_flag=True, help="Do not ask whether the motors' supply is off.")
@json_option
def command(
    app: App, image: Path | None, tool_name: str | None, port_here: str | None, other_board: bool, yes: bool
) -> None:
    """Write the firmware image (an ELF file; the build's unless named) to a board, and read it back.

    An image that could not start is refused by what the file itself says, another chip by its id, and a board
    that holds another board's image by that image's name. Stored parameters stay as they are. When flashing
    is cut off the board runs nothing, and the same command puts that right.

    \b
    Examples:
      truing flash                                          openocd or st-flash, whichever is installed
      truing flash --with stm32flash --port /dev/ttyUSB0    BOOT0 at 1, reset pressed
    """
    from truing.flash.image import read_image
    from truing.flash.tools import choose
    from truing.flash.write import check_board, check_chip, device_name, write_image
    from truing.workspace import image_path

    what = read_image(image or image_path())
    tool = choose(tool_name, port_here or app.port)
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
