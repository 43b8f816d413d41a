"""The file of an update over the link: the image for either slot, and the chain of digests it travels by."""

from __future__ import annotations

import hashlib
import zipfile
from dataclasses import dataclass
from pathlib import Path

from truing.errors import FileError
from truing.flash.header import Header, has_marks, read_header

_SLOTS = 2
_LAST = bytes(32)  # what the last chunk gives as the digest of the next
_NEXT = "`./run setup` builds the .update file beside the image"


@dataclass(frozen=True, slots=True)
class Chunk:
    """Some bytes of an image, and the digest of the chunk behind them."""

    data: bytes
    next: bytes


@dataclass(frozen=True, slots=True)
class UpdateFile:
    """An image of the firmware, linked for each of the two slots."""

    path: Path
    header: Header  # the first slot's
    images: tuple[bytes, ...]


def read_update(path: Path) -> UpdateFile:
    """Read an update file and check that it is whole.

    Raises
    ------
    FileError : it is none, or its images do not belong together.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            images = tuple(archive.read(f"slot{slot}.bin") for slot in range(_SLOTS))
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror})", _NEXT) from error
    except (zipfile.BadZipFile, KeyError) as error:
        raise FileError(path, f"is no update for a board of truing ({error})", _NEXT) from error
    headers = [read_header(image) for image in images]
    for slot, (header, image) in enumerate(zip(headers, images, strict=True)):
        if header is None or has_marks(image):
            raise FileError(path, f"the image for slot {slot} is damaged", _NEXT)
        if header.slot != slot or header.name != headers[0].name:  # type: ignore[union-attr]
            raise FileError(path, "its two images do not belong together", _NEXT)
    assert headers[0] is not None
    return UpdateFile(path, headers[0], images)


def chain(image: bytes, chunk_size: int) -> tuple[bytes, list[Chunk]]:
    """The digest that stands for the whole image, and its chunks: each gives the digest of the next."""
    chunks: list[Chunk] = []
    digest = _LAST
    for at in reversed(range(0, len(image), chunk_size)):
        chunk = Chunk(image[at : at + chunk_size], digest)
        digest = hashlib.sha256(chunk.data + chunk.next).digest()
        chunks.append(chunk)
    return digest, chunks[::-1]
