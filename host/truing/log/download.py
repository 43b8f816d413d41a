"""Brings a log's bytes from the board: pipelined, gaps asked again, resumed where it was cut."""

from __future__ import annotations

import logging
import zlib
from collections import OrderedDict
from dataclasses import dataclass
from typing import Protocol

from truing.errors import LinkTimeout, LogError
from truing.link.chunk_length import FRAME_BYTES, ChunkLength
from truing.link.client import Client
from truing.log.partial_file import Spans
from truing.progress import Progress
from truing_protocol import MAX_PAYLOAD, LogDigestRequest, LogReadReply, LogReadRequest

_LOG = logging.getLogger("truing.download")
_LONGEST_CHUNK = MAX_PAYLOAD - LogReadReply.SIZE
# Enough to keep the line busy over a 20 ms round trip at 921600 baud (1.8 kB), and no more than
# what a board answers within the first wait.
_WINDOW_BYTES = 4 * (_LONGEST_CHUNK + FRAME_BYTES)
_WINDOW_CHUNKS = 12
_LATEST = 64  # so many requests back an answer is still recognised
# Once an answer has come too late, those that follow say how long to wait.
_LATE_MARGIN = 1.5
_LONGEST_WAIT_S = 2.0
_FORGET_LATE = 0.9
# 921600 baud carries 92 bytes a millisecond; slower lines only make the wait too short once.
_SECONDS_PER_BYTE = 1.0 / 92_160


class Keeper(Protocol):
    """Where arrived chunks are kept: in memory, or in a file as well."""

    spans: Spans

    def fill(self, offset: int, data: bytes) -> None:
        """Take one chunk."""


class MemoryKeeper:
    """Keeps chunks in memory only."""

    def __init__(self, offset: int, length: int) -> None:
        self.spans = Spans(offset, length)

    def fill(self, offset: int, data: bytes) -> None:
        """Take one chunk."""
        self.spans.fill(offset, data)


@dataclass(frozen=True, slots=True)
class DownloadReport:
    """What a download took.

    `seconds` is time on the link's clock; `asked_bytes` counts every byte asked for, `again_bytes`
    those of them that had been asked for before; `resumed_bytes` were there when it began.
    """

    bytes: int
    seconds: float
    requests: int
    asked_bytes: int
    again_bytes: int
    resumed_bytes: int
    crc32: int

    @property
    def bytes_per_s(self) -> float:
        """Payload throughput; 0 where nothing had to be fetched."""
        return (self.bytes - self.resumed_bytes) / self.seconds if self.seconds > 0 else 0.0


@dataclass(slots=True)
class _Asked:
    offset: int
    length: int
    again: bool
    at_s: float


