"""Exclusive control: one page drives at a time, the others observe. Any page may stop the robot."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

# Pages send a heartbeat many times a second; browsers throttle a page in the background to one per second.
DRIVER_TIMEOUT_S = 2.5


@dataclass(slots=True)
class Driver:
    """The driving page's session and the time of its last heartbeat (monotonic seconds)."""

    session: str
    last_seen_s: float


class DriverLock:
    """The lock that the driving session holds.

    Parameters
    ----------
    on_release : called with the session that has just released control, for any reason.
    clock : monotonic seconds.
    """

    def __init__(
        self, on_release: Callable[[str], None] = lambda _: None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._on_release = on_release
        self._clock = clock
        self._driver: Driver | None = None
        self._guard = threading.Lock()

    @property
    def session(self) -> str | None:
        """The driving session; None while there is none."""
        driver = self._driver
        return None if driver is None else driver.session

    def holds(self, session: str) -> bool:
        """Whether this session drives."""
        return self.session == session

    def claim(self, session: str) -> bool:
        """Take control if no other session holds it; True when this session drives now."""
        self.expire()
        with self._guard:
            if self._driver is None:
                self._driver = Driver(session, self._clock())
            return self._driver.session == session

    def refresh(self, session: str) -> None:
        """Record a heartbeat of the session."""
        driver = self._driver
        if driver is not None and driver.session == session:
            driver.last_seen_s = self._clock()

    def expire(self) -> None:
        """Release the lock of a driver whose heartbeat has timed out."""
        driver = self._driver
        if driver is not None and self._clock() - driver.last_seen_s > DRIVER_TIMEOUT_S:
            self.release(driver.session)

    def release(self, session: str) -> bool:
        """Release control; True when this session held it."""
        with self._guard:
            if self._driver is None or self._driver.session != session:
                return False
            self._driver = None
        self._on_release(session)
        return True
