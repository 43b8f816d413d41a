"""Dry friction: a constant torque against the motion of each wheel.

    T dv/dt = g (u - s F) - v,  s = sign v;  at rest v stays exactly 0 while |u| <= F

Coulomb's law as every textbook of friction has it (Armstrong-Hélouvry, Dupont and Canudas de Wit 1994, "A
survey of models, analysis tools and compensation methods for the control of machines with friction",
Automatica 30, section 2). F is given as the effort that balances it, so that it reads straight off the
smallest effort that keeps the wheel turning.

In data: nothing moves below F; every steady speed lies g F below the line through the origin, the same in
both directions with the sign turned; at zero effort the wheel stops in finite time, along a curve that
meets zero at an angle instead of creeping towards it; a reversal is steeper before the stop than after it.

Confused with: a driver's dead band, which has the same steady speeds but lets the wheel coast down
exponentially; Stribeck friction, which adds a breakaway above F; quadratic drag, when only a few middle
speeds were driven.
"""

from __future__ import annotations

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, per_wheel


def friction(own: float) -> float:
    """Effort against the motion, whatever the speed."""
    return own


def _exercised(data: SetData) -> float:
    return exercise.enough(exercise.starts_and_stops(data) + exercise.speed_levels(data), 6.0)


EFFECT = Effect(
    name="coulomb_friction",
    title="dry friction",
    equation="T dv/dt = g (u - F sign v) - v; at rest while |u| <= F",
    source="Coulomb; Armstrong-Hélouvry et al. 1994, Automatica 30, section 2",
    signature="no motion below a small effort; steady speeds a fixed amount short; stops in finite time",
    separated_by={
        "driver_deadband": "a coast-down: zero effort from several speeds, logged until standstill",
        "stribeck_friction": "slow ramps of effort through zero, several breakaways",
        "quadratic_drag": "a staircase over the whole range of speeds",
    },
    excited_by=(
        "Start, stop and reverse several times, and hold three or more levels of effort for a second "
        "each, slow ones included."
    ),
    parameters=per_wheel("", "effort", 0.0, 0.6, 0.0, (0.03, 0.12)),
    exercised=_exercised,
)
