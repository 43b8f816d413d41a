"""Signals of a board as they happen, up to 200 samples a second, beside whatever else the link does."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from truing.arrays import FloatArray
from truing.errors import BoardRebooted, LinkTimeout, TruingError
from truing.link.chunk_length import ChunkLength
from truing.link.client import Client
from truing.link.framing import Frame
from truing_protocol import (
    MAX_PAYLOAD,
    REFUSAL_ID,
    REPLY_BIT,
    Mode,
    Signal,
    StreamReadReply,
    StreamReadRequest,
    StreamStartRequest,
)

MAX_HZ = 200
# What one step of the integer on the wire is, in the unit.
STEPS: dict[Signal, tuple[float, str]] = {
    Signal.MODE: (1.0, ""),
    Signal.FAULTS: (1.0, ""),
    Signal.CMD_LEFT: (1.0, "effort or m/s"),
    Signal.CMD_RIGHT: (1.0, "effort or m/s"),
    Signal.EFFORT_LEFT: (1e-4, "effort"),
    Signal.EFFORT_RIGHT: (1e-4, "effort"),
    Signal.COUNTS_LEFT: (1.0, "counts"),
    Signal.COUNTS_RIGHT: (1.0, "counts"),
    Signal.SPEED_LEFT: (1e-3, "m/s"),
    Signal.SPEED_RIGHT: (1e-3, "m/s"),
    Signal.X: (1e-3, "m"),
    Signal.Y: (1e-3, "m"),
    Signal.THETA: (1e-4, "rad"),
    Signal.BATTERY: (0.01, "V"),
}
_COMMANDS = (Signal.CMD_LEFT, Signal.CMD_RIGHT)
# By name, with the unit that values arrive in.
SIGNALS: dict[str, str] = {signal.name.lower(): unit for signal, (_, unit) in STEPS.items()}
# The board is asked this often, or once a sample where those are rarer.
_ASK_S = 0.02
# An answer waits behind what a download has asked for: 4 kB, 45 ms.
_AGAIN_S = 0.15


@dataclass(frozen=True, slots=True)
class Sample:
    """One sample: number, counted from 0; device time, s; values by signal's name, in `SIGNALS`' units."""

    number: int
    t_s: float
    values: dict[str, float]


class SignalStream:
    """A stream under way; `Device.stream` starts it, leaving its `with` block ends it.

    Samples arrive whenever the client listens: in `read`, in the iterator, and beside any other request
    or download of the same client. They wait here until they are taken.

    Attributes
    ----------
    lost : samples that the board had overwritten before they were asked for.
    taken : samples that have arrived.
    """

    def __init__(self, client: Client, signals: Sequence[str], rate_hz: int) -> None:
        self.names = tuple(signals)
        self.rate_hz = rate_hz
        chosen = _chosen(self.names)
        if not 1 <= rate_hz <= MAX_HZ:
            raise TruingError(f"a stream of {rate_hz} Hz: it must be 1 to {MAX_HZ} Hz")
        if any(signal in _COMMANDS for signal in chosen):
            chosen.add(Signal.MODE)  # says what a command's unit is
        self._signals = sorted(chosen)
        self._client = client
        self._waiting: deque[Sample] = deque()
        self._next = self.lost = self.taken = 0
        self._sequences: set[int] = set()
        self._asked = 0
        self._ask_at = self._heard_at = client.stream.now_s()
        mask = sum(1 << signal for signal in self._signals)
        self._stream_id = client.request(StreamStartRequest(mask, rate_hz)).stream_id
        self._chunk = ChunkLength(MAX_PAYLOAD - StreamReadReply.SIZE)
        self._row = np.dtype([("t_ms", "<u4"), *((signal.name.lower(), "<i4") for signal in self._signals)])
        client.beside = self

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the stream; what has arrived can still be taken."""
        if self._client.beside is self:
            self._client.beside = None
            self._client.request(StreamStartRequest(0, 0))

    def __iter__(self) -> Iterator[Sample]:
        """Samples in order, for as long as the stream lasts."""
        while True:
            yield from self.read()

    def read(self, timeout_s: float | None = None) -> list[Sample]:
        """Return the samples that have arrived, waiting for the first; empty after `timeout_s` without any.

        Raises
        ------
        LinkTimeout : without `timeout_s`, the board has said nothing for the client's patience.
        """
        stream = self._client.stream
        until = math.inf if timeout_s is None else stream.now_s() + timeout_s
        while True:
            if self._client.beside is self:
                # Other frames are strays: nobody waits for them here.
                self._client.counts.strays += len(
                    self._client.receive(max(min(_ASK_S, until - stream.now_s()), 0.0))
                )
            if self._waiting or stream.now_s() >= until or self._client.beside is not self:
                samples = list(self._waiting)
                self._waiting.clear()
                return samples
            if stream.now_s() - self._heard_at > self._client.timing.patience_s:
                raise LinkTimeout(
                    f"{stream.name}: the stream stalled", "check the cable and the board's power"
                )

    # ---- what the client calls while it listens

    def ask(self) -> float:
        """Ask for samples when it is time to; returns the seconds until then."""
        now = self._client.stream.now_s()
        if now >= self._ask_at:
            if self._sequences:  # the last one, or its answer, was lost
                self._chunk.lost(self._asked)
            if len(self._sequences) > 32:  # all that may still be answered have been by now
                self._sequences.clear()
            max_samples = max(self._chunk.value // self._row.itemsize, 1)
            self._asked = max_samples * self._row.itemsize
            self._sequences.add(self._client.post(StreamReadRequest(self._next, max_samples)))
            self._ask_at = now + _AGAIN_S
        return max(self._ask_at - now, 1e-3)

    def take(self, frames: list[Frame]) -> list[Frame]:
        """Take this stream's answers; returns the others."""
        others = []
        for frame in frames:
            if frame.sequence in self._sequences and frame.id in (
                StreamReadRequest.ID | REPLY_BIT,
                REFUSAL_ID,
            ):
                self._sequences.clear()  # an answer that comes after its repeat is a stray
                self._take(self._client.unpack(StreamReadRequest(self._next, 0), frame))
            else:
                others.append(frame)
        return others

    def _take(self, reply: StreamReadReply) -> None:
        now = self._client.stream.now_s()
        self._heard_at = now
        if reply.stream_id != self._stream_id:
            self._client.beside = None
            raise BoardRebooted(
                f"{self._client.stream.name}: the stream has ended: the board started anew, or another "
                "host has started a stream",
                "start it again",
            )
        self._chunk.arrived(len(reply.samples))
        rows = np.frombuffer(reply.samples, self._row)
        self.lost += max(reply.first - self._next, 0)
        for number, row in enumerate(rows, reply.first):
            if number >= self._next:
                self._waiting.append(self._sample(number, row))
                self.taken += 1
        self._next = max(self._next, reply.first + len(rows))
        behind = reply.end > self._next
        self._ask_at = now if behind else now + max(_ASK_S, 1 / self.rate_hz)

    def _sample(self, number: int, row: np.void) -> Sample:
        values = {}
        for name in self.names:
            signal = Signal[name.upper()]
            step = STEPS[signal][0]
            if signal in _COMMANDS:
                step = {Mode.EFFORT: 1e-4, Mode.VELOCITY: 1e-3}.get(Mode(int(row["mode"])), 1.0)
            values[name] = float(row[name]) * step
        return Sample(number, int(row["t_ms"]) / 1000, values)


def _chosen(names: Sequence[str]) -> set[Signal]:
    unknown = [name for name in names if name not in SIGNALS]
    if unknown or not names:
        what = f"{', '.join(unknown)}: no such signal" if unknown else "no signal is named"
        raise TruingError(what, f"there are {', '.join(SIGNALS)}")
    return {Signal[name.upper()] for name in names}


def as_columns(samples: Sequence[Sample]) -> dict[str, FloatArray]:
    """`t_s` and each signal as arrays, shape (n,)."""
    names = samples[0].values if samples else {}
    return {
        "t_s": np.array([sample.t_s for sample in samples]),
        **{name: np.array([sample.values[name] for sample in samples]) for name in names},
    }
