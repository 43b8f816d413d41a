"""Live samples of the robot's state, and a bounded history of them."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from truing.web.pose import Pose

# 40 s at 200 Hz; the strip chart shows the last twelve seconds.
_CAPACITY = 8_000


@dataclass(frozen=True, slots=True)
class LiveSample:
    """One sample by the board's clock; pairs are left and right.

    Attributes
    ----------
    odometry : the board's own pose, from zero at the start of its present log.
    command_mps : commanded wheel speeds; None without a command or with one in effort.
    """

    t_s: float
    odometry: Pose
    speed_mps: tuple[float, float]
    effort: tuple[float, float]
    command_mps: tuple[float, float] | None
    battery_v: float | None


@dataclass(frozen=True, slots=True)
class PlacedSample:
    """A sample with its pose in the world and its sequence number since the view started."""

    number: int
    sample: LiveSample
    pose: Pose


class LiveHistory:
    """Ring buffer of the newest samples; one writer, many readers, never blocked by a reader."""

    def __init__(self, capacity: int = _CAPACITY) -> None:
        self._samples: deque[PlacedSample] = deque(maxlen=capacity)
        self._lock = threading.Lock()
        self._next = 0

    def extend(self, placed: Iterable[tuple[LiveSample, Pose]]) -> None:
        """Add samples in order."""
        with self._lock:
            for sample, pose in placed:
                self._samples.append(PlacedSample(self._next, sample, pose))
                self._next += 1

    @property
    def count(self) -> int:
        """Samples so far, discarded ones included."""
        return self._next

    def latest(self) -> PlacedSample | None:
        """The newest sample."""
        with self._lock:
            return self._samples[-1] if self._samples else None

    def since(self, number: int, limit: int) -> list[PlacedSample]:
        """Samples from `number` on, oldest first; if more than `limit`, evenly decimated, with the newest."""
        with self._lock:
            if not self._samples or number >= self._next:
                return []
            skip = max(0, number - self._samples[0].number)
            available = len(self._samples) - skip
            stride = -(-available // limit)
            found = [self._samples[-1 - back] for back in range(0, available, stride)]
        return found[::-1]


class PoseChain:
    """Concatenates the board's odometry, which restarts at zero with every log, into one world pose.

    Parameters
    ----------
    start : the robot's pose in the world when the view started.
    """

    def __init__(self, start: Pose | None = None) -> None:
        self._base = start or Pose()
        self._last = Pose()
        self._first = True

    def place(self, odometry: Pose) -> Pose:
        """The world pose of an odometry pose that follows the last one."""
        if self._first:
            # Travel from before the view started is not counted.
            self._base = self._base.compose(odometry.inverse())
            self._first = False
        elif self._restarted(odometry):
            self._base = self._base.compose(self._last)
        self._last = odometry
        return self._base.compose(odometry)

    def reset(self, pose: Pose) -> None:
        """Set the robot's present pose in the world."""
        self._base, self._first = pose, True

    def _restarted(self, now: Pose) -> bool:
        """Whether odometry was reset: a jump to near zero that no robot can drive between two samples."""
        moved = now.distance_m(self._last) + abs(now.theta_rad - self._last.theta_rad)
        from_zero = now.distance_m(Pose()) + abs(now.theta_rad)
        return moved > 0.01 and from_zero < 0.5 * moved
