"""The robot turns with the distance it travels, beyond what its wheels' travel explains.

    heading change + d * distance,   distance * (1 + k)

The vehicle error model of the MOM Simulator View paper (section 4.2): systematic drift per metre and a
scale of distance, found there by repeatedly driving a straight line. Distance may count with its sign
(the path bends the same way over the ground backwards, as with unequal wheels) or without (casters,
camber: the robot always turns left); `signed` is 1 or 0, a nuisance.

In data: straight runs end aside of their line by an angle that grows with the distance; turns on the spot
are right.

Confused with: unequal wheel radii, which turn back on the way back. A straight run there and back
separates the two unless the drift is signed: then they are one thing. Where only end points or the
board's odometry exist, the reference is what was commanded: simulate the wheels too.
"""

from __future__ import annotations

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter


def turning(turn: float, forward: float, drift: float, signed: float) -> float:
    """Heading change over a row."""
    return turn + drift * (signed * forward + (1.0 - signed) * abs(forward))


def distance(forward: float, distance_scale: float) -> float:
    """Distance over a row."""
    return forward * (1.0 + distance_scale)


def _exercised(data: SetData) -> float:
    if not data.has_pose:
        return 0.0
    forward = abs(data.speed_mps.mean(axis=1)) * data.dt_s
    return exercise.enough(float(forward[data.judged].sum()), 5.0)


EFFECT = Effect(
    name="heading_drift",
    title="the heading drifts with distance",
    equation="heading change + d * distance; distance * (1 + k)",
    source="the MOM Simulator View paper, section 4.2",
    signature="straight runs end aside by an angle that grows with distance; turns on the spot are right",
    separated_by={
        "wheel_radius_error": "a straight run there and back",
        "wheelbase_error": "turns on the spot: drift needs distance",
    },
    excited_by=(
        "Drive five metres or more straight, there and back, with a pose from outside the robot in the log."
    ),
    parameters=(
        Parameter("drift", "rad/m", -3.0, 3.0, 0.0, (0.02, -0.02)),
        Parameter("distance_scale", "1", -0.5, 0.5, 0.0, (0.03, -0.03)),
        Parameter("signed", "1", 0.0, 1.0, 0.0, (0.0, 1.0), nuisance=True, scan=True, fixed=True),
    ),
    domain="pose",
    needs=("pose", "geometry"),
    exercised=_exercised,
)
