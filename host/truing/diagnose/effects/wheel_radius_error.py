"""Effective wheel radii differ from the baseline's, or from each other; seen against an outside pose.

    travel over ground of each wheel = factor * measured travel

Unequal wheel diameters are the first of the two systematic errors of odometry in Borenstein and Feng
(1996, "Measurement and correction of systematic odometry errors in mobile robots", IEEE Trans. Robotics
and Automation 12, section II): equal factors scale the distance, unequal ones bend every path.

In data: distances off by one share; a straight run bends by the same angle per metre, forwards and
backwards along the same arc.

Confused with: wheelbase error (which shows in turns only), heading drift (which does not reverse with the
direction of travel), an encoder's scale (which only a direct measurement separates from a radius). A
straight run there and back, and turns on the spot both ways, separate the first two.
"""

from __future__ import annotations

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, per_wheel


def ground(increment: float, own: float) -> float:
    """Travel over the ground from the measured one."""
    return increment * own


def _exercised(data: SetData) -> float:
    if not data.has_pose:
        return 0.0
    return exercise.enough(exercise.seconds(data, exercise.moving(data)), 10.0)


EFFECT = Effect(
    name="wheel_radius_error",
    title="effective wheel radii differ",
    equation="travel over ground = factor * measured travel",
    source="Borenstein and Feng 1996, IEEE Trans. Robotics and Automation 12, section II",
    signature="distances off by one share; straight runs bend, forwards and backwards along one arc",
    separated_by={
        "wheelbase_error": "straight runs and turns on the spot both ways",
        "heading_drift": "a straight run there and back",
        "encoder_scale": "a direct measurement of wheel radius and counts per revolution",
        "wheel_slip": "gentle and hard starts over the same distance",
    },
    excited_by=(
        "Drive for at least ten seconds with a pose from outside the robot in the log: straight there and "
        "back, and turns both ways."
    ),
    parameters=per_wheel("", "1", 0.5, 2.0, 1.0, (0.97, 1.05)),
    domain="pose",
    needs=("pose", "geometry"),
    exercised=_exercised,
)
