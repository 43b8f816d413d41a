"""Forward and reverse gains differ: brush timing, a worm gear, a bridge with unequal switches.

    T dv/dt = g r u - v in reverse, r = reverse gain over forward gain

Brushes set off the neutral axis favour one direction of rotation (Hughes and Drury, Electric Motors and
Drives, section 3.3); unequal switches favour one sign of effort. The two differ only while a wheel is being
reversed: `by_effort` is 0 for the first and 1 for the second, a nuisance.

In data: backward runs are slower or faster than forward ones by the same share at every level.

Confused with: a slope (29 %), which turns with the robot: drive the same path after half a turn; unequal
friction; one wheel's side asymmetry when one wheel happens to run backwards.
"""

from __future__ import annotations

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter, per_wheel


def gain(own: float, by_effort: float, direction: float, command: float) -> float:
    """Factor on the steady speed per effort in this direction."""
    motion = 1.0 if direction < 0.0 else 0.0
    effort = motion
    if command < 0.0:
        effort = 1.0
    elif command > 0.0:
        effort = 0.0
    return 1.0 + (own - 1.0) * (by_effort * effort + (1.0 - by_effort) * motion)


def _exercised(data: SetData) -> float:
    speed = exercise.relative_speed(data)
    forward = exercise.seconds(data, speed > 0.05)
    backward = exercise.seconds(data, speed < -0.05)
    return exercise.enough(min(forward, backward), 3.0)


EFFECT = Effect(
    name="direction_asymmetry",
    title="forward and reverse gains differ",
    equation="g in reverse = r g",
    source="Hughes and Drury, Electric Motors and Drives, section 3.3",
    signature="backward runs off by the same share at every level, forward runs right",
    separated_by={
        "floor_slope": "the same path after a half turn",
        "coulomb_friction": "several levels in both directions",
        "side_asymmetry": "both wheels in both directions",
    },
    parameters=(
        *per_wheel("", "1", 0.3, 3.0, 1.0, (0.93, 1.15)),
        Parameter("by_effort", "1", 0.0, 1.0, 0.0, (0.0, 1.0), nuisance=True, scan=True, fixed=True),
    ),
    exercised=_exercised,
    step_share=0.06,
    exact=True,
)
