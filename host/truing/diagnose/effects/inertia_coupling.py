"""The wheels share a chassis: one wheel's torque accelerates the other.

    dv_left/dt = α_left + c α_right,  dv_right/dt = α_right + c α_left,  α_i = (g (u_i - s F) - v_i) / T

A body of mass M and yaw inertia J with wheels at ±b answers a force at one wheel with 1/M + b²/J there
and 1/M - b²/J at the other (Campion, Bastin and D'Andréa-Novel 1996, "Structural properties and
classification of kinematic and dynamic models of wheeled mobile robots", IEEE Trans. Robotics and
Automation 12, section V), so that c = (J - M b²) / (J + M b²): negative for a robot whose mass sits far
out, positive for a compact one.

In data: starting one wheel alone kicks the other; a straight start is quicker (or slower) than a turn on
the spot at the same efforts; steady speeds are right.

Confused with: turning scrub, which also holds at steady speed; supply sag, which also couples the
wheels but slows both. A step of one wheel while the other coasts separates them; straight runs alone
cannot show it.
"""

from __future__ import annotations

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter


def coupling(coupling: float) -> float:
    """Share of the other wheel's own acceleration."""
    return coupling


def _exercised(data: SetData) -> float:
    if exercise.turns_on_the_spot_only(data):
        return 0.0  # the coupling is one with the time constants
    apart = abs(data.effort[:, 0] - data.effort[:, 1]) > 0.1
    return exercise.enough(exercise.seconds(data, apart), 6.0) * min(
        1.0, exercise.enough(exercise.effort_steps(data), 4.0)
    )


EFFECT = Effect(
    name="inertia_coupling",
    title="the wheels are coupled through the chassis",
    equation="dv_left/dt = α_left + c α_right, and the other way round",
    source="Campion, Bastin and D'Andréa-Novel 1996, IEEE Trans. Robotics and Automation 12, section V",
    signature="starting one wheel kicks the other; straight starts and turns differ in quickness",
    separated_by={
        "turning_scrub": "a long turn at a steady speed: scrub stays, coupling is gone",
        "supply_sag": "steps of one wheel in both directions while the other coasts",
        "wheel_slip": "gentle steps of one wheel alone",
    },
    excited_by=(
        "Step one wheel while the other coasts or holds: six seconds with efforts that differ by 10 % or "
        "more, and four steps."
    ),
    parameters=(Parameter("coupling", "1", -0.8, 0.8, 0.0, (0.1, -0.1, 0.3)),),
    exercised=_exercised,
    couples=True,
    step_share=0.05,
)
