"""The driver limits the motor's current, so that torque saturates.

    T dv/dt = g (clip(u - e v / g, ±limit)) - (1 - e) v while clipped, the baseline otherwise

The motor's torque is u - e v / g of its stall torque (the linear torque-speed line of a permanent-magnet
motor, Hughes and Drury, Electric Motors and Drives, section 3.4); a chopper drive clips it. `e`, a nuisance,
is back-EMF at full speed over the supply: the rest of what slows the robot with speed is no current's.

In data: accelerations never exceed limit g / T: a large step rises along a straight line before it turns
into the exponential; small steps and steady speeds are right. A reversal at full effort asks for up to
twice the stall torque and shows the limit first.

Confused with: hardly anything when it acts, since nothing else caps acceleration (wheel slip does so
for the robot, not for the wheel); and not exercised by ordinary driving. A full-effort reversal settles
it.
"""

from __future__ import annotations

import numpy as np

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter


def torque_limit(limit: float) -> float:
    """Largest torque, as a share of stall torque."""
    return limit


def back_emf(back_emf: float) -> float:
    """Back-EMF at the full-effort speed, over the supply."""
    return back_emf


def _exercised(data: SetData) -> float:
    asked = np.zeros_like(data.effort)
    asked[1:] = np.abs(data.effort[1:] - exercise.relative_speed(data)[:-1])
    asked[data.first] = 0.0
    return float(asked.max() / 0.8) if len(asked) else 0.0


EFFECT = Effect(
    name="current_limit",
    title="a current limit in the driver",
    equation="motor torque u - e v / g is clipped at ±limit; e v / g the back-EMF",
    source="Hughes and Drury, Electric Motors and Drives, section 3.4",
    signature="large steps rise along a straight line; small steps and steady speeds are right",
    separated_by={
        "supply_sag": "a full-effort reversal of one wheel alone",
        "wheel_slip": "a full-effort reversal with an outside pose",
        "driver_lag": "steps of several heights: a lag scales with the step, a limit does not",
    },
    excited_by=(
        "Reverse from full effort to full effort the other way: effort and speed then differ by up to "
        "twice the stall torque."
    ),
    parameters=(
        Parameter("limit", "1", 0.05, 2.0, 2.0, (1.5, 1.2, 0.9, 0.6, 0.4, 0.25), scan=True),
        Parameter("back_emf", "1", 0.3, 1.0, 1.0, (0.9,), nuisance=True),
    ),
    exercised=_exercised,
    step_share=0.04,
    exact=True,
)
