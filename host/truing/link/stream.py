"""What carries bytes to and from a board, with a clock of its own."""

from __future__ import annotations

from typing import Protocol


class Stream(Protocol):
    """A two-way byte stream with a clock.

    A real line's clock is the host's; a virtual board's is virtual time, which passes only while
    somebody reads or sleeps. All time-outs of the link are taken on this clock.
    """

    @property
    def name(self) -> str:
        """Where it leads, in the user's words (`/dev/ttyUSB0`, `tcp:robot:7700`, `sim`)."""

    @property
    def virtual(self) -> bool:
        """Whether its clock is virtual time."""

    def write(self, data: bytes) -> None:
        """Send all of `data`; raises `LinkClosed` when the line is gone."""

    def read(self, timeout_s: float) -> bytes:
        """Return what has arrived, waiting up to `timeout_s` for the first byte; empty when none came.

        Raises `LinkClosed` when the line is gone.
        """

    def sleep(self, seconds: float) -> None:
        """Let time pass on this stream's clock; what arrives meanwhile is kept for `read`."""

    def now_s(self) -> float:
        """Return the time on this stream's clock, seconds from an arbitrary origin."""

    def close(self) -> None:
        """Release the line; closing twice is harmless."""
