"""Completes the headers of linked images: `seal A.elf`, for a probe, and `pack A.elf B.elf OUT.update`.

The header's layout is that of `core/image_slot.h`. Sealed, an image is one that a host has greeted already.
The update file is a zip archive of both slots' bytes without marks, which the board writes itself.
"""

import struct
import sys
import zipfile
import zlib
from pathlib import Path

SLOTS = (0x0800_C000, 0x0802_0000)
SLOT_SIZE = 80 << 10
HEADER = struct.Struct("<5I40s")  # magic, format, slot, size, CRC of what follows, name
HEADER_SIZE = 512
MARKS_AT = HEADER_SIZE - 32
CONFIRMED = struct.pack("<7I", 1, 0x5AA5C33C, *[0xFFFF_FFFF] * 3, 0x3CC3A55A, 0xFFFF_FFFF)


def segments(elf: bytes) -> list[tuple[int, int, int]]:
    """Address, place in the file and size of everything that lies in flash."""
    offset, size, count = *struct.unpack_from("<I", elf, 28), *struct.unpack_from("<2H", elf, 42)
    found = []
    for number in range(count):
        kind, at, _, address, length = struct.unpack_from("<5I", elf, offset + number * size)
        if kind == 1 and length > 0:
            found.append((address, at, length))
    return found


def image_of(elf: bytes, slot: int) -> bytearray:
    """The image's bytes with the header complete, and no marks."""
    start = SLOTS[slot]
    end = start + SLOT_SIZE
    pieces = [(a, elf[at : at + length]) for a, at, length in segments(elf) if start <= a < end]
    size = max(address + len(data) for address, data in pieces) - start
    image = bytearray(b"\xff" * (-(-size // 4) * 4))
    for address, data in pieces:
        image[address - start : address - start + len(data)] = data
    magic, form, _, _, _, name = HEADER.unpack_from(image)
    header = HEADER.pack(magic, form, slot, len(image), zlib.crc32(image[HEADER_SIZE:]), name)
    image[: len(header) + 4] = header + struct.pack("<I", zlib.crc32(header))
    image[MARKS_AT:HEADER_SIZE] = b"\xff" * (HEADER_SIZE - MARKS_AT)
    return image


def seal(path: Path) -> None:
    """Complete the header within the ELF file of slot 0."""
    elf = bytearray(path.read_bytes())
    image = image_of(elf, 0)
    image[MARKS_AT : MARKS_AT + len(CONFIRMED)] = CONFIRMED
    at = next(at for address, at, _ in segments(elf) if address == SLOTS[0])
    elf[at : at + HEADER_SIZE] = image[:HEADER_SIZE]
    path.write_bytes(elf)


def pack(elves: list[Path], out: Path) -> None:
    """The update file; its bytes depend on the images alone."""
    with zipfile.ZipFile(out, "w") as archive:
        for slot, elf in enumerate(elves):
            entry = zipfile.ZipInfo(f"slot{slot}.bin", (1980, 1, 1, 0, 0, 0))
            archive.writestr(entry, bytes(image_of(elf.read_bytes(), slot)))


if __name__ == "__main__":
    paths = [Path(name) for name in sys.argv[2:]]
    if sys.argv[1] == "seal":
        seal(paths[0])
    else:
        pack(paths[:2], paths[2])
