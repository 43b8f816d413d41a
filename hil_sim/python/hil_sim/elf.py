"""Reads what a programmer writes into flash, and the symbols, out of a 32-bit little-endian ARM ELF file.

The layout is that of the System V ABI, chapter 4 (ELF header, sections, symbols) and chapter 5 (segments).
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field
from pathlib import Path

_HEADER = struct.Struct("<16sHHIIIIIHHHHHH")
_SEGMENT = struct.Struct("<IIIIIIII")
_SECTION = struct.Struct("<IIIIIIIIII")
_SYMBOL = struct.Struct("<IIIBBH")

_MACHINE_ARM = 40
_SEGMENT_LOAD = 1
_SECTION_SYMBOLS = 2
_FLASH_START = 0x0800_0000
_VECTORS = (4 * (16 + 82), 4 * (16 + 102))  # RM0090 table 61; the STM32G474's, which there is no board of
_NAME_LENGTH = 64
_WORD = re.compile(rb"[a-z][\w.-]{3,}")
_KINDS = (0, 1, 2)  # no type, object, function


class ElfError(ValueError):
    """A file that is not an image for the board."""


@dataclass(frozen=True)
class Image:
    """The parts of an ELF file that a board needs.

    Attributes
    ----------
    segments : (address, bytes) pairs at the addresses they are loaded to, which is where flash holds them.
    symbols : address and size in bytes of each named object and function (functions without the Thumb bit).
    """

    path: Path
    segments: tuple[tuple[int, bytes], ...]
    symbols: dict[str, tuple[int, int]] = field(repr=False)

    @property
    def name(self) -> str:
        """The first word of what stands behind the vector table; empty where that is no text."""
        address, content = self.segments[0]
        words = [content[end:][:_NAME_LENGTH].split(b"\0")[0].split(b" ")[0] for end in _VECTORS]
        word = next((word for word in words if _WORD.fullmatch(word)), b"")
        return word.decode() if address == _FLASH_START else ""

    @staticmethod
    def load(path: Path) -> Image:
        """Read an image.

        Raises
        ------
        ElfError : the file cannot be read, or is no 32-bit little-endian ARM ELF file with something to load.
        """
        try:
            data = path.read_bytes()
        except OSError as error:
            raise ElfError(f"cannot read {path}: {error.strerror}") from error
        try:
            return _parse(path, data)
        except (struct.error, IndexError, UnicodeDecodeError) as error:
            raise ElfError(f"{path} is cut short or damaged ({error})") from error


def _parse(path: Path, data: bytes) -> Image:
    if data[:6] != b"\x7fELF\x01\x01":
        raise ElfError(f"{path} is not a 32-bit little-endian ELF file")
    header = _HEADER.unpack_from(data)
    machine, segment_offset, section_offset = header[2], header[5], header[6]
    segment_count, section_count = header[10], header[12]
    if machine != _MACHINE_ARM:
        raise ElfError(f"{path} is not for ARM (machine {machine})")
    segments = []
    for i in range(segment_count):
        kind, offset, _, address, size, *_ = _SEGMENT.unpack_from(data, segment_offset + i * _SEGMENT.size)
        if kind == _SEGMENT_LOAD and size > 0:
            content = data[offset : offset + size]
            if len(content) != size:
                raise ElfError(f"{path} is cut short")
            segments.append((address, content))
    if not segments:
        raise ElfError(f"{path} has nothing to load")
    return Image(path, tuple(segments), _symbols(data, section_offset, section_count))


def _symbols(data: bytes, section_offset: int, section_count: int) -> dict[str, tuple[int, int]]:
    sections = [_SECTION.unpack_from(data, section_offset + i * _SECTION.size) for i in range(section_count)]
    found: dict[str, tuple[int, int]] = {}
    for section in sections:
        kind, offset, size, link = section[1], section[4], section[5], section[6]
        if kind != _SECTION_SYMBOLS:
            continue
        names = sections[link][4]
        for at in range(offset, offset + size, _SYMBOL.size):
            name_at, value, length, info, _, _ = _SYMBOL.unpack_from(data, at)
            end = data.index(b"\0", names + name_at)
            name = data[names + name_at : end].decode()
            if name and not name.startswith("$") and info & 0xF in _KINDS:
                address = value & ~1 if info & 0xF == 2 else value
                found[name] = (address, length)
    return found
