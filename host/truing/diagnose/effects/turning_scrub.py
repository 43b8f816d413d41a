"""Scrub: friction against the wheels turning differently, from tyres and casters that are dragged sideways.

    left effort - S sign(v_left - v_right),  right effort + S sign(v_left - v_right)

A robot that turns shears its tyres and swivels its caster; the moment that this costs is nearly constant,
as dry friction is (Wong, Theory of Ground Vehicles, section 6.2 on skid steering; the paper of the MSRP
robot measures 9.1 instead of 12.1 mm/s per per cent when one wheel pivots). The friction is set-valued:
wheels of equal speed stay locked together until their efforts differ by more than it takes.

In data: turning on the spot and pivoting need more effort than driving straight; straight runs are right; a
wheel that is not driven is dragged along by the other before it turns against it.

Confused with: Coulomb friction, when only turns were driven; coupling of the inertias, which acts on
acceleration alone. A straight run against a turn on the spot at the same effort separates them.
"""

from __future__ import annotations

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter

# Wheels whose speeds differ by less than this share of full speed drive straight.
STRAIGHT_SHARE = 0.035


def scrub(scrub: float) -> float:
    """Effort against the wheels turning differently."""
    return scrub


def _exercised(data: SetData) -> float:
    difference = abs(data.speed_mps[:, 1] - data.speed_mps[:, 0])
    straight = exercise.seconds(
        data, exercise.moving(data).all(axis=1) & (difference < STRAIGHT_SHARE * data.top_mps)
    )
    if exercise.turns_on_the_spot_only(data):
        return 0.0  # scrub is one with the friction of the wheels
    return exercise.enough(exercise.turns(data), 4.0) * min(1.0, 0.5 + 0.25 * straight)


EFFECT = Effect(
    name="turning_scrub",
    title="scrub of tyres and casters in turns",
    equation="wheel efforts -S and +S times sign(v_left - v_right); locked together below that",
    source="Wong, Theory of Ground Vehicles, section 6.2",
    signature="turning needs more effort than driving straight at the same wheel speeds",
    separated_by={
        "coulomb_friction": "a straight run against a turn on the spot at the same efforts",
        "inertia_coupling": "a long turn at a steady speed",
        "supply_sag": "one wheel alone, then both, at a steady low speed",
    },
    excited_by=(
        "Turn for at least four seconds with clearly different wheel speeds, on the spot and one wheel at "
        "a time, and drive straight for two."
    ),
    parameters=(Parameter("scrub", "effort", 0.0, 0.6, 0.0, (0.03, 0.1)),),
    exercised=_exercised,
    couples=True,
    step_share=0.1,
)
