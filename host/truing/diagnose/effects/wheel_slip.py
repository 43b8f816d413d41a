"""Finite grip: under hard acceleration the wheel turns more than the robot moves.

    rolling while |dv/dt| <= μ g_e;  sliding:  dv_robot/dt = ±μ g_e,
    (q T / g) dv_wheel/dt = u - v_wheel / g - s F ∓ (1 - q) μ g_e T / g

Coulomb's law between tyre and ground (Wong, Theory of Ground Vehicles, section 1.2): the ground's force
is all that accelerates the robot, and μ times the weight is all that the ground gives. What turns (wheel,
gears, motor) is the share q of the inertia, a nuisance; sliding begins and ends as events. g_e is 9.81
m/s².

In data: after a large step the wheel's speed rises faster than the robot's mass allows, then waits for
it; the pose falls behind the wheels' travel at hard starts and overshoots at hard stops; gentle driving
shows nothing.

Confused with: a shorter time constant (gentle and hard steps distinguish them), wheel radius error (which
shows at every speed), current limit (which slows the wheel instead). Full-effort reversals with an outside
pose separate them.
"""

from __future__ import annotations

from truing.diagnose.data.set_data import GRAVITY, SetData
from truing.diagnose.effect import Effect, Parameter


def grip(grip: float) -> float:
    """Largest acceleration that the tyre gives, m/s²."""
    return grip * GRAVITY


def spin_share(spin_share: float) -> float:
    """Share of the inertia that turns."""
    return spin_share


def _exercised(data: SetData) -> float:
    hard = float(abs(data.acceleration_mps2()).max()) if len(data) else 0.0
    return hard / (0.25 * GRAVITY)


EFFECT = Effect(
    name="wheel_slip",
    title="the wheels slip",
    equation="|dv/dt| of the robot <= μ g; beyond that the wheel turns on its own",
    source="Wong, Theory of Ground Vehicles, section 1.2",
    signature="the wheel shoots ahead after hard steps, then waits; the pose falls behind its travel there",
    separated_by={
        "current_limit": "a full-effort reversal with an outside pose",
        "wheel_radius_error": "gentle and hard starts over the same distance with an outside pose",
        "inertia_coupling": "gentle steps of one wheel alone",
    },
    excited_by=(
        "Start and stop as hard as the drive can, beyond a quarter of the acceleration of gravity, with a "
        "pose from outside in the log."
    ),
    parameters=(
        Parameter("grip", "1", 0.05, 4.0, 4.0, (1.6, 1.25, 0.95, 0.7, 0.45), scale="acceleration", scan=True),
        Parameter("spin_share", "1", 0.03, 0.6, 0.15, (0.2,), nuisance=True),
    ),
    domain="both",
    exercised=_exercised,
    step_share=0.015,
    exact=True,
)
