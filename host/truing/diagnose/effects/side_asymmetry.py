"""One wheel's gain or time constant differs from the other's, where the baseline has them equal.

    g_left / g_right = r_g,  T_left / T_right = r_T; the geometric means are the baseline's (refitted) numbers

Manufacture scatters motor constants and gear friction by several per cent; a baseline that copies one
wheel's numbers to the other leaves that out. The refit of such a baseline keeps its two wheels equal, and
this effect unties them.

In data: the robot pulls to one side at equal efforts; every level of one wheel is off by the same share.

Confused with: an encoder's scale, which only an outside pose distinguishes from a gain; dry friction
of one side, which takes the same amount off every level instead of the same share; direction asymmetry
when the wheels run in opposite directions. Levels of both wheels in both directions separate the last
two.
"""

from __future__ import annotations

import math

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter


def gain(gain_ratio: float, wheel: int) -> float:
    """Factor on the steady speed per effort."""
    return math.sqrt(gain_ratio) if wheel == 0 else 1.0 / math.sqrt(gain_ratio)


def inertia(time_constant_ratio: float, wheel: int) -> float:
    """Factor on the time constant."""
    return math.sqrt(time_constant_ratio) if wheel == 0 else 1.0 / math.sqrt(time_constant_ratio)


def _exercised(data: SetData) -> float:
    moving = exercise.moving(data)
    shorter = min(exercise.seconds(data, moving[:, w]) for w in (0, 1))
    return exercise.enough(shorter, 4.0)


EFFECT = Effect(
    name="side_asymmetry",
    title="the two sides differ",
    equation="g_left / g_right = r_g, T_left / T_right = r_T",
    source="Borenstein and Feng 1996, IEEE Trans. Robotics and Automation 12, on unequal drives",
    signature="the robot pulls to one side at equal efforts; one wheel is off by the same share everywhere",
    separated_by={
        "encoder_scale": "an outside pose: a scaled encoder misreports the turn, a weak side really turns",
        "coulomb_friction": "a staircase: friction takes one amount off every level, a gain one share",
        "direction_asymmetry": "both wheels in both directions",
    },
    excited_by=(
        "Drive both wheels for at least four seconds each, at several levels and with starts and stops."
    ),
    parameters=(
        Parameter("gain_ratio", "1", 0.3, 3.0, 1.0, (1.08, 0.92), log=True),
        Parameter("time_constant_ratio", "1", 0.2, 5.0, 1.0, (1.15, 0.87), log=True),
    ),
    needs=("equal_wheels",),
    exercised=_exercised,
)
