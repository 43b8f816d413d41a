"""A board in Python with a clock of its own: enough of the wire contract to test a host without an image.

It is a stand-in for what the host sees, not for the firmware: sequences only let time pass.
"""

from __future__ import annotations

import math
import zlib
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import truing_protocol as tp
from truing.link.framing import Frame, FrameDecoder, encode

BYTE_S = 10 / 921_600


@dataclass
class FakeLog:
    entry: tp.LogEntry
    data: bytes


@dataclass
class FakeBoard:
    """State that requests read and change; `now_s` is set by the line."""

    protocol_version: int = tp.PROTOCOL_VERSION
    schema_hash: int = tp.SCHEMA_HASH
    boot_id: int = 77
    board_id: bytes = bytes(range(12))
    logs: list[FakeLog] = field(default_factory=list)
    values: list[float] = field(default_factory=lambda: [p.default for p in tp.PARAMETERS])
    stored: dict[int, float] = field(default_factory=dict)
    saves: int = 0
    handled: list[str] = field(default_factory=list)
    reads: list[tuple[int, int]] = field(default_factory=list)
    latched: int = 0
    refuse: dict[str, tuple[int, int]] = field(default_factory=dict)
    silent: bool = False
    now_s: float = 0.0
    sequence: bytes = b""
    received: bytes = b""
    started_at: float | None = None
    ended: bool = False
    effort: tuple[float, float] = (0.0, 0.0)
    _last: tuple[int, int, int] | None = None
    _last_reply: bytes = b""

    def frame(self, frame: Frame) -> bytes:
        """The bytes that answer one frame."""
        request = next((c for c in _REQUESTS if frame.id == c.ID), None)
        if request is None:
            return self._refuse(frame, tp.RefusalReason.UNKNOWN_REQUEST, frame.id)
        crc = zlib.crc32(bytes([frame.id]) + frame.sequence.to_bytes(2, "little") + frame.payload)
        key = (frame.id, frame.sequence, crc)
        if request.CHANGES and key == self._last:
            return self._last_reply
        self.handled.append(request.NAME)
        if request.NAME in self.refuse:
            answer = self._refuse(frame, *self.refuse[request.NAME])
        else:
            handler: Callable[[tp.Request[object]], bytes | tuple[int, int]] = getattr(self, request.NAME)
            reply = handler(request.unpack(frame.payload))  # type: ignore[attr-defined]
            if isinstance(reply, tuple):
                answer = self._refuse(frame, *reply)
            else:
                answer = encode(Frame(frame.id | tp.REPLY_BIT, frame.sequence, reply))
        if request.CHANGES:
            self._last, self._last_reply = key, answer
        return answer

    def _refuse(self, frame: Frame, reason: int, detail: int) -> bytes:
        return encode(Frame(tp.REFUSAL_ID, frame.sequence, tp.Refusal(frame.id, reason, detail).pack()))

    # one method for each request, by its name

    def hello(self, _: tp.HelloRequest) -> bytes:
        return tp.HelloReply(
            self.protocol_version,
            self.schema_hash,
            tuple(self.board_id),
            self.boot_id,
            "0.0-fake",
            "fake",
            1000,
            tp.MAX_PAYLOAD,
            tp.MAX_SEGMENTS,
            len(tp.PARAMETERS),
            tp.LOG_CELL_SIZE,
            1536,
            tp.ResetCause.POWER_ON,
            tp.ClockSource.CRYSTAL_PLL,
        ).pack()

    def time(self, _: tp.TimeRequest) -> bytes:
        ms, rest = divmod(int(self.now_s * 1e6), 1000)
        return tp.TimeReply(ms, rest).pack()

    def status(self, _: tp.StatusRequest) -> bytes:
        running = self._running()
        state = tp.State.STOPPED if self.latched else tp.State.SEQUENCE if running else tp.State.IDLE
        return tp.StatusReply(
            int(self.now_s * 1000),
            state,
            tp.Mode.IDLE,
            self._sequence_state(),
            0,
            self.latched,
            self.latched,
            12000,
            (int(self.effort[0] * 1e4), int(self.effort[1] * 1e4)),
            (0, 0),
            (0, 0),
            0,
            0,
            0,
            0,
            (0, 0),
        ).pack()

    def clear_faults(self, _: tp.ClearFaultsRequest) -> bytes:
        self.latched = 0
        return b""

    def param_list(self, request: tp.ParamListRequest) -> bytes | tuple[int, int]:
        if request.index >= len(tp.PARAMETERS):
            return tp.RefusalReason.UNKNOWN_PARAMETER, request.index
        p = tp.PARAMETERS[request.index]
        return tp.ParamListReply(
            p.index,
            p.kind,
            p.name,
            p.unit,
            p.minimum,
            p.maximum,
            p.default,
            self.values[p.index],
            p.index in self.stored,
            self.stored.get(p.index, p.default),
        ).pack()

    def param_get(self, request: tp.ParamGetRequest) -> bytes:
        return tp.ParamGetReply(request.index, self.values[request.index]).pack()

    def param_set(self, request: tp.ParamSetRequest) -> bytes | tuple[int, int]:
        p = tp.PARAMETERS[request.index]
        if not math.isfinite(request.value):
            return tp.RefusalReason.NOT_FINITE, 1
        if not p.minimum <= request.value <= p.maximum:
            return tp.RefusalReason.OUT_OF_RANGE, 1
        self.values[request.index] = request.value
        return tp.ParamSetReply(request.index, request.value).pack()

    def param_save(self, _: tp.ParamSaveRequest) -> bytes:
        written = self.stored != dict(enumerate(self.values))
        self.stored = dict(enumerate(self.values))
        self.saves += written
        return tp.ParamSaveReply(self.saves, written, 250 * written).pack()

    def param_load(self, _: tp.ParamLoadRequest) -> bytes:
        self.values = [self.stored.get(p.index, p.default) for p in tp.PARAMETERS]
        return tp.ParamLoadReply(len(self.stored)).pack()

    def param_defaults(self, _: tp.ParamDefaultsRequest) -> bytes:
        self.values = [p.default for p in tp.PARAMETERS]
        return b""

    def param_store(self, _: tp.ParamStoreRequest) -> bytes:
        states = (tp.SlotState.GOOD if self.saves else tp.SlotState.BLANK, tp.SlotState.BLANK)
        return tp.ParamStoreReply(self.saves, states, 0, len(self.stored), 0, 0).pack()

    def update_state(self, _: tp.UpdateStateRequest) -> bytes:
        states = (tp.ImageState.CONFIRMED, tp.ImageState.NONE)
        return tp.UpdateStateReply(
            self.boot_id, 0, 0, 0, 0, 512, 81920, states, (1, 0), "truing-fake 0.0", ""
        ).pack()

    def seq_begin(self, request: tp.SeqBeginRequest) -> bytes:
        self.sequence, self.received, self._count = b"", b"", request.segment_count
        return b""

    def seq_segments(self, request: tp.SeqSegmentsRequest) -> bytes | tuple[int, int]:
        have = len(self.received) // tp.Segment.SIZE
        if request.first != have:
            return tp.RefusalReason.SEQUENCE_GAP, have
        self.received += b"".join(s.pack() for s in request.segments)
        return b""

    def seq_commit(self, request: tp.SeqCommitRequest) -> bytes | tuple[int, int]:
        have = len(self.received) // tp.Segment.SIZE
        if have != self._count:
            return tp.RefusalReason.SEQUENCE_INCOMPLETE, have
        if zlib.crc32(self.received) != request.crc32:
            return tp.RefusalReason.SEQUENCE_BAD_CRC, zlib.crc32(self.received)
        self.sequence = self.received
        return tp.SeqCommitReply(self._duration_ms()).pack()

    def seq_start(self, _: tp.SeqStartRequest) -> bytes | tuple[int, int]:
        if not self.sequence:
            return tp.RefusalReason.SEQUENCE_EMPTY, 0
        self.started_at, self.ended = self.now_s, False
        return tp.SeqStartReply(1).pack()

    def seq_abort(self, _: tp.SeqAbortRequest) -> bytes:
        return self.stop(tp.StopRequest())

    def seq_state(self, _: tp.SeqStateRequest) -> bytes:
        count = len(self.sequence) // tp.Segment.SIZE
        elapsed = 0 if self.started_at is None else int((self.now_s - self.started_at) * 1000)
        return tp.SeqStateReply(
            self._sequence_state(),
            count,
            count,
            0,
            elapsed,
            self._duration_ms(),
            zlib.crc32(self.sequence),
            1,
        ).pack()

    def log_list(self, request: tp.LogListRequest) -> bytes:
        first = self.logs[0].entry.first_cell * tp.LOG_CELL_SIZE if self.logs else 0
        end = first + sum(len(log.data) for log in self.logs)
        entries = tuple(log.entry for log in self.logs[request.first :][:33])
        return tp.LogListReply(first, end, len(self.logs), entries).pack()

    def log_read(self, request: tp.LogReadRequest) -> bytes | tuple[int, int]:
        self.reads.append((request.offset, request.length))
        data, first = self._log_bytes()
        if request.offset < first:
            return tp.RefusalReason.LOG_GONE, first
        if request.offset + request.length > first + len(data):
            return tp.RefusalReason.LOG_BEYOND_END, first + len(data)
        at = request.offset - first
        return tp.LogReadReply(request.offset, data[at : at + request.length]).pack()

    def log_digest(self, request: tp.LogDigestRequest) -> bytes:
        data, first = self._log_bytes()
        at = request.offset - first
        return tp.LogDigestReply(
            request.offset, request.length, zlib.crc32(data[at : at + request.length])
        ).pack()

    def log_erase(self, _: tp.LogEraseRequest) -> bytes:
        self.logs.clear()
        return b""

    def set_effort(self, request: tp.SetEffortRequest) -> bytes | tuple[int, int]:
        if self.latched:
            return tp.RefusalReason.FAULT_LATCHED, self.latched
        self.effort = (request.left, request.right)
        return b""

    def set_velocity(self, request: tp.SetVelocityRequest) -> bytes:
        return b""

    def arm(self, request: tp.ArmRequest) -> bytes | tuple[int, int]:
        return b"" if request.boot_id == self.boot_id else (tp.RefusalReason.WRONG_BOOT, self.boot_id)

    def stop(self, _: tp.StopRequest) -> bytes:
        self.effort = (0.0, 0.0)
        self.ended = True
        return b""

    def _log_bytes(self) -> tuple[bytes, int]:
        first = self.logs[0].entry.first_cell * tp.LOG_CELL_SIZE if self.logs else 0
        return b"".join(log.data for log in self.logs), first

    def _duration_ms(self) -> int:
        return sum(
            tp.Segment.unpack(self.sequence[i : i + tp.Segment.SIZE]).duration_ms
            for i in range(0, len(self.sequence), tp.Segment.SIZE)
        )

    def _running(self) -> bool:
        return (
            self.started_at is not None
            and not self.ended
            and (self.now_s - self.started_at) * 1000 < self._duration_ms()
        )

    def _sequence_state(self) -> int:
        if self.started_at is None:
            return tp.SequenceState.READY if self.sequence else tp.SequenceState.EMPTY
        if self._running():
            return tp.SequenceState.RUNNING
        return tp.SequenceState.ABORTED if self.ended else tp.SequenceState.DONE