class LogDownload:
    """One download of the bytes `keeper` is for.

    The board answers in order, so that an answer also says that whatever was asked before it and
    has not come is lost; a time-out is needed only when the whole window is. What was given up too
    early counts when it comes after all: a line may be slower than it was thought to be.
    """

    def __init__(self, client: Client, keeper: Keeper) -> None:
        self._client = client
        self._keeper = keeper
        self._chunk = ChunkLength(_LONGEST_CHUNK)
        self._gaps: list[tuple[int, int, bool]] = [(a, b, False) for a, b in keeper.spans.missing]
        self._asked: OrderedDict[int, _Asked] = OrderedDict()
        self._given_up: OrderedDict[int, _Asked] = OrderedDict()
        self._late_s = 0.0
        self._requests = self._asked_bytes = self._again_bytes = 0

    def run(self, progress: Progress | None = None) -> DownloadReport:
        """Fetch everything that is missing and check the whole against the board's digest.

        Raises
        ------
        LinkTimeout, LinkClosed : the link failed; what has arrived is with the keeper.
        Refused : the board no longer has these bytes.
        LogError : the whole does not have the board's digest.
        """
        spans = self._keeper.spans
        began = self._client.stream.now_s()
        resumed = spans.known_bytes
        total = max(len(spans.data), 1)
        if resumed:
            _LOG.info("resuming: %d of %d bytes are here already", resumed, len(spans.data))
        timing = self._client.timing
        silent_since = began
        stalls = 0
        while self._gaps or self._asked:
            self._fill_window()
            if self._take_answers(self._wait_s(stalls)):
                stalls = 0
                silent_since = self._client.stream.now_s()
                if progress is not None:
                    progress(spans.known_bytes / total)
                continue
            if self._client.stream.now_s() - silent_since > timing.patience_s:
                raise LinkTimeout(
                    f"{self._client.stream.name}: the download stalled: no answer for "
                    f"{timing.patience_s:g} s, {spans.known_bytes} of {len(spans.data)} bytes are here",
                    "check the cable and the board's power, then run the command again: it resumes",
                )
            stalls += 1
            self._give_up_window()
        crc = self._check_digest()
        return DownloadReport(
            bytes=len(spans.data),
            seconds=self._client.stream.now_s() - began,
            requests=self._requests,
            asked_bytes=self._asked_bytes,
            again_bytes=self._again_bytes,
            resumed_bytes=resumed,
            crc32=crc,
        )

    def _fill_window(self) -> None:
        """Ask for more until the window is full."""
        while self._gaps and len(self._asked) < _WINDOW_CHUNKS:
            start, end, again = self._gaps[0]
            length = min(end - start, self._chunk.value)
            under_way = sum(asked.length + FRAME_BYTES for asked in self._asked.values())
            if self._asked and under_way + length + FRAME_BYTES > _WINDOW_BYTES:
                return
            sequence = self._client.post(LogReadRequest(offset=start, length=length))
            self._asked[sequence] = _Asked(start, length, again, self._client.stream.now_s())
            self._requests += 1
            self._asked_bytes += length
            self._again_bytes += length if again else 0
            if start + length == end:
                self._gaps.pop(0)
            else:
                self._gaps[0] = (start + length, end, again)

    def _wait_s(self, stalls: int) -> float:
        timing = self._client.timing
        under_way = sum(asked.length + FRAME_BYTES for asked in self._asked.values())
        wait = min(timing.first_wait_s * timing.growth**stalls, timing.longest_wait_s)
        return max(wait + under_way * _SECONDS_PER_BYTE, self._late_s)

    def _take_answers(self, wait_s: float) -> bool:
        """Take what arrives within `wait_s`; return whether any of it answers this download."""
        stream = self._client.stream
        until = stream.now_s() + wait_s
        while (left := until - stream.now_s()) > 0:
            took = False
            for frame in self._client.receive(left):
                asked = self._claim(frame.sequence)
                if asked is None:
                    self._client.counts.strays += 1
                    continue
                reply = self._client.unpack(LogReadRequest(asked.offset, asked.length), frame)
                if reply.offset != asked.offset or len(reply.data) != asked.length:
                    raise LogError(
                        f"the board answered {len(reply.data)} bytes at {reply.offset} "
                        f"where {asked.length} at {asked.offset} were asked for",
                        "flash the firmware that belongs to this version of truing",
                    )
                self._keeper.fill(asked.offset, reply.data)
                self._chunk.arrived(asked.length)
                took = True
            if took:
                return True
        return False

    def _claim(self, sequence: int) -> _Asked | None:
        """Return what this number asked for, and take it off the lists; None: nothing of this download."""
        late = self._given_up.pop(sequence, None)
        if late is not None:
            self._close_gap(late.offset, late.offset + late.length)
            self._chunk.came_after_all()
            self._late_s = self._took_s(late)
        if sequence not in self._asked:
            return late
        while next(iter(self._asked)) != sequence:
            self._lose(*self._asked.popitem(last=False))
        asked = self._asked.pop(sequence)
        if self._late_s > 0.0:
            self._late_s = max(self._late_s * _FORGET_LATE, self._took_s(asked))
        return asked

    def _took_s(self, asked: _Asked) -> float:
        """How long its answer took, with a margin."""
        return min(_LATE_MARGIN * (self._client.stream.now_s() - asked.at_s), _LONGEST_WAIT_S)

    def _lose(self, sequence: int, asked: _Asked) -> None:
        """Put back what was asked for and did not come; it is asked for again first."""
        self._gaps.insert(0, (asked.offset, asked.offset + asked.length, True))
        self._chunk.lost(asked.length)
        self._given_up[sequence] = asked
        if len(self._given_up) > _LATEST:
            self._given_up.popitem(last=False)

    def _close_gap(self, start: int, end: int) -> None:
        """Ask no more for these bytes; those that are under way again come twice."""
        left: list[tuple[int, int, bool]] = []
        for first, last, again in self._gaps:
            left.append((first, min(last, start), again))
            left.append((max(first, end), last, again))
        self._gaps = [gap for gap in left if gap[0] < gap[1]]

    def _give_up_window(self) -> None:
        while self._asked:
            self._lose(*self._asked.popitem(last=True))

    def _check_digest(self) -> int:
        spans = self._keeper.spans
        crc = zlib.crc32(spans.data)
        if spans.data:
            reply = self._client.request(LogDigestRequest(spans.offset, len(spans.data)))
            if reply.crc32 != crc:
                raise LogError(
                    f"the log's {len(spans.data)} bytes have the digest {crc:08x}, "
                    f"the board says {reply.crc32:08x}",
                    "fetch it again",
                )
        return crc
