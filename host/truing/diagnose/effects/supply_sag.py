"""The supply voltage falls with load current, and with the charge that has been drawn.

    V = 1 - a L - b Q,   L = 1/2 sum over wheels of u (u V - e v / g),   Q = share of the set's charge drawn

A source with internal resistance feeding two pulse-width bridges: a bridge at duty u passes the share u
of its motor's current on to the battery, and the motor's current is (u V - e v / g) of its stall current
(Linden, Handbook of Batteries, section 3.2; Mohan, Undeland and Robbins, Power Electronics, section 7.7).
`a` is the drop with both motors stalled at full effort, `b` the drop from the set's first to its last
moment. `e`, a nuisance, is back-EMF at full speed over the supply: a motor without losses takes no current
there (e = 1), one that is held back by friction in its bearings and gears does.

In data: strong accelerations fall short while steady speeds hold; one wheel slows down when the other is
loaded; the same effort gives less speed at the end of the set than at its start.

Confused with: winding heating (the loss recovers in a pause; charge does not), quadratic drag (which
does not couple the wheels), a current limit. One wheel alone against both at the same effort separates
sag from all of these; so does the logged voltage.
"""

from __future__ import annotations

from truing.arrays import FloatArray
from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter


def supply(
    drop_at_stall: float, drop_over_set: float, duty_square: float, duty_speed: float, slow: float
) -> float:
    """Supply voltage over nominal; the load is solved together with the voltage that it causes."""
    open_circuit = 1.0 - drop_over_set * slow
    return (open_circuit + drop_at_stall * duty_speed) / (1.0 + drop_at_stall * duty_square)


def back_emf(back_emf: float) -> float:
    """Back-EMF at the full-effort speed, over the supply."""
    return back_emf


def slow(dt: FloatArray, draw: FloatArray, out: FloatArray) -> None:
    """Charge drawn by the middle of each row, as a share of the whole set's."""
    charge = 0.0
    for row in range(len(dt)):
        step = max(draw[row], 0.0) * dt[row]
        out[row, 0] = charge + 0.5 * step
        charge += step
    for row in range(len(dt)):
        out[row, 0] = out[row, 0] / charge if charge > 0.0 else 0.0
        out[row, 1] = out[row, 0]


def _exercised(data: SetData) -> float:
    return min(
        exercise.enough(exercise.effort_steps(data, 0.3), 4.0),
        exercise.enough(exercise.both_driven(data), 4.0),
    )


EFFECT = Effect(
    name="supply_sag",
    title="supply sag under load and discharge",
    equation="V = 1 - a L - b Q; L the load current over stall current, Q the share of the charge drawn",
    source="Linden, Handbook of Batteries, section 3.2; Mohan et al., Power Electronics, section 7.7",
    signature="strong accelerations fall short, one wheel slows as the other is loaded, speeds fall in time",
    separated_by={
        "winding_heating": "load, rest, repeat: heat recovers, charge does not; or the logged voltage",
        "quadratic_drag": "one wheel alone against both wheels at the same effort",
        "current_limit": "one wheel alone against both wheels at full effort",
    },
    excited_by=(
        "Give four or more steps of at least 30 % and drive both wheels together for four seconds, and "
        "one wheel alone at the same effort."
    ),
    parameters=(
        Parameter("drop_at_stall", "1", 0.0, 0.8, 0.0, (0.08, 0.3)),
        Parameter("drop_over_set", "1", 0.0, 0.5, 0.0, (0.04, 0.12)),
        Parameter("back_emf", "1", 0.3, 1.0, 1.0, (0.9,), nuisance=True),
    ),
    exercised=_exercised,
    couples=True,
    step_share=0.06,
)
