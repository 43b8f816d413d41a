"""What an image is for and made of, read from the image itself: its name, its vector table, its places."""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from truing.errors import FileError
from truing.flash.header import HEADER_SIZE, read_header

_NEXT = "`./run setup` builds the image for the STM32F405; the presets of CMakePresets.json build the others"
_NAME_LENGTH = 64


@dataclass(frozen=True, slots=True)
class Chip:
    """A chip, as it is soldered on one board, that truing has an image for.

    Parameters
    ----------
    image_name : what the board's images carry behind their vectors.
    board : what tells the board from others with that chip.
    device_id : DBGMCU_IDCODE bits 11 to 0, and what the ROM loader reports (RM0090 38.6.1, AN2606).
    vectors : words of the vector table, the initial stack pointer included.
    memories : address and size of what the stack may lie in.
    kept : first address of the parameters, and the first behind them; no image may touch them.
    slot : where the image lies whose loader is at the start of flash; None: it lies there itself.
    flash_size_at : the register that says how much flash there is, in KiB.
    openocd : OpenOCD's file of the chip.
    tested_ways : whether option bytes and ROM loader are reached; otherwise a probe writes flash and no more.
    """

    image_name: str
    board: str
    title: str
    device_id: int
    flash: tuple[int, int]
    vectors: int
    memories: tuple[tuple[int, int], ...]
    kept: tuple[int, int]
    slot: int | None
    flash_size_at: int
    openocd: str
    tested_ways: bool


_H405 = Chip(
    image_name="truing-f405",
    board="Olimex STM32-H405, 8 MHz",
    title="STM32F405",
    device_id=0x413,
    flash=(0x0800_0000, 1 << 20),
    vectors=16 + 82,
    memories=((0x2000_0000, 128 << 10), (0x1000_0000, 64 << 10)),
    kept=(0x0800_4000, 0x0800_C000),
    slot=0x0800_C000,
    flash_size_at=0x1FFF_7A22,
    openocd="stm32f4x",
    tested_ways=True,
)

_G474 = Chip(
    image_name="truing-g474",
    board="ST NUCLEO-G474RE, 24 MHz",
    title="STM32G474",
    device_id=0x469,
    flash=(0x0800_0000, 512 << 10),
    vectors=16 + 102,
    memories=((0x2000_0000, 96 << 10), (0x1000_0000, 32 << 10)),
    kept=(0x0804_0000, 0x0805_0000),
    slot=None,
    flash_size_at=0x1FFF_75E0,
    openocd="stm32g4x",
    tested_ways=False,
)

CHIPS = (
    _H405,
    replace(_H405, image_name="truing-f405-pwm", board="Olimex STM32-H405, drivers with PWM and direction"),
    replace(_H405, image_name="truing-f405-phase", board="Olimex STM32-H405, drivers with enable and phase"),
    replace(_H405, image_name="truing-f405-usb", board="USB pins free, right bridge on TIM8, 12 MHz"),
    _G474,
)


@dataclass(frozen=True, slots=True)
class Part:
    """Bytes that lie together in flash."""

    address: int
    data: bytes

    @property
    def end(self) -> int:
        """The first address behind it."""
        return self.address + len(self.data)


@dataclass(frozen=True, slots=True)
class Image:
    """An image that has been found fit for its chip; the loader, with the vectors, is its first part."""

    path: Path
    chip: Chip
    version: str
    parts: tuple[Part, ...]

    @property
    def size(self) -> int:
        """Bytes to be written."""
        return sum(len(part.data) for part in self.parts)


def read_image(path: Path) -> Image:
    """Read an ELF file and judge it by its name, its vectors and where its parts lie.

    Raises
    ------
    FileError : it is no image for a board that truing knows, or one that could not start there.
    """
    parts = _parts(path)
    vectors = parts[0]
    for chip in CHIPS:
        found = _text(vectors.data[4 * chip.vectors :])
        if vectors.address == chip.flash[0] and found.startswith(chip.image_name.encode() + b" "):
            problem = _problem(chip, parts)
            if problem:
                raise FileError(path, problem, _NEXT)
            version = found.decode("ascii", "replace").partition(" ")[2]
            return Image(path, chip, version, tuple(parts))
    known = ", ".join(chip.image_name for chip in CHIPS)
    carried = _name_anywhere(parts)
    what = f"is an image named {carried!r}" if carried else "carries no name behind its vectors"
    raise FileError(path, f"{what}; truing flashes {known}", _NEXT)


