"""The order in which an image gets onto a chip: right chip, no program, code, vectors; each read back."""

from __future__ import annotations

from collections.abc import Callable

from truing.errors import FlashError
from truing.flash.image import CHIPS, Image, Part, name_held, name_place
from truing.flash.tools import ChipSeen, Tool
from truing.progress import Progress, ignore_progress

# What the ids of RM0090 38.6.1 and of AN2606's table stand for: the parts that are most often at hand.
_DEVICES = {
    0x410: "STM32F103",
    0x411: "STM32F2",
    0x413: "STM32F405 or F407",
    0x419: "STM32F42x or F43x",
    0x421: "STM32F446",
    0x422: "STM32F303",
    0x423: "STM32F401",
    0x431: "STM32F411",
    0x433: "STM32F401",
    0x440: "STM32F05x",
    0x449: "STM32F74x",
    0x450: "STM32H74x",
    0x469: "STM32G471 to G484",
}
# FLASH_OPTCR, RM0090 3.9.10: level of the brown-out reset, 0 the highest; lock and start; read protection.
_BOR_LEV = 3 << 2
_OPTION_CONTROL = 3
_NO_PROTECTION = 0xAA
# Stack and start at address 0: a chip that starts from these locks up with its pins floating.
_NO_PROGRAM = bytes(8)


def device_name(device_id: int) -> str:
    """A chip's id, and what it stands for."""
    return f"0x{device_id:03x} ({_DEVICES.get(device_id, 'unknown to truing')})"


def check_chip(image: Image, seen: ChipSeen) -> None:
    """Refuse a chip that the image is not for.

    Raises
    ------
    FlashError : another chip, or too little flash.
    """
    if seen.device_id != image.chip.device_id:
        raise FlashError(
            f"{image.path.name} is for an {image.chip.title} (0x{image.chip.device_id:03x}), "
            f"and this chip is {device_name(seen.device_id)}; nothing was written",
            "is it the right board?",
        )
    needed = image.parts[-1].end - image.chip.flash[0]
    if seen.flash_kib is not None and needed > seen.flash_kib << 10:
        raise FlashError(
            f"{image.path.name} needs {-(-needed >> 10)} KiB of flash, and this chip has {seen.flash_kib}; "
            "nothing was written"
        )


def check_board(tool: Tool, image: Image) -> None:
    """Refuse a chip that holds the image of another board: on other pins, this one would move what it likes.

    A chip without an image of truing, or one whose flashing was cut off, does not say what it is soldered to.

    Raises
    ------
    FlashError : another board.
    """
    held = name_held(tool.read(*name_place(image.chip)))
    if held in ("", image.chip.image_name):
        return
    boards = {chip.image_name: f"{chip.image_name} ({chip.board})" for chip in CHIPS}
    raise FlashError(
        f"{image.path.name} is for {boards[image.chip.image_name]}, and this board holds the image of "
        f"{boards.get(held, held)}; nothing was written",
        "name that board's image, or give --other-board if the chip is wired as this one needs it",
    )


def write_image(
    tool: Tool, image: Image, say: Callable[[str], None], progress: Progress = ignore_progress
) -> None:
    """Write an image and read all of it back.

    The vectors go first, as words that start nothing, and last, as they are: a chip whose flashing was cut
    off in between runs no half of a program.

    Raises
    ------
    FlashError : the tool failed, or flash does not hold what was written.
    """
    vectors, *code = image.parts
    _write_one(tool, Part(vectors.address, _NO_PROGRAM))
    done = 0
    for part in (*code, vectors):
        _write_one(tool, part)
        done += len(part.data)
        progress(done / image.size)
        say(f"0x{part.address:08x}: {len(part.data)} bytes written and read back")
    say(_set_brown_out_reset(tool))
    tool.start()


def _set_brown_out_reset(tool: Tool) -> str:
    """Bring the brown-out reset to its highest level, above what flash needs; says what was done.

    All other option bytes stay as they are, and a chip with read protection is left alone: a wrong byte there
    could lock it for ever.

    Raises
    ------
    FlashError : the chip does not hold what was set.
    """
    if not tool.chip_of.tested_ways:
        return (
            f"the option bytes of an {tool.chip_of.title} are left as they are; where `truing info` names "
            "brown_out_reset_off, set BOR_LEV to 4 with ST's programmer"
        )
    before = tool.option_bytes()
    if before is None:
        return (
            f"{tool.name} leaves the option bytes as they are; `truing info` names brown_out_reset_off where "
            "they leave the brown-out reset off, and a probe (openocd, st-flash) sets it"
        )
    if before & _BOR_LEV == 0:
        return "brown-out reset: at its highest level already"
    if before >> 8 & 0xFF != _NO_PROTECTION:
        return "brown-out reset: left as it is, since the chip is read protected"
    tool.set_option_bytes(before & ~(_BOR_LEV | _OPTION_CONTROL))
    held = tool.option_bytes()
    if held is None or (held ^ before) & ~_OPTION_CONTROL != before & _BOR_LEV:
        raise FlashError(
            "the chip's option bytes are not what was set",
            "run it again; the image is written, and names brown_out_reset_off until they are",
        )
    return "brown-out reset: set to its highest level (2.83 V)"


def _write_one(tool: Tool, part: Part) -> None:
    tool.write(part)
    held = tool.read(part.address, len(part.data))
    if held != part.data:
        pairs = zip(held, part.data, strict=False)
        at = next((i for i, (a, b) in enumerate(pairs) if a != b), min(len(held), len(part.data)))
        raise FlashError(
            f"flash at 0x{part.address + at:08x} does not hold what was written",
            "leave the motors' supply off and run it again; if it stays so, flash is worn or protected",
        )
