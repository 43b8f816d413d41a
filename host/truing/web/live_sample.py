"""What the robot does at one moment, and the last minutes of it, for whoever looks."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from truing.web.pose import Pose

# Ten minutes at 200 Hz would be 120,000; a page draws the last twenty seconds.
_KEPT = 8_000


@dataclass(frozen=True, slots=True)
class LiveSample:
    """One moment by the board's clock; pairs are left and right.

    Attributes
    ----------
    odometry : the board's own pose, from zero at the start of its present log.
    command_mps : wheel speeds that were asked for; None while nothing is or it was asked in effort.
    """

    t_s: float
    odometry: Pose
    speed_mps: tuple[float, float]
    effort: tuple[float, float]
    command_mps: tuple[float, float] | None
    battery_v: float | None


@dataclass(frozen=True, slots=True)
class PlacedSample:
    """A sample with its place in the world, and its number since the view was started."""

    number: int
    sample: LiveSample
    pose: Pose


class LiveHistory:
    """The newest samples; written by one thread, read by many, never waiting for a reader."""

    def __init__(self, kept: int = _KEPT) -> None:
        self._samples: deque[PlacedSample] = deque(maxlen=kept)
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
        """Samples so far, forgotten ones included."""
        return self._next

    def latest(self) -> PlacedSample | None:
        """The newest sample."""
        with self._lock:
            return self._samples[-1] if self._samples else None

    def since(self, number: int, most: int) -> list[PlacedSample]:
        """Samples from `number` on, oldest first; of more than `most`, an even choice with the newest."""
        with self._lock:
            if not self._samples or number >= self._next:
                return []
            skip = max(0, number - self._samples[0].number)
            wanted = len(self._samples) - skip
            stride = -(-wanted // most)
            found = [self._samples[-1 - back] for back in range(0, wanted, stride)]
        return found[::-1]


class PoseChain:
    """Lays the board's odometry, which goes back to zero with every log, end to end in the world.

    Parameters
    ----------
    start : where the robot stood in the world when the view began to watch.
    """

    def __init__(self, start: Pose | None = None) -> None:
        self._base = start or Pose()
        self._last = Pose()
        self._fresh = True

    def place(self, odometry: Pose) -> Pose:
        """The world pose of an odometry pose that follows the last one."""
        if self._fresh:
            # Whatever was driven before the view came is nobody's business: here is the start.
            self._base = self._base.compose(odometry.inverse())
            self._fresh = False
        elif self._restarted(odometry):
            self._base = self._base.compose(self._last)
        self._last = odometry
        return self._base.compose(odometry)

    def reset(self, pose: Pose) -> None:
        """Say where the robot stands in the world now."""
        self._base, self._fresh = pose, True

    def _restarted(self, now: Pose) -> bool:
        """No robot gets back to within a hand of zero from beyond in the time between two samples."""
        moved = now.distance_m(self._last) + abs(now.theta_rad - self._last.theta_rad)
        from_zero = now.distance_m(Pose()) + abs(now.theta_rad)
        return moved > 0.01 and from_zero < 0.5 * moved
