"""Consistent Overhead Byte Stuffing: bytes without a zero, one more for every 254 begun.

Cheshire and Baker 1999, "Consistent overhead byte stuffing", IEEE/ACM Transactions on Networking 7(2). Each
block is a code and code - 1 bytes that are not zero; a code below 255 stands for a zero after its block.
"""

from __future__ import annotations

from truing.errors import StuffingError

FULL = 255


def encode(data: bytes) -> bytes:
    """The data without zeros."""
    out = bytearray()
    parts = data.split(b"\0")
    for part in parts:
        begin = 0
        while len(part) - begin >= FULL - 1:
            out.append(FULL)
            out += part[begin : begin + FULL - 1]
            begin += FULL - 1
        # A full block stands for no zero: at the very end none is due, and the rest is left out.
        if begin < len(part) or part is not parts[-1] or not begin:
            out.append(len(part) - begin + 1)
            out += part[begin:]
    return bytes(out)


def decode(stuffed: bytes) -> bytes:
    """The data that was encoded.

    Raises
    ------
    StuffingError : no encoder made these bytes.
    """
    out = bytearray()
    at, end = 0, len(stuffed)
    while at < end:
        code = stuffed[at]
        block = stuffed[at + 1 : at + code]
        at += code
        if not code or at > end or 0 in block:
            raise StuffingError("a zero among stuffed bytes, or an end within a block")
        out += block
        if code < FULL and at < end:
            out.append(0)
    return bytes(out)
