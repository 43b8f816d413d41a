"""The header that an image begins with in its slot (`firmware/core/image_slot.h`)."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

HEADER_SIZE = 512
_MAGIC, _FORMAT = 0x474D_4954, 1  # "TIMG"
_FIELDS = struct.Struct("<5I40sI")
_MARKS = slice(HEADER_SIZE - 32, HEADER_SIZE)  # erased in a file: the board writes them


@dataclass(frozen=True, slots=True)
class Header:
    """What an image says of itself: the slot it is linked for, its size in bytes, its name."""

    slot: int
    size: int
    name: str

    @property
    def board(self) -> str:
        """What all images for its board are called."""
        return self.name.partition(" ")[0]

    @property
    def version(self) -> str:
        """Its version."""
        return self.name.partition(" ")[2]


def read_header(image: bytes) -> Header | None:
    """The header of these bytes; None where there is none, or where it does not fit what follows it."""
    if len(image) < HEADER_SIZE:
        return None
    magic, form, slot, size, content_crc, name, header_crc = _FIELDS.unpack_from(image)
    good = (
        (magic, form, size) == (_MAGIC, _FORMAT, len(image))
        and zlib.crc32(image[: _FIELDS.size - 4]) == header_crc
        and zlib.crc32(image[HEADER_SIZE:]) == content_crc
    )
    return Header(slot, size, name.split(b"\0")[0].decode("ascii", "replace")) if good else None


def has_marks(image: bytes) -> bool:
    """Whether the words that a board writes are written already."""
    return image[_MARKS].strip(b"\xff") != b""