_REQUESTS = [
    value
    for name, value in vars(tp).items()
    if name.endswith("Request") and name != "Request" and hasattr(value, "ID")
]


class FakeLine:
    """A serial line to a `FakeBoard`, with the baud rate's pace and a virtual clock."""

    virtual = True
    name = "fake"

    def __init__(self, board: FakeBoard, latency_s: float = 0.0005) -> None:
        self.board = board
        self.latency_s = latency_s
        self._now = 0.0
        self._decoder = FrameDecoder()
        # Both in the order of their times, each with the moment at which it arrives.
        self._inbound: deque[tuple[float, int]] = deque()
        self._outbound: deque[tuple[float, int]] = deque()
        self._free_in = self._free_out = 0.0

    def write(self, data: bytes) -> None:
        for byte in data:
            self._free_in = max(self._free_in, self._now) + BYTE_S
            self._inbound.append((self._free_in, byte))

    def read(self, timeout_s: float) -> bytes:
        until = self._now + timeout_s
        self._advance(self._now)
        while not (out := self._take()) and self._now < until:
            self._advance(min(self._now + 0.0005, until))
        return out

    def sleep(self, seconds: float) -> None:
        self._advance(self._now + seconds)

    def now_s(self) -> float:
        return self._now

    def close(self) -> None:
        pass

    def _advance(self, until: float) -> None:
        while self._inbound and self._inbound[0][0] <= until:
            at, byte = self._inbound.popleft()
            for frame in self._decoder.feed(bytes([byte])):
                self.board.now_s = at
                if self.board.silent:
                    continue
                for reply in self.board.frame(frame):
                    self._free_out = max(self._free_out, at + self.latency_s) + BYTE_S
                    self._outbound.append((self._free_out, reply))
        self._now = until
        self.board.now_s = until

    def _take(self) -> bytes:
        ready = bytearray()
        while self._outbound and self._outbound[0][0] <= self._now:
            ready.append(self._outbound.popleft()[1])
        return bytes(ready)
