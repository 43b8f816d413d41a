"""Resistance that grows with the square of the speed.

    T dv/dt = g (u - c v |v|) - v

The drag of air and of churned lubricant (Hoerner 1965, Fluid-Dynamic Drag, chapter 1); on small robots it
is mostly grease, belts and brush-holders that this term stands for. c is the effort that balances it at 1
m/s.

In data: speeds fall short of the straight line more and more towards the top, smoothly; coming down from
high speed is quicker than going up would suggest; slow driving shows nothing of it.

Confused with: a speed limit (which is flat above a level, drag bends), supply sag (which depends on load
and couples both wheels), Coulomb friction when few speeds were driven. A staircase over the whole range of
effort separates them.
"""

from __future__ import annotations

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, per_wheel


def friction(own: float, speed: float) -> float:
    """Effort against the motion at this speed."""
    return own * speed * speed


def _exercised(data: SetData) -> float:
    fast = exercise.seconds(data, abs(exercise.relative_speed(data)) > 0.5)
    return min(exercise.enough(exercise.speed_levels(data), 3.0), exercise.enough(fast, 3.0))


EFFECT = Effect(
    name="quadratic_drag",
    title="drag that grows with speed squared",
    equation="T dv/dt = g (u - c v |v|) - v",
    source="Hoerner 1965, Fluid-Dynamic Drag, chapter 1",
    signature="speeds fall short more and more towards the top, smoothly",
    separated_by={
        "speed_limit": "a staircase of effort to the top: a limit is flat above a level",
        "supply_sag": "one wheel alone against both wheels at the same effort",
        "coulomb_friction": "a staircase over the whole range of speeds, the slow ones too",
    },
    excited_by=(
        "Drive a staircase of effort: three or more levels for a second each, three seconds of them above "
        "half of the full-effort speed."
    ),
    parameters=per_wheel("", "effort at 1 m/s", 0.0, 3.0, 0.0, (0.08, 0.3), "per_speed_squared"),
    exercised=_exercised,
    step_share=0.05,
)
