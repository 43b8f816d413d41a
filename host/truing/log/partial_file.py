"""A download that is not finished yet, on disk: survives a cut link and a killed program."""

from __future__ import annotations

import json
import os
import struct
import zlib
from dataclasses import asdict, dataclass
from pathlib import Path

from truing.errors import FileError, OutputError

_RECORD = struct.Struct("<IHI")


@dataclass(frozen=True, slots=True)
class LogIdentity:
    """Which bytes a download is of; two downloads with equal identities carry the same bytes.

    Offsets count from the board's start, so that they mean something only together with its
    boot id.
    """

    board_id: str
    boot_id: int
    log_id: int
    start_ms: int
    offset: int
    length: int


class Spans:
    """The parts of a range of bytes that have arrived.

    Parameters
    ----------
    offset, length : the whole range.
    """

    def __init__(self, offset: int, length: int) -> None:
        self.offset = offset
        self.data = bytearray(length)
        self._missing: list[tuple[int, int]] = [(offset, offset + length)] if length else []

    @property
    def missing(self) -> list[tuple[int, int]]:
        """What has not arrived: (first offset, one past the last), ascending."""
        return list(self._missing)

    @property
    def known_bytes(self) -> int:
        """How many bytes have arrived."""
        return len(self.data) - sum(end - start for start, end in self._missing)

    def fill(self, offset: int, data: bytes) -> None:
        """Take bytes that have arrived; what lies outside the range is ignored."""
        begin = max(offset, self.offset)
        end = min(offset + len(data), self.offset + len(self.data))
        if begin >= end:
            return
        self.data[begin - self.offset : end - self.offset] = data[begin - offset : end - offset]
        left: list[tuple[int, int]] = []
        for first, last in self._missing:
            if first < min(last, begin):
                left.append((first, min(last, begin)))
            if max(first, end) < last:
                left.append((max(first, end), last))
        self._missing = left


class PartialFile:
    """A journal of the chunks that have arrived, each with its own CRC.

    Chunks are appended as they come and reach the operating system at once, so that neither a
    crash nor a kill loses more than the chunk being written; a damaged tail is cut off when the
    file is opened again.

    Parameters
    ----------
    path : the file; one of another identity is replaced.
    """

    def __init__(self, path: Path, identity: LogIdentity) -> None:
        self.path = path
        self._head = json.dumps({"truing_partial": 1} | asdict(identity)).encode() + b"\n"
        self.spans = Spans(identity.offset, identity.length)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            keep = self._load() if path.exists() else 0
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT, 0o644)
            os.ftruncate(self._file, keep)
            os.lseek(self._file, keep, os.SEEK_SET)
            if not keep:
                os.write(self._file, self._head)
        except OSError as error:
            raise OutputError(path, f"cannot keep the download here ({error.strerror})") from error

    def fill(self, offset: int, data: bytes) -> None:
        """Take one chunk and write it down."""
        self.spans.fill(offset, data)
        try:
            os.write(self._file, _RECORD.pack(offset, len(data), zlib.crc32(data)) + data)
        except OSError as error:
            raise OutputError(self.path, f"cannot keep the download here ({error.strerror})") from error

    def close(self) -> None:
        """Stop writing; the file stays for another time."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def discard(self) -> None:
        """Stop writing and remove the file: the download is done, or worth nothing."""
        self.close()
        self.path.unlink(missing_ok=True)

    def _load(self) -> int:
        """Read what an earlier download left; return how much of the file is sound."""
        content = self.path.read_bytes()
        if not content.startswith(self._head):
            return 0
        at = len(self._head)
        while at + _RECORD.size <= len(content):
            offset, length, crc = _RECORD.unpack_from(content, at)
            data = content[at + _RECORD.size : at + _RECORD.size + length]
            if len(data) != length or zlib.crc32(data) != crc:
                break
            self.spans.fill(offset, data)
            at += _RECORD.size + length
        return at


def read_identity(path: Path) -> LogIdentity | None:
    """Return whose download lies in `path`, or None where it is no such file."""
    try:
        with path.open("rb") as file:
            head = json.loads(file.readline(4096))
        if head.pop("truing_partial") != 1:
            return None
        return LogIdentity(**head)
    except (ValueError, KeyError, TypeError, AttributeError):
        return None
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror})") from error
