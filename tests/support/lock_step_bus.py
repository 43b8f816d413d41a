"""python-can's own adapters in virtual time: no frame is on its way while time passes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Protocol

from hil_sim import VirtualCanBus
from truing.link.can_bus import AdapterBus

_STEP_US = 100
_SLEEP_STEP_US = 5_000  # few frames come in it, and the terminal holds them
_PATIENCE_S = 60.0  # of the operating system, which owes what was written; no virtual time passes meanwhile


class FarEnd(Protocol):
    """The board's side of an adapter: it counts the frames that it took and passed on."""

    taken: int
    passed_on: int

    def exchange(self) -> None:
        """Take what has come, pass on what the bus has brought."""


class LockStepBus(AdapterBus):
    """A host's adapter whose far end is served by the same thread.

    Virtual time passes only once every frame that was written at one end has come out at the other, so that
    it does not matter how busy the machine is.
    """

    virtual = True

    def __init__(
        self, interface: str, channel: str, bit_rate: int, far_end: FarEnd, line: VirtualCanBus
    ) -> None:
        self._far_end = far_end
        self._line = line
        self._said = self._heard = 0
        super().__init__(interface, channel, bit_rate)

    def send(self, can_id: int, data: bytes) -> None:
        super().send(can_id, data)
        self._said += 1
        self._until(lambda: self._far_end.taken >= self._said)

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        left = max(0, math.ceil(timeout_s * 1e6))
        while self._heard == self._far_end.passed_on:
            if left <= 0:
                return None
            left -= self._pass(min(left, _STEP_US))
        found: list[tuple[int, bytes]] = []

        def heard() -> bool:
            frame = super(LockStepBus, self).receive(0.02)
            if frame is not None:
                found.append(frame)
            return frame is not None

        self._until(heard)
        self._heard += 1
        return found[0]

    def sleep(self, seconds: float) -> None:
        left = round(seconds * 1e6)
        while left > 0:
            left -= self._pass(min(left, _SLEEP_STEP_US))

    def now_s(self) -> float:
        return self._line.time_s

    def _pass(self, us: int) -> int:
        self._line.run_us(us)
        self._far_end.exchange()
        return us

    def _until(self, done: Callable[[], bool]) -> None:
        deadline = time.monotonic() + _PATIENCE_S
        while not done():
            self._far_end.exchange()
            assert time.monotonic() < deadline, "a frame was lost between the adapter and its far end"
