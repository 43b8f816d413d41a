"""A line that damages what it carries, the same way for the same seed, or that is cut."""

from __future__ import annotations

import random

from truing.errors import LinkClosed
from truing.link.stream import Stream


class FaultyStream:
    """Passes bytes to and from another stream, and spoils some in both directions.

    Parameters
    ----------
    share : chance that a byte is spoiled; half of the spoiled ones vanish, the others change.
    cut_after_bytes : the line is cut once this many bytes have been received; None: never.
    """

    def __init__(
        self, inner: Stream, share: float = 0.0, seed: int = 1, cut_after_bytes: int | None = None
    ) -> None:
        self.inner = inner
        self.share = share
        self.cut_after_bytes = cut_after_bytes
        self.received = 0
        self.spoiled = 0
        self._random = random.Random(seed)
        self._closed = False

    @property
    def name(self) -> str:
        return self.inner.name

    @property
    def virtual(self) -> bool:
        return self.inner.virtual

    def write(self, data: bytes) -> None:
        self._check()
        self.inner.write(self._spoil(data))

    def read(self, timeout_s: float) -> bytes:
        self._check()
        data = self.inner.read(timeout_s)
        self.received += len(data)
        return self._spoil(data)

    def sleep(self, seconds: float) -> None:
        self.inner.sleep(seconds)

    def now_s(self) -> float:
        return self.inner.now_s()

    def close(self) -> None:
        self._closed = True

    def _check(self) -> None:
        if self._closed or (self.cut_after_bytes is not None and self.received >= self.cut_after_bytes):
            raise LinkClosed(f"{self.name}: the cable was pulled", "plug it in again")

    def _spoil(self, data: bytes) -> bytes:
        if not self.share:
            return data
        out = bytearray()
        for byte in data:
            if self._random.random() >= self.share:
                out.append(byte)
                continue
            self.spoiled += 1
            if self._random.random() < 0.5:
                out.append(byte ^ self._random.randrange(1, 256))
        return bytes(out)
