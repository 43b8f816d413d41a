"""A virtual board inside this process as a stream: waiting makes its time pass."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from truing.errors import LinkClosed

# One frame of 20 bytes takes 217 us on the line; a finer step finds no reply sooner.
_READ_STEP_US = 200
# While nobody listens, time passes in steps that a progress bar and Ctrl-C can follow.
_SLEEP_STEP_US = 20_000


class VirtualBoard(Protocol):
    """What this stream needs of `hil_sim.VirtualRobot`."""

    @property
    def time_s(self) -> float: ...

    def run_us(self, n: int) -> None: ...

    def link_write(self, data: bytes) -> None: ...

    def link_read(self) -> bytes: ...


class VirtualStream:
    """The line to a board whose time passes only in `read` and `sleep`.

    Parameters
    ----------
    on_time : called with the virtual time (s) after every step; for progress and for faults on cue.
    on_close : called when the stream is closed; whoever made the board for this stream alone frees it here.
    """

    virtual = True

    def __init__(
        self,
        board: VirtualBoard,
        name: str = "sim",
        on_time: Callable[[float], None] | None = None,
        on_close: Callable[[], None] | None = None,
    ) -> None:
        self.board = board
        self.on_time = on_time
        self._on_close = on_close
        self._name = name
        self._open = True

    @property
    def name(self) -> str:
        """`sim`."""
        return self._name

    def write(self, data: bytes) -> None:
        """Put `data` on the line; it reaches the board at the baud rate as time passes."""
        self._check()
        self.board.link_write(data)

    def read(self, timeout_s: float) -> bytes:
        """Return what has arrived, letting up to `timeout_s` pass until the first byte."""
        self._check()
        # Upwards: a wait of less than a microsecond must pass too, or its end is never seen.
        left = math.ceil(timeout_s * 1e6)
        while not (data := self.board.link_read()):
            if left <= 0:
                return b""
            left -= self._pass(min(left, _READ_STEP_US))
        return data

    def sleep(self, seconds: float) -> None:
        """Let virtual time pass."""
        left = round(seconds * 1e6)
        while left > 0:
            left -= self._pass(min(left, _SLEEP_STEP_US))

    def now_s(self) -> float:
        """Return the virtual time."""
        return self.board.time_s

    def close(self) -> None:
        """Unplug; the board itself belongs to whoever made it."""
        if self._open:
            self._open = False
            if self._on_close is not None:
                self._on_close()

    def _pass(self, us: int) -> int:
        self.board.run_us(us)
        if self.on_time is not None:
            self.on_time(self.board.time_s)
        return us

    def _check(self) -> None:
        if not self._open:
            raise LinkClosed(f"{self._name}: the link is closed")
