"""Decodes the log's sealed blocks into integer records, as protocol/SPEC.md says."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from truing_protocol import (
    LOG_BLOCK_SIZE,
    LOG_HEADER_DTYPE,
    LOG_PREDICT_LINE,
    LOG_RECORD_DTYPE,
    LOG_RECORD_VERSION,
    LogHeader,
)

_WORD = 0xFFFF_FFFF
_FIELDS = len(LOG_PREDICT_LINE)
_NAMES = LOG_RECORD_DTYPE.names or ()


class _BadBlockError(ValueError):
    """A block that cannot be decoded, and why."""


@dataclass(frozen=True, slots=True)
class LostBlock:
    """A block that did not decode: where it was, why, and how many records it claimed to hold."""

    offset: int
    reason: str
    records: int


@dataclass(frozen=True)
class DecodedLog:
    """A log's records, and what was lost on the way.

    Parameters
    ----------
    records : shape (n,), dtype `truing_protocol.LOG_RECORD_DTYPE`, the board's integers as they are.
    """

    log_id: int
    records: npt.NDArray[np.void]
    lost: tuple[LostBlock, ...] = field(default=())


def decode_log(data: bytes | bytearray, first_offset: int = 0, log_id: int | None = None) -> DecodedLog:
    """Decode whole sealed blocks.

    Parameters
    ----------
    data : the bytes, from a block's first byte on.
    first_offset : absolute offset of `data[0]` on the board, for messages.
    log_id : the log wanted; by default that of the first sound block.

    A block that is damaged, or of another log, is left out and listed in `lost`: history starts
    anew in each block, so that the others are not affected.
    """
    rows: list[tuple[int, ...]] = []
    lost: list[LostBlock] = []
    previous_number: int | None = None
    for at in range(0, len(data), LOG_BLOCK_SIZE):
        block = bytes(data[at : at + LOG_BLOCK_SIZE])
        claimed = 0
        try:
            if len(block) < LOG_BLOCK_SIZE:
                raise _BadBlockError(f"only {len(block)} bytes of it are there")
            header = LogHeader.unpack(block[: LogHeader.SIZE])
            _check_header(header, log_id, previous_number)
            claimed = header.records
            decoded = decode_block(block, header)
        except _BadBlockError as bad:
            lost.append(LostBlock(first_offset + at, str(bad), claimed))
            continue
        log_id = header.log_id if log_id is None else log_id
        previous_number = header.block_number
        rows.extend(decoded)
    return DecodedLog(log_id or 0, np.array(rows, dtype=LOG_RECORD_DTYPE), tuple(lost))


def _check_header(header: LogHeader, log_id: int | None, previous_number: int | None) -> None:
    if header.version != LOG_RECORD_VERSION:
        raise _BadBlockError(f"record version {header.version}, this truing reads {LOG_RECORD_VERSION}")
    if not LogHeader.SIZE <= header.used <= LOG_BLOCK_SIZE:
        raise _BadBlockError(f"claims {header.used} bytes of {LOG_BLOCK_SIZE}")
    if log_id is not None and header.log_id != log_id:
        raise _BadBlockError(f"belongs to log {header.log_id}, not {log_id}")
    if previous_number is not None and header.block_number <= previous_number:
        raise _BadBlockError(f"block {header.block_number} comes after block {previous_number}")


def decode_block(block: bytes, header: LogHeader) -> list[tuple[int, ...]]:
    """Decode one block's records; each is a tuple of the schema's fields, in range of their types."""
    values = [0] * _FIELDS
    before = [0] * _FIELDS
    rows: list[tuple[int, ...]] = []
    at = LOG_HEADER_DTYPE.itemsize
    used = header.used
    for _ in range(header.records):
        if at + 2 > used:
            raise _BadBlockError(f"ends within record {len(rows) + 1} of {header.records}")
        mask = block[at] | block[at + 1] << 8
        at += 2
        row = []
        for i in range(_FIELDS):
            predicted = 2 * values[i] - before[i] if LOG_PREDICT_LINE[i] else values[i]
            if mask >> i & 1:
                code = shift = 0
                while True:
                    if at >= used or shift > 28:
                        raise _BadBlockError(
                            f"a number in record {len(rows) + 1} of {header.records} does not end"
                        )
                    byte = block[at]
                    at += 1
                    code |= (byte & 0x7F) << shift
                    shift += 7
                    if byte < 0x80:
                        break
                predicted += (code >> 1) ^ -(code & 1)
            before[i] = values[i]
            values[i] = predicted & _WORD
            low, span = _RANGES[i]
            value = (values[i] - low & _WORD) + low
            if value - low >= span:
                raise _BadBlockError(f"{_NAMES[i]} of record {len(rows) + 1} is out of its range")
            row.append(value)
        rows.append(tuple(row))
    if at != used:
        raise _BadBlockError(f"{header.records} records end at byte {at}, the block says {used}")
    return rows


def _ranges() -> list[tuple[int, int]]:
    """Lowest value and number of values of each field."""
    ranges = []
    for name in _NAMES:
        info = np.iinfo(LOG_RECORD_DTYPE[name])
        ranges.append((int(info.min), int(info.max) - int(info.min) + 1))
    return ranges


_RANGES = _ranges()
