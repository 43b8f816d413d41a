"""Requests and replies over a stream: pairs them by sequence number and asks again when one is lost."""

from __future__ import annotations

import logging
import secrets
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Protocol, TypeVar

from truing.errors import Interrupted, LinkError, LinkTimeout
from truing.link.framing import Frame, FrameDecoder, encode
from truing.link.refusals import refused
from truing.link.stream import Stream
from truing_protocol import REFUSAL_ID, REPLY_BIT, PayloadError, Refusal, Request

_LOG = logging.getLogger("truing.link")
ReplyT = TypeVar("ReplyT")


@dataclass(frozen=True, slots=True)
class Timing:
    """How long to wait for a reply before asking again, seconds.

    A round trip takes 2 ms on the wire and up to 20 ms through a USB adapter that collects bytes
    for 16 ms; the first wait is beyond both. Waits then grow, so that a board which is merely slow
    is not buried in repeats; a board whose sequence needs its host waits half a second for any of them.
    """

    first_wait_s: float = 0.05
    growth: float = 1.4
    longest_wait_s: float = 0.12
    patience_s: float = 4.0


@dataclass(slots=True)
class LinkCounts:
    """What has gone over the link since it was opened."""

    bytes_out: int = 0
    requests: int = 0
    retries: int = 0
    replies: int = 0
    strays: int = 0


class Beside(Protocol):
    """What goes on beside the requests, whenever the client listens: a live stream."""

    def ask(self) -> float:
        """Send what is due; returns the seconds until something is again."""

    def take(self, frames: list[Frame]) -> list[Frame]:
        """Take the frames that are for it; returns the others."""


class Client:
    """One host's end of the link.

    Parameters
    ----------
    first_sequence : the first request's sequence number. By default it is drawn at random on a
        real line, because the board answers a state-changing request that repeats the last one
        (same number, same bytes) without doing it again, and the last one may have been another
        program's; on a virtual board, which nobody else has used, it is 1.
    """

    def __init__(
        self, stream: Stream, *, timing: Timing | None = None, first_sequence: int | None = None
    ) -> None:
        self.stream = stream
        self.timing = timing or Timing()
        self.counts = LinkCounts()
        self._interrupted: Callable[[], bool] = _never
        self.beside: Beside | None = None
        self._decoder = FrameDecoder()
        if first_sequence is None:
            first_sequence = 1 if stream.virtual else secrets.randbelow(0x10000)
        self._sequence = first_sequence & 0xFFFF

    @property
    def frames_dropped(self) -> int:
        """Damaged frames received so far."""
        return self._decoder.counts.dropped

    @property
    def bytes_in(self) -> int:
        """Bytes received so far, damaged ones included."""
        return self._decoder.counts.bytes

    @property
    def is_interrupted(self) -> bool:
        """Whether whatever is under way shall end."""
        return self._interrupted()

    @contextmanager
    def interrupted_by(self, asked: Callable[[], bool]) -> Iterator[None]:
        """Within the block, end whatever is under way with `Interrupted` once `asked` is true.

        It is asked between waits. What held before the block holds again after it.
        """
        outer, self._interrupted = self._interrupted, asked
        try:
            yield
        finally:
            self._interrupted = outer

    def uninterrupted(self) -> AbstractContextManager[None]:
        """Within the block, let nothing end what is under way."""
        return self.interrupted_by(_never)

    def close(self) -> None:
        """Release the line."""
        self.stream.close()

    def request(
        self, request: Request[ReplyT], *, patience_s: float | None = None, first_wait_s: float | None = None
    ) -> ReplyT:
        """Send `request` until it is answered; return the reply.

        `first_wait_s` is for what takes the board longer than the timing's first wait.

        Raises
        ------
        Refused : the board said no, and why.
        LinkTimeout : no answer within `patience_s` (default: the timing's).
        LinkClosed : the line is gone.
        """
        answer = self.exchange(request, patience_s=patience_s, first_wait_s=first_wait_s)
        return self.unpack(request, answer)

    def exchange(
        self, request: Request[ReplyT], *, patience_s: float | None = None, first_wait_s: float | None = None
    ) -> Frame:
        """Send `request` until a frame answers it (a refusal is an answer); return that frame."""
        sequence = self._next_sequence()
        wanted = (request.ID | REPLY_BIT, REFUSAL_ID)
        patience = self.timing.patience_s if patience_s is None else patience_s
        deadline = self.stream.now_s() + patience
        wait = self.timing.first_wait_s if first_wait_s is None else first_wait_s
        tries = 0
        while True:
            now = self.stream.now_s()
            if now >= deadline and tries > 0:
                raise LinkTimeout(
                    f"{self.stream.name}: no answer to {request.NAME} within {patience:g} s ({tries} tries)",
                    "check the port, the board's power and both directions of the cable",
                )
            self._transmit(request, sequence, again=tries > 0)
            tries += 1
            again_at = min(now + wait, deadline)
            wait = min(wait * self.timing.growth, self.timing.longest_wait_s)
            while (left := again_at - self.stream.now_s()) > 0:
                answer = None
                for frame in self.receive(left):
                    if frame.sequence == sequence and frame.id in wanted and answer is None:
                        answer = frame
                    else:
                        self.counts.strays += 1
                if answer is not None:
                    return answer

    def post(self, request: Request[ReplyT]) -> int:
        """Send `request` once, without waiting; return the sequence number its answer will carry.

        Several may be under way at once as long as none changes the board's state: the board
        answers in order and remembers only the last change for repeats.
        """
        assert not request.CHANGES
        sequence = self._next_sequence()
        self._transmit(request, sequence, again=False)
        return sequence

    def receive(self, timeout_s: float) -> list[Frame]:
        """Return the frames that have arrived, waiting up to `timeout_s` for the first bytes.

        Raises
        ------
        Interrupted : see `interrupted_by`.
        LinkClosed : the line is gone.
        """
        if self.is_interrupted:
            raise Interrupted("interrupted")
        if self.beside is not None:
            timeout_s = min(timeout_s, self.beside.ask())
        frames = [frame for frame in self._decoder.feed(self.stream.read(timeout_s)) if frame.id & REPLY_BIT]
        self.counts.replies += len(frames)
        return frames if self.beside is None else self.beside.take(frames)

    def unpack(self, request: Request[ReplyT], answer: Frame) -> ReplyT:
        """Return the reply in `answer`, or raise what the board refused."""
        try:
            if answer.id == REFUSAL_ID:
                refusal = refused(request.NAME, Refusal.unpack(answer.payload))
                _LOG.debug("%s: %s", self.stream.name, refusal)
                raise refusal
            return request.unpack_reply(answer.payload)
        except PayloadError as error:
            raise LinkError(
                f"{self.stream.name}: the answer to {request.NAME} has an unexpected length ({error})",
                "flash the firmware that belongs to this version of truing",
            ) from error

    def _transmit(self, request: Request[ReplyT], sequence: int, *, again: bool) -> None:
        data = encode(Frame(request.ID, sequence, request.pack()))
        self.counts.requests += 1
        self.counts.retries += again
        self.counts.bytes_out += len(data)
        _LOG.debug("%s: %s #%d%s", self.stream.name, request.NAME, sequence, " again" if again else "")
        self.stream.write(data)

    def _next_sequence(self) -> int:
        sequence = self._sequence
        self._sequence = (self._sequence + 1) & 0xFFFF
        return sequence


def _never() -> bool:
    return False
