"""Decodes the log's sealed blocks into integer records, as protocol/SPEC.md says."""

from __future__ import annotations

import functools
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from truing.errors import LogError
from truing.log import kernel as log_kernel
from truing_protocol import (
    LOG_BLOCK_LIMIT,
    LOG_CELL_SIZE,
    LOG_RECORD_DTYPE,
    LOG_RECORD_VERSION,
    LogHeader,
)

_NAMES = LOG_RECORD_DTYPE.names or ()
_CRC_BYTES = 4
# From here on compiling, or loading what was compiled before, pays.
_MANY_RECORDS = 4000


@dataclass(frozen=True, slots=True)
class LostBlock:
    """A stretch that did not decode: where it begins, why, and how many records are missing there."""

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


@dataclass(frozen=True, slots=True)
class _Block:
    at: int
    header: LogHeader
    body: bytes

    @property
    def end(self) -> int:
        return self.at + -(-self.header.used // LOG_CELL_SIZE) * LOG_CELL_SIZE


def decode_log(
    data: bytes | bytearray, first_offset: int | None = None, log_id: int | None = None
) -> DecodedLog:
    """Decode whole sealed blocks.

    Parameters
    ----------
    data : the bytes, from a cell's first byte on.
    first_offset : absolute offset of `data[0]` on the board; by default what the first sound block says.
    log_id : the log wanted; by default that of the first sound block.

    A block that is damaged, or of another log, is left out and listed in `lost`: each block is coded
    for itself, so that the others are not affected.
    """
    blocks, bad = _find_blocks(bytes(data), first_offset)
    if log_id is None and blocks:
        log_id = blocks[0].header.log_id
    offset = first_offset
    if offset is None:
        offset = blocks[0].header.cell * LOG_CELL_SIZE - blocks[0].at if blocks else 0
    lost = [LostBlock(offset + at, reason, _records_between(blocks, at)) for at, reason in bad]
    sound: list[_Block] = []
    for block in blocks:
        try:
            _check_order(block.header, log_id, sound[-1].header if sound else None)
        except LogError as error:
            lost.append(LostBlock(offset + block.at, str(error), block.header.records))
        else:
            sound.append(block)
    total = sum(block.header.records for block in sound)
    decode = _compiled() if total >= _MANY_RECORDS else None
    parts = []
    for block in sound:
        try:
            parts.append(_records(block, decode))
        except LogError as error:
            lost.append(LostBlock(offset + block.at, str(error), block.header.records))
    records = np.concatenate(parts) if parts else np.zeros(0, LOG_RECORD_DTYPE)
    return DecodedLog(log_id or 0, records, tuple(sorted(lost, key=lambda one: one.offset)))


def _find_blocks(data: bytes, first_offset: int | None) -> tuple[list[_Block], list[tuple[int, str]]]:
    """The blocks whose CRC is right, and where and why there is none.

    Behind damage the next block is found again: it begins a cell, says which one, and has its CRC.
    """
    blocks: list[_Block] = []
    bad: list[tuple[int, str]] = []
    at = 0
    lost_at = -1
    while at < len(data):
        try:
            block = _block_at(data, at)
            expected = _expected_cell(blocks, at, first_offset)
            if expected is not None and block.header.cell != expected:
                raise LogError(f"cell {block.header.cell} lies where cell {expected} should")
        except LogError as error:
            if lost_at != at:
                bad.append((at, str(error)))
            at += LOG_CELL_SIZE
            lost_at = at
            continue
        blocks.append(block)
        at = block.end
    return blocks, bad


def _expected_cell(blocks: list[_Block], at: int, first_offset: int | None) -> int | None:
    if first_offset is not None:
        return (first_offset + at) // LOG_CELL_SIZE
    if blocks:
        return blocks[-1].header.cell + (at - blocks[-1].at) // LOG_CELL_SIZE
    return None


def _block_at(data: bytes, at: int) -> _Block:
    if len(data) - at < LogHeader.SIZE:
        raise LogError(f"only {len(data) - at} bytes of it are there")
    head = data[at : at + LogHeader.SIZE]
    header = LogHeader.unpack(head)
    if header.version != LOG_RECORD_VERSION:
        raise LogError(f"record version {header.version}, this truing reads {LOG_RECORD_VERSION}")
    if not LogHeader.SIZE <= header.used <= LOG_BLOCK_LIMIT:
        raise LogError(f"claims {header.used} bytes, no block has more than {LOG_BLOCK_LIMIT}")
    if len(data) - at < header.used:
        raise LogError(f"only {len(data) - at} bytes of it are there")
    body = data[at + LogHeader.SIZE : at + header.used]
    if zlib.crc32(body, zlib.crc32(head[:-_CRC_BYTES])) != header.crc32:
        raise LogError("its CRC is wrong")
    return _Block(at, header, body)


def _check_order(header: LogHeader, log_id: int | None, previous: LogHeader | None) -> None:
    if log_id is not None and header.log_id != log_id:
        raise LogError(f"belongs to log {header.log_id}, not {log_id}")
    if previous is not None and header.first_record < previous.first_record + previous.records:
        raise LogError(f"begins with record {header.first_record}, which was there before")


def _records_between(blocks: list[_Block], at: int) -> int:
    """How many records lie in the gap at `at`, as far as its neighbours tell."""
    after = next((block for block in blocks if block.at > at), None)
    before = next((block for block in reversed(blocks) if block.at < at), None)
    if after is None or (before is not None and before.header.log_id != after.header.log_id):
        return 0
    known = 0 if before is None else before.header.first_record + before.header.records
    return max(after.header.first_record - known, 0)


@functools.cache
def _compiled() -> Callable[..., None]:
    return log_kernel.compiled_decoder()


def _records(block: _Block, compiled: Callable[..., None] | None) -> npt.NDArray[np.void]:
    """One block's records, each value in range of its type."""
    header = block.header
    geometry = _geometry(header)
    numbers = header.records * log_kernel.FIELDS
    half, models, series = 1 << 15, log_kernel.MODELS, log_kernel.SERIES
    shared = (header.rate_hz, header.first_record, header.records)
    if compiled is None:
        rows = [0] * numbers
        log_kernel.decode(
            block.body, [0] * 7, [half] * models, [0] * models, [0] * series, geometry, *shared, rows
        )
        table = np.array(rows, np.int64)
    else:
        table = np.zeros(numbers, np.int64)
        compiled(
            np.frombuffer(block.body, np.uint8).astype(np.int64),
            np.zeros(7, np.int64),
            np.full(models, half, np.int64),
            np.zeros(models, np.int64),
            np.zeros(series, np.int64),
            np.array(geometry, np.int64),
            *shared,
            table,
        )
    table = table.reshape(header.records, log_kernel.FIELDS)
    records = np.zeros(header.records, LOG_RECORD_DTYPE)
    for i, name in enumerate(_NAMES):
        records[name] = table[:, i].astype(LOG_RECORD_DTYPE[name])
        if not np.array_equal(records[name].astype(np.int64), table[:, i]):
            raise LogError(f"{name} is out of its range")
    return records


def _geometry(header: LogHeader) -> list[int]:
    """Mantissa and exponent of metres per count, turn per count (2^-40), maximum of counts that turn."""
    mantissa, exponent = _float_parts(header.metres_per_count)
    turn_mantissa, turn_exponent = _float_parts(header.turns_per_count)
    shift = turn_exponent + 40
    if shift > 23:
        turn = 1 << 47
    else:
        turn = turn_mantissa << shift if shift >= 0 else turn_mantissa >> min(-shift, 63)
    return [mantissa, exponent, turn, (1 << 62) // turn if turn else 0]


def _float_parts(value: float) -> tuple[int, int]:
    """Mantissa of 24 bits and exponent of a positive normal single-precision number; zeros for others."""
    (bits,) = struct.unpack("<I", struct.pack("<f", value))
    exponent = bits >> 23
    return (bits & 0x7FFFFF | 0x800000, exponent - 150) if 0 < exponent < 255 else (0, 0)
