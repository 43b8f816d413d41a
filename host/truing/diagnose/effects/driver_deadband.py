"""A dead band in the driver: nothing below a small effort, and less by that much above it.

    u = sign(command) max(|command| - d, 0)

The dead zone of the textbooks (Slotine and Li, Applied Nonlinear Control, section 5.2), as bridges with
dead time and switched drivers with a threshold have it.

In data: no motion below d and all steady speeds short by g d, as with dry friction. But the wheel is not
held: at zero effort it runs down exponentially and creeps towards zero, and pushing through zero costs
nothing.

Confused with: Coulomb friction (77 to 93 %): steady speeds alone do not distinguish them. A coast-down,
zero effort from several speeds logged until standstill, does.
"""

from __future__ import annotations

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter


def drive(deadband: float, effort: float) -> float:
    """What the driver gives for this command."""
    if effort > deadband:
        return effort - deadband
    if effort < -deadband:
        return effort + deadband
    return 0.0


def _exercised(data: SetData) -> float:
    low = exercise.seconds(data, (abs(data.effort) > 0.005) & (abs(data.effort) < 0.4))
    return exercise.enough(low, 4.0)


EFFECT = Effect(
    name="driver_deadband",
    title="a dead band in the motor driver",
    equation="u = sign(command) max(|command| - d, 0)",
    source="Slotine and Li, Applied Nonlinear Control, section 5.2",
    signature="no motion below a small effort, all speeds short by a fixed amount, an exponential run-down",
    separated_by={
        "coulomb_friction": "a coast-down: zero effort from several speeds, logged until standstill",
        "stribeck_friction": "slow ramps of effort up and down again",
    },
    excited_by=(
        "Spend at least four seconds at efforts below 40 %, with ramps through zero, and let the wheel "
        "run down to standstill."
    ),
    parameters=(Parameter("deadband", "effort", 0.0, 0.6, 0.0, (0.03, 0.12)),),
    exercised=_exercised,
)