def name_place(chip: Chip) -> tuple[int, int]:
    """Address and size of what holds the name of an image in a chip's flash."""
    return chip.flash[0] + 4 * chip.vectors, _NAME_LENGTH


def name_held(behind_vectors: bytes) -> str:
    """The name of the image in a chip's flash, without its version; empty where it is none of truing's."""
    name = _text(behind_vectors).decode("ascii", "replace").partition(" ")[0]
    return name if name.startswith("truing-") else ""


def _text(data: bytes) -> bytes:
    return data[:_NAME_LENGTH].split(b"\0")[0]


def _parts(path: Path) -> list[Part]:
    from elftools.common.exceptions import ELFError
    from elftools.elf.elffile import ELFFile

    try:
        with path.open("rb") as file:
            elf = ELFFile(file)
            if elf.get_machine_arch() != "ARM" or elf.elfclass != 32 or not elf.little_endian:
                raise FileError(path, f"is a program for {elf.get_machine_arch()}, not for a Cortex-M", _NEXT)
            pieces = sorted(
                (segment["p_paddr"], segment.data())
                for segment in elf.iter_segments("PT_LOAD")
                if segment["p_filesz"]
            )
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror})", _NEXT) from error
    except ELFError as error:
        raise FileError(path, f"is not an ELF file ({error})", "give the .elf file of the build") from error
    parts: list[Part] = []
    for address, data in pieces:
        if parts and parts[-1].end <= address < parts[-1].end + 16:
            gap = b"\xff" * (address - parts[-1].end)
            parts[-1] = Part(parts[-1].address, parts[-1].data + gap + data)
        else:
            parts.append(Part(address, data))
    if not parts:
        raise FileError(path, "holds nothing to be written", _NEXT)
    return parts


def _name_anywhere(parts: list[Part]) -> str:
    begin = parts[0].data.find(b"truing-")
    name = parts[0].data[begin:][:_NAME_LENGTH].split(b"\0")[0] if begin >= 0 else b""
    return name.decode("ascii", "replace")


def _problem(chip: Chip, parts: list[Part]) -> str:
    """Why a chip could not take these parts, or not start with them; empty when it could."""
    start, size = chip.flash
    for part in parts:
        where = f"its bytes at 0x{part.address:08x} to 0x{part.end - 1:08x}"
        if part.address < start or part.end > start + size:
            return f"{where} lie outside the flash of an {chip.title}"
        if part.address < chip.kept[1] and part.end > chip.kept[0]:
            return f"{where} would overwrite the stored parameters"
    if any(after.address < before.end for before, after in pairwise(parts)):
        return "its parts overlap"
    if chip.slot is None:
        return _problem_of_vectors(chip, parts, parts[0].data)
    slot = next((part for part in parts if part.address == chip.slot), None)
    if slot is None:
        return f"it holds no image at 0x{chip.slot:08x}"
    for table in (parts[0].data, slot.data[HEADER_SIZE:]):
        problem = _problem_of_vectors(chip, parts, table)
        if problem:
            return problem
    header = read_header(slot.data)
    if header is None:
        return "it is damaged: its header does not fit what follows it"
    loader = _text(parts[0].data[4 * chip.vectors :]).decode("ascii", "replace")
    return "" if header.name == loader else f"its loader is that of {loader}"


def _problem_of_vectors(chip: Chip, parts: list[Part], table: bytes) -> str:
    if len(table) < 4 * chip.vectors:
        return "it ends within its vectors"
    stack, *vectors = struct.unpack_from(f"<{chip.vectors}I", table)
    if stack % 8 or not any(base < stack <= base + length for base, length in chip.memories):
        return f"its stack begins at 0x{stack:08x}, where an {chip.title} has no memory"
    for number, vector in enumerate(vectors, start=1):
        if not vector & 1 or not any(part.address <= vector < part.end for part in parts):
            return f"its vector {number}, 0x{vector:08x}, leads to no code of this image"
    return ""
