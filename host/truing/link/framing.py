"""Frames on the wire: COBS, CRC-32, and a decoder that survives any bytes.

A frame before COBS is `id u8 | sequence u16 | payload | crc32 u32`, little endian; the CRC is
zlib's over everything before it. After COBS comes one zero byte. See protocol/SPEC.md.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

from truing.errors import StuffingError
from truing.link import cobs

MAX_PAYLOAD = 1024
_HEADER = struct.Struct("<BH")
_CRC = struct.Struct("<I")
OVERHEAD = _HEADER.size + _CRC.size
# COBS adds one byte for every 254 begun.
MAX_ENCODED = MAX_PAYLOAD + OVERHEAD + (MAX_PAYLOAD + OVERHEAD) // 254 + 1


@dataclass(frozen=True, slots=True)
class Frame:
    """One message on the wire."""

    id: int
    sequence: int
    payload: bytes = b""


@dataclass(slots=True)
class FramingCounts:
    """What a decoder has seen since it was made."""

    bytes: int = 0
    frames: int = 0
    dropped: int = 0


def encode(frame: Frame) -> bytes:
    """Return the bytes of `frame` on the wire.

    The leading zero ends whatever noise came before, so that a damaged frame never takes the
    next one with it.
    """
    if len(frame.payload) > MAX_PAYLOAD:
        raise ValueError(f"a payload of {len(frame.payload)} bytes is longer than {MAX_PAYLOAD}")
    body = _HEADER.pack(frame.id, frame.sequence) + frame.payload
    stuffed = cobs.encode(body + _CRC.pack(zlib.crc32(body)))
    return b"\0" + stuffed + b"\0"


class FrameDecoder:
    """Turns received bytes into frames, however they are cut up, and never raises.

    Whatever does not decode (bad COBS, bad CRC, too short, too long) is counted as dropped, and
    decoding goes on after the next zero byte.
    """

    def __init__(self) -> None:
        self.counts = FramingCounts()
        self._held = bytearray()
        self._overlong = False

    def feed(self, data: bytes) -> list[Frame]:
        """Take the next bytes of the line; return the frames that they complete."""
        self.counts.bytes += len(data)
        frames: list[Frame] = []
        *ended, rest = data.split(b"\0")
        for chunk in ended:
            self._hold(chunk)
            encoded, self._held = self._held, bytearray()
            if self._overlong:
                self._overlong = False
                self.counts.dropped += 1
            elif encoded:
                self._accept(bytes(encoded), frames)
        self._hold(rest)
        return frames

    def _hold(self, chunk: bytes) -> None:
        if len(self._held) + len(chunk) > MAX_ENCODED:
            self._overlong = True
        if self._overlong:
            self._held.clear()
        else:
            self._held += chunk

    def _accept(self, encoded: bytes, frames: list[Frame]) -> None:
        frame = _decode(encoded)
        if frame is None:
            self.counts.dropped += 1
        else:
            self.counts.frames += 1
            frames.append(frame)


def _decode(encoded: bytes) -> Frame | None:
    """The frame in one COBS-coded stretch without zeros, or None where there is none."""
    try:
        body = cobs.decode(encoded)
    except StuffingError:
        return None
    if len(body) < OVERHEAD:
        return None
    content, (crc,) = body[: -_CRC.size], _CRC.unpack_from(body, len(body) - _CRC.size)
    if zlib.crc32(content) != crc:
        return None
    message_id, sequence = _HEADER.unpack_from(content)
    return Frame(message_id, sequence, content[_HEADER.size :])
