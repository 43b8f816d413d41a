"""Round trips that ask a board for its time."""

from __future__ import annotations

import random

from truing.clock.relation import RoundTrip
from truing.link.client import Client
from truing.progress import Progress
from truing_protocol import REFUSAL_ID, REPLY_BIT, TimeReply, TimeRequest

# Requests go out at random moments, 10 ms apart in the mean: whatever has a rhythm of its own (the board's
# tick, the frames of USB, an adapter that collects bytes) is met at every phase, and makes noise and no beat.
MEAN_GAP_S = 0.01
# Answers come within 20 ms, or the line has lost something.
_WAIT_S = 0.25
_REQUEST = TimeRequest(tuple(bytes(6)))


class ClockProbe:
    """Asks a board for its time again and again.

    Attributes
    ----------
    trips : the round trips so far, in order.
    lost : requests without an answer.
    """

    def __init__(self, client: Client, seed: int = 1) -> None:
        self.trips: list[RoundTrip] = []
        self.lost = 0
        self._client = client
        self._random = random.Random(seed)
        self._last_ms: int | None = None
        self._total_ms = 0

    def run(self, seconds: float, progress: Progress | None = None) -> None:
        """Go on for so long.

        Raises
        ------
        Interrupted : the client was told to stop.
        LinkClosed : the line is gone.
        """
        stream = self._client.stream
        began = stream.now_s()
        while (passed := stream.now_s() - began) < seconds:
            self.ask()
            self._wait(self._random.uniform(0.0, 2 * MEAN_GAP_S))
            if progress is not None:
                progress(passed / seconds)

    def ask(self) -> bool:
        """One round trip; false: no answer came."""
        client = self._client
        sent = client.stream.now_s()
        sequence = client.post(_REQUEST)
        while (left := sent + _WAIT_S - client.stream.now_s()) > 0:
            frames = client.receive(left)
            received = client.stream.now_s()
            for frame in frames:
                if frame.sequence == sequence and frame.id in (TimeRequest.ID | REPLY_BIT, REFUSAL_ID):
                    reply = client.unpack(_REQUEST, frame)
                    self.trips.append(RoundTrip(sent, received, self._device_s(reply)))
                    return True
                client.counts.strays += 1
        self.lost += 1
        return False

    def _device_s(self, reply: TimeReply) -> float:
        """Device time without its wrap after 49 days."""
        if self._last_ms is None:
            self._total_ms = reply.uptime_ms
        else:
            self._total_ms += (reply.uptime_ms - self._last_ms) & 0xFFFFFFFF
        self._last_ms = reply.uptime_ms
        return self._total_ms / 1e3 + reply.after_us / 1e6

    def _wait(self, seconds: float) -> None:
        stream = self._client.stream
        until = stream.now_s() + seconds
        while (left := until - stream.now_s()) > 0:
            self._client.counts.strays += len(self._client.receive(left))
