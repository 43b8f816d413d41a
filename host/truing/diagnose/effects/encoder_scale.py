"""One encoder's counts per revolution are not those of the baseline.

    reported travel = factor * travel

A four-fold decoder set to two, a worn coupling, one channel dead: whole factors and odd ones occur (one of
the real recordings here reads 34 to 67 % of the other side). With encoders and efforts alone a scale is not
distinguishable from a gain, whatever the run: that takes an outside pose or yaw rate. Where the baseline's
two sides must be equal, encoders and efforts show the ratio of the two scales; the left one stands for it.

In data: all speeds of one wheel off by one factor; an outside pose says that the robot went elsewhere
than its encoders claim.

Confused with: side asymmetry and wheel radius. An outside pose separates it from a weak side; only
a direct measurement separates counts from radius.
"""

from __future__ import annotations

from dataclasses import replace

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, per_wheel

_LEFT, _RIGHT = per_wheel("", "1", 0.2, 5.0, 1.0, (0.9, 1.1))


def measure(increment: float, own: float) -> float:
    """Reported travel of a row."""
    return increment * own


def ground(increment: float, own: float) -> float:
    """The wheel's travel from the reported one."""
    return increment / own


def _exercised(data: SetData) -> float:
    moving = exercise.moving(data)
    return exercise.enough(min(exercise.seconds(data, moving[:, w]) for w in (0, 1)), 4.0)


EFFECT = Effect(
    name="encoder_scale",
    title="an encoder's counts per revolution are wrong",
    equation="reported travel = factor * travel",
    source="Borenstein and Feng 1996, IEEE Trans. Robotics and Automation 12, section II",
    signature="all speeds of one wheel are off by one factor, and the pose disagrees with the encoders",
    separated_by={
        "side_asymmetry": "an outside pose or yaw rate",
        "wheel_radius_error": "a direct measurement of wheel radius and counts per revolution",
        "encoder_dropout": "a staircase of speeds",
    },
    excited_by=(
        "Drive each wheel for at least four seconds with a pose or yaw rate from outside the robot in the "
        "log."
    ),
    parameters=(_LEFT, replace(_RIGHT, needs_pose=True)),
    domain="both",
    exercised=_exercised,
)
