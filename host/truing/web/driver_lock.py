"""One person drives at a time; the others watch. Anybody may stop the robot."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

# A page tells many times a second that it is there; one that has been silent for so long may be replaced. A
# page in the background still gets its word in once a second.
SILENT_S = 2.5


@dataclass(slots=True)
class Driver:
    """Who drives: the session of a page, and when it was last heard (monotonic seconds)."""

    session: str
    heard_s: float


class DriverLock:
    """Held by the session that drives.

    Parameters
    ----------
    on_release : called with the session that has just stopped driving, for whatever reason.
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
        """Who drives now."""
        driver = self._driver
        return None if driver is None else driver.session

    def holds(self, session: str) -> bool:
        """Whether that session drives."""
        return self.session == session

    def claim(self, session: str) -> bool:
        """Take the wheel when nobody else has it; True when this session drives now."""
        self.drop_silent()
        with self._guard:
            if self._driver is None:
                self._driver = Driver(session, self._clock())
            return self._driver.session == session

    def heard(self, session: str) -> None:
        """The page of that session is there."""
        driver = self._driver
        if driver is not None and driver.session == session:
            driver.heard_s = self._clock()

    def drop_silent(self) -> None:
        """Take the wheel from a driver whose page has fallen silent."""
        driver = self._driver
        if driver is not None and self._clock() - driver.heard_s > SILENT_S:
            self.release(driver.session)

    def release(self, session: str) -> bool:
        """Leave the wheel; True when this session had it."""
        with self._guard:
            if self._driver is None or self._driver.session != session:
                return False
            self._driver = None
        self._on_release(session)
        return True
