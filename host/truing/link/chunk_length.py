"""How many bytes to ask for at once on a line that loses some: as many as pay."""

from __future__ import annotations

import math

SHORTEST = 16
# On the wire besides the data: a log_read request (16 bytes) and its reply's frame and offset (14).
FRAME_BYTES = 30
_MEMORY = 0.9


class ChunkLength:
    """Estimates the chance that a byte is damaged, and gives the length that wastes the smallest share.

    With a chance p per byte and h bytes of overhead, a chunk of n bytes costs about
    (n + h) / (n (1 - p)^(n + h)) bytes on the line per byte delivered, which is smallest near
    n = sqrt(h / p) for small p. On a clean line that is the longest allowed.

    Parameters
    ----------
    longest : what one reply holds at most, bytes.
    """

    def __init__(self, longest: int) -> None:
        self._longest = longest
        self._bytes = 0.0
        self._losses = 0.0

    @property
    def value(self) -> int:
        """Bytes to ask for next."""
        if self._losses < 0.05:
            return self._longest
        best = math.sqrt(FRAME_BYTES * self._bytes / self._losses)
        return max(SHORTEST, min(int(best), self._longest))

    def arrived(self, length: int) -> None:
        """A chunk of `length` bytes came through."""
        self._remember(length, 0.0)

    def lost(self, length: int) -> None:
        """A chunk of `length` bytes, or the request for it, did not."""
        self._remember(length, 1.0)

    def came_after_all(self) -> None:
        """What was taken for lost was only late."""
        self._losses = max(0.0, self._losses - 1.0)

    def _remember(self, length: int, losses: float) -> None:
        self._bytes = self._bytes * _MEMORY + length + FRAME_BYTES
        self._losses = self._losses * _MEMORY + losses
