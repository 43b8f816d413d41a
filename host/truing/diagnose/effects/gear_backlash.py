"""Backlash: a gap between the encoder's shaft and the wheel.

    motor side:  (m T / g) dv_m/dt = u - v_m / g - F/2 sign v_m - f
    wheel side:  ((1 - m) T / g) dv_w/dt = f - F/2 sign v_w,   f = 0 inside the gap, contact without bounce

The two-mass model with dead zone (Nordin and Gutman 2002, "Controlling mechanical systems with backlash: a
survey", Automatica 38, section 2), with a stiff shaft: in contact both move as one, and part when the
torque between them changes its sign. Touching and parting are solved as events. The motor's share m of the
inertia is a nuisance; dry friction is taken as half on either side. The encoder sits on the motor's side.

In data: after a reversal or a start the encoder leaps ahead for a few hundredths of a second, as long as
the motor crosses the gap alone, then falls back as it picks the wheel up; a step in the direction of the
last motion shows nothing. The leap's travel is the gap.

Confused with: a delay or lag (65 %), which appears at every step; encoder noise. A reversal step
against a step in the same direction, logged fast, separates them.
"""

from __future__ import annotations

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter, per_wheel


def gap(own: float, radius: float) -> float:
    """Free play at the rim, m."""
    return own * radius


def motor_share(motor_share: float) -> float:
    """Share of the inertia on the motor's side of the gap."""
    return motor_share


def _exercised(data: SetData) -> float:
    return exercise.enough(exercise.reversals(data) + 0.25 * exercise.starts_and_stops(data), 6.0)


EFFECT = Effect(
    name="gear_backlash",
    title="backlash in the gears",
    equation="no torque between motor side and wheel inside the gap; contact without bounce",
    source="Nordin and Gutman 2002, Automatica 38, section 2",
    signature="the encoder leaps ahead after a reversal, then falls back; nothing at other steps",
    separated_by={
        "input_delay": "a reversal step against a step in the same direction",
        "driver_lag": "a reversal step against a step in the same direction",
        "torque_ripple": "repeated reversals from different wheel angles",
    },
    excited_by=(
        "Reverse the effort six or more times, and log at 100 Hz or more: the gap is crossed within "
        "hundredths of a second."
    ),
    parameters=(
        *per_wheel("", "rad", 0.0, 0.6, 0.0, (0.03, 0.1)),
        Parameter("motor_share", "1", 0.02, 0.6, 0.15, (0.1, 0.3), nuisance=True, scan=True),
    ),
    needs=("angle",),
    exercised=_exercised,
    step_share=0.015,
    exact=True,
)
