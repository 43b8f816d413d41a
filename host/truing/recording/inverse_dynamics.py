"""The effort that motion takes, by a linear regression over the rows in motion; no simulation is needed.

    u = hold + friction sign v + damping v + inertia dv/dt

is the inverse dynamics of one joint (Khalil and Dombre 2002, chapter 12). The numbers are known even where a
speed controller shaped the efforts and a free run would not follow the motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truing.arrays import BoolArray, FloatArray
from truing.recording.baseline import RobotGeometry
from truing.recording.run import RecordingSet, Run, Wheel

# Rows above this share of the fastest speed are in motion; so many are needed.
MOVING_SHARE, MIN_ROWS = 0.1, 20
# Damping is known where the fastest tenth of these rows is so many times faster than the slowest.
MIN_SPEED_RATIO = 2.0
# Efforts that scatter by less, of full effort, say enough.
MIN_SCATTER = 0.01


@dataclass(frozen=True, slots=True)
class Motion:
    """Effort, speed and acceleration of all rows of a wheel, shape (n,) each, and its fastest speed.

    Attributes
    ----------
    fastest : the 98th percentile of the speed's size.
    """

    effort: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    fastest: float

    @property
    def moving(self) -> BoolArray:
        """Rows in motion, shape (n,)."""
        return np.asarray(np.abs(self.speed) > MOVING_SHARE * self.fastest)

    @property
    def terms(self) -> FloatArray:
        """What the efforts are a sum of, shape (n, 4)."""
        ones = np.ones_like(self.speed)
        return np.stack([ones, np.sign(self.speed), self.speed, self.acceleration], axis=1)


@dataclass(frozen=True, slots=True)
class DrownedDamping:
    """Efforts that do not say how fast a wheel turns: what a speed controller makes of friction and noise.

    Attributes
    ----------
    damping : effort that the fastest motion takes beyond the slowest, of full effort.
    scatter : RMS of the efforts about the regression.
    """

    damping: float
    scatter: float

    def text(self) -> str:
        """The finding in words."""
        return (
            "the efforts do not distinguish slow from fast motion: full speed takes "
            f"{self.damping:.3f} of full effort more than creeping (damping), and efforts scatter by "
            f"{self.scatter:.3f} about that, as under a speed controller; no simulation that they drive can "
            "follow the speed"
        )


def wheel_motion(recordings: RecordingSet, wheel: Wheel) -> Motion | None:
    """The rows of one wheel, or None where nothing says its speed."""
    if not all(_has_speed(run, recordings.robot) for run in recordings):
        return None
    rows = [_rows(run, wheel, recordings.robot) for run in recordings]
    effort, speed, acceleration = (np.concatenate(values) for values in zip(*rows, strict=True))
    return Motion(effort, speed, acceleration, float(np.percentile(np.abs(speed), 98.0)))


def regression(terms: FloatArray, effort: FloatArray) -> FloatArray:
    """Hold, friction, damping, inertia, shape (4,)."""
    return np.asarray(np.linalg.lstsq(terms, effort, rcond=None)[0])


def drowned_damping(recordings: RecordingSet, wheel: Wheel) -> DrownedDamping | None:
    """Efforts of slow and of fast motion that differ by less than they scatter, or None."""
    motion = wheel_motion(recordings, wheel)
    if motion is None or int(motion.moving.sum()) < MIN_ROWS:
        return None
    moving = motion.moving
    slow, fast = np.percentile(np.abs(motion.speed[moving]), (10.0, 90.0))
    if fast < MIN_SPEED_RATIO * slow:
        return None
    found = regression(motion.terms[moving], motion.effort[moving])
    scatter = float(np.sqrt(np.mean((motion.effort[moving] - motion.terms[moving] @ found) ** 2)))
    damping = abs(float(found[2])) * motion.fastest
    return DrownedDamping(damping, scatter) if scatter > max(damping, MIN_SCATTER) else None


def _has_speed(run: Run, robot: RobotGeometry | None) -> bool:
    """Whether a run's speed is known: counts alone need the length of one."""
    known = robot is not None and robot.metres_per_count is not None
    return known or run.has_pair("vel") or run.has_pair("pos")


def _rows(run: Run, wheel: Wheel, robot: RobotGeometry | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Effort, speed and acceleration of a run's rows, shape (n,) each; rows beside a gap rest at zero."""
    speed = run.speed(wheel, robot).values.copy()
    steps = np.maximum(np.gradient(run.t_s), 1e-9)
    acceleration = np.gradient(speed) / steps
    for gap in run.gaps():
        speed[gap - 1 : gap + 1] = 0.0
    return run.effort(wheel), speed, acceleration
