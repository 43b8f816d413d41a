"""Forward and reverse differ in gain and friction: brush timing, a worm gear, unequal switches of a bridge.

    T dv/dt = g r (u - s q F) - v in reverse; r, q = reverse gain and dry friction over those forward

Brushes set off the neutral axis favour one direction of rotation (Hughes and Drury, Electric Motors and
Drives, section 3.3); unequal switches favour one sign of effort. The two differ only while a wheel is being
reversed: `by_effort` is 0 for the first and 1 for the second, a nuisance. The friction of gears and brushes
differs between directions too (Armstrong-Hélouvry et al. 1994, Automatica 30, section 2): where the model has
dry friction, q is fitted beside r. One run alone cannot separate them, so both are pulled towards 1.

In data: backward runs are slower or faster than forward ones by the same share at every level.

Confused with: a slope (29 %), which turns with the robot: drive the same path after half a turn; unequal
friction; one wheel's side asymmetry when one wheel happens to run backwards.
"""

from __future__ import annotations

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter, per_wheel

# Effects that give a wheel dry friction.
DRY_FRICTION = ("coulomb_friction", "stribeck_friction")


def gain(own: float, by_effort: float, direction: float, command: float) -> float:
    """Factor on the steady speed per effort in this direction."""
    motion = 1.0 if direction < 0.0 else 0.0
    effort = motion
    if command < 0.0:
        effort = 1.0
    elif command > 0.0:
        effort = 0.0
    return 1.0 + (own - 1.0) * (by_effort * effort + (1.0 - by_effort) * motion)


def friction_ratio(own_friction: float, direction: float) -> float:
    """Factor on the dry friction in this direction."""
    return own_friction if direction < 0.0 else 1.0


def _exercised(data: SetData) -> float:
    speed = exercise.relative_speed(data)
    forward = exercise.seconds(data, speed > 0.05)
    backward = exercise.seconds(data, speed < -0.05)
    return exercise.enough(min(forward, backward), 3.0)


EFFECT = Effect(
    name="direction_asymmetry",
    title="forward and reverse gains differ",
    equation="g in reverse = r g, dry friction in reverse = q F",
    source="Hughes and Drury, Electric Motors and Drives, section 3.3",
    signature="backward runs off by the same share at every level, forward runs right",
    separated_by={
        "floor_slope": "the same path after a half turn",
        "coulomb_friction": "several levels in both directions",
        "side_asymmetry": "both wheels in both directions",
    },
    excited_by="Drive at least three seconds forward and three backward, at the same levels of effort.",
    parameters=(
        *per_wheel("", "1", 0.3, 3.0, 1.0, (0.93, 1.15), pull=0.1),
        *per_wheel("friction", "1", 0.2, 5.0, 1.0, (0.7, 1.4), beside=DRY_FRICTION, pull=0.003),
        Parameter("by_effort", "1", 0.0, 1.0, 0.0, (0.0, 1.0), nuisance=True, scan=True, fixed=True),
    ),
    exercised=_exercised,
    step_share=0.06,
    exact=True,
)
