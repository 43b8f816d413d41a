"""The robot's numbers as a user gives them beside recordings, instead of a baseline or to correct one."""

from __future__ import annotations

import math
from dataclasses import replace

from truing.errors import TruingError
from truing.recording.axis import Axis, Motion
from truing.recording.baseline import RobotGeometry
from truing.recording.run import RecordingSet


def with_axis(recordings: RecordingSet, motion: Motion | None) -> RecordingSet:
    """The recordings as those of one axis where that is said; counts of a rotation become radians."""
    found = recordings.of_axis(motion)
    if found.axis is None or found.axis.motion != "rotation" or found.robot is None:
        return found
    return found.with_geometry(replace(found.robot, wheel_radius_m=1.0))


def with_radians(recordings: RecordingSet) -> RecordingSet:
    """The recordings with the angle of an axis that turns: a rotation's positions are radians already."""
    robot = recordings.robot
    if recordings.axis != Axis("rotation") or (robot is not None and robot.wheel_radius_m is not None):
        return recordings
    return recordings.with_geometry(RobotGeometry(wheel_radius_m=1.0))


def given_geometry(
    counts_per_rev: float | None = None,
    wheel_radius_m: float | None = None,
    wheelbase_m: float | None = None,
) -> RobotGeometry:
    """A geometry of these numbers, each of them checked.

    Raises
    ------
    TruingError
        A number is not positive and finite; names it.
    """
    given = {"counts_per_rev": counts_per_rev, "wheel_radius_m": wheel_radius_m, "wheelbase_m": wheelbase_m}
    for name, value in given.items():
        if value is not None and not 0.0 < value < math.inf:
            raise TruingError(f"{name} must be a number above zero, not {value!r}", _EXAMPLE)
    return RobotGeometry("", wheel_radius_m, wheelbase_m, counts_per_rev)


def with_given_geometry(recordings: RecordingSet, given: RobotGeometry) -> RecordingSet:
    """Recordings of a robot with these numbers; the baseline, if there is one, gets them too.

    Raises
    ------
    TruingError
        One of the two numbers that turn counts into metres is still missing; names it.
    """
    if given == RobotGeometry():
        return recordings
    if recordings.axis == Axis("rotation"):
        # Counts of a rotation become radians.
        given = replace(given, wheel_radius_m=1.0)
    found = recordings.with_geometry(given)
    robot = found.robot
    assert robot is not None
    for have, lack in (("counts_per_rev", "wheel_radius_m"), ("wheel_radius_m", "counts_per_rev")):
        if getattr(given, have) is not None and getattr(robot, lack) is None:
            raise TruingError(f"{have} is given, but not {lack}: counts need both", _EXAMPLE)
    return found


_EXAMPLE = (
    "For example --counts-per-rev 2400 --wheel-radius 0.035 (from Python: counts_per_rev=2400, "
    "wheel_radius_m=0.035)"
)
