"""A virtual board that is updated over its link, and images small enough to cut an update off everywhere."""

from __future__ import annotations

import contextlib
import struct
import zipfile
import zlib
from pathlib import Path

from hil_sim import VirtualRobot
from truing.board.device import Device
from truing.board.over_link import update_over_link
from truing.errors import FlashError, LinkClosed, LinkError, LinkTimeout
from truing.flash.header import HEADER_SIZE
from truing.flash.update_file import UpdateFile, read_update
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream

SLOTS = (0x0800_C000, 0x0802_0000)
_SLOT_SIZE = 80 << 10
_STACK = 0x2000_2000
_CPSID_WFI_LOOP = bytes.fromhex("72b630bffde7")  # asleep for ever, with interrupts off


def sleeper(slot: int, name: str, length: int = 700) -> bytes:
    """An image that starts, sleeps and never answers."""
    vectors = struct.pack("<2I", _STACK, SLOTS[slot] + HEADER_SIZE + 8 + 1)
    content = (vectors + _CPSID_WFI_LOOP).ljust(length - HEADER_SIZE, b"\x5a")
    header = struct.pack("<5I40s", 0x474D_4954, 1, slot, length, zlib.crc32(content), name.encode())
    header += struct.pack("<I", zlib.crc32(header))
    return header.ljust(HEADER_SIZE, b"\xff") + content


def sleepers(path: Path, name: str = "truing-f405 9.9") -> UpdateFile:
    """The update file of one."""
    with zipfile.ZipFile(path, "w") as archive:
        for slot in range(2):
            archive.writestr(f"slot{slot}.bin", sleeper(slot, name))
    return read_update(path)


class CutStream(VirtualStream):
    """A line to a virtual board that is cut in the write of that number, or right behind it."""

    def __init__(self, robot: VirtualRobot, writes: int, *, whole: bool = False) -> None:
        super().__init__(robot)
        self.left = writes
        self._whole = whole

    def write(self, data: bytes) -> None:
        """Pass half of the frame on where the line is cut, or all of it."""
        if self.left == 0:
            super().write(data if self._whole else data[: len(data) // 2])
            self.close()
            raise LinkClosed("sim: the cable was pulled")
        self.left -= 1
        super().write(data)


class UpdateBoard:
    """A board with the built image, whose flash can be put back to what it was."""

    def __init__(self, image: Path) -> None:
        self.robot = VirtualRobot(image)
        self.keep()

    def __enter__(self) -> UpdateBoard:
        return self

    def __exit__(self, *_: object) -> None:
        self.robot.close()

    def keep(self) -> None:
        """Take the slots as they are for those that `restore` brings back."""
        self._before = tuple(self.robot.read_memory(at, _SLOT_SIZE) for at in SLOTS)

    def power_up(self) -> None:
        """Switch on, with the line and the flash as they are."""
        self.robot.cut_power_at_flash_write(None)
        self.robot.set_power(False)
        self.robot.set_power(True)

    def restore(self) -> None:
        """The board as a probe left it, switched on and started."""
        self.robot.cut_power_at_flash_write(None)
        self.robot.set_power(False)
        for at, held in zip(SLOTS, self._before, strict=True):
            if self.robot.read_memory(at, _SLOT_SIZE) != held:
                self.robot.write_flash(at, held)
        self.power_up()
        self.robot.run_us(20_000)
        self.robot.link_read()

    def client(self) -> Client:
        """A new host."""
        return Client(VirtualStream(self.robot))


def answering_slot(board: UpdateBoard) -> int:
    """The slot of the image that answers a new host, once a sleeper's three trials are over at the latest.

    Raises
    ------
    LinkTimeout : none does.
    """
    for _ in range(8):
        with contextlib.suppress(LinkError):
            return next(i for i, slot in enumerate(Device(board.client()).image_slots()) if slot.runs)
    raise LinkTimeout("the board does not answer")


def cut_update(board: UpdateBoard, file: UpdateFile, write: int) -> bool:
    """An update with the power cut in that flash write, and on again; False: there was no such write."""
    board.restore()
    board.robot.cut_power_at_flash_write(write)
    with contextlib.suppress(FlashError, LinkError):
        update_over_link(board.client(), file, lambda _: None)
    failed = not board.robot.stats().powered
    board.power_up()
    return failed
