"""The STM32G474's image, which no emulator runs: what can be said of it without running it."""

from __future__ import annotations

from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile

from hil_sim import VirtualRobot, VirtualRobotError
from truing.errors import FlashError
from truing.flash.image import Image, read_image
from truing.flash.tools import ChipSeen, OpenOcd, choose
from truing.flash.write import check_board, check_chip

BANK_2 = 0x0804_0000


class ChipThatHolds(OpenOcd):
    """A probe on a chip with these bytes behind its vectors."""

    def __init__(self, name: bytes, image: Image) -> None:
        super().__init__(image.chip)
        self.name_held = name

    def read(self, address: int, size: int) -> bytes:
        """The same for every place."""
        return self.name_held.ljust(size, b"\0")


def test_its_image_names_its_board_and_leaves_the_parameters_bank_alone(g474_image: Path) -> None:
    image = read_image(g474_image)
    assert (image.chip.image_name, image.chip.title) == ("truing-g474", "STM32G474")
    vectors, *code = image.parts
    assert vectors.end <= code[0].address == 0x0800_0800  # a page of its own: it is erased twice
    assert image.parts[-1].end <= BANK_2


@pytest.mark.parametrize(("device_id", "seen"), [(0x413, "STM32F405"), (0x431, "STM32F411")])
def test_it_is_refused_on_another_chip(g474_image: Path, device_id: int, seen: str) -> None:
    image = read_image(g474_image)
    with pytest.raises(FlashError, match=rf"for an STM32G474 \(0x469\), and this chip is .*{seen}"):
        check_chip(image, ChipSeen(device_id, 1024))
    check_chip(image, ChipSeen(0x469, 512))


def test_the_first_familys_image_is_refused_on_its_chip(image: Path) -> None:
    with pytest.raises(FlashError, match=r"this chip is 0x469 \(STM32G471 to G484\)"):
        check_chip(read_image(image), ChipSeen(0x469, 512))


def test_a_chip_that_holds_another_boards_image_is_refused(g474_image: Path) -> None:
    image = read_image(g474_image)
    with pytest.raises(FlashError, match="this board holds the image of truing-g474-mine"):
        check_board(ChipThatHolds(b"truing-g474-mine 0.1.0", image), image)
    check_board(ChipThatHolds(b"truing-g474 0.0.9", image), image)


def test_the_rom_loader_is_refused_as_unknown(g474_image: Path) -> None:
    chip = read_image(g474_image).chip
    with pytest.raises(FlashError, match="the ROM loader of an STM32G474 is not known"):
        choose("stm32flash", "/dev/ttyUSB0", chip)


def test_the_virtual_board_does_not_pretend_to_run_it(g474_image: Path, native_library: Path) -> None:
    with pytest.raises(VirtualRobotError, match="for an STM32G474, of which there is no virtual board"):
        VirtualRobot(g474_image)


def test_the_core_in_it_is_the_core_in_the_first_familys(image: Path, g474_image: Path) -> None:
    """The seam: each object of the core, code and constants, is the same but for the board's name."""
    folders = [path.parents[1] / "firmware/core/CMakeFiles/truing_core.dir" for path in (image, g474_image)]
    objects = [sorted(folder.glob("*.obj")) for folder in folders]
    assert [each.name for each in objects[0]] == [each.name for each in objects[1]]
    assert len(objects[0]) > 30
    differ = [first.name for first, second in zip(*objects, strict=True) if _loaded(first) != _loaded(second)]
    assert differ == ["requests.c.obj"]  # HELLO says the board's name


def _loaded(path: Path) -> list[tuple[str, bytes]]:
    with path.open("rb") as file:
        return [
            (section.name, section.data())
            for section in ELFFile(file).iter_sections()
            if section["sh_flags"] & 2 and section["sh_type"] == "SHT_PROGBITS"
        ]
