"""Stribeck friction: breakaway friction well above running friction, fading as the contact begins to slide.

    F(v) = F_run + (F_break - F_run) exp(-(v / v_s)^2)

The curve of Stribeck (1902) in the form that Canudas de Wit, Olsson, Åström and Lischinsky (1995, "A new
model for control of systems with friction", IEEE Trans. Automatic Control 40, equation 5) give the steady
sliding of their bristle model. At rest the wheel holds against F_break.

In data: a wheel that is brought up slowly does not move, then jumps to a speed that it would not have
started at; coming down the same ramp it runs on below its starting effort; creeping is jerky. At higher
speeds it is not distinguishable from Coulomb friction of F_run.

Confused with: Coulomb friction (94 % of it, on plans of steps), torque ripple at creeping speed, a dead
band in the driver. Slow ramps through zero with many breakaways separate them. The speed v_s over which the
excess fades is a nuisance: below the resolution of the log it has no effect.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter, per_wheel


def friction(own: float, own_excess: float, stribeck: float, speed: float) -> float:
    """Effort against the motion at this speed; at rest, what breaks the wheel away."""
    ratio = speed / stribeck
    return own + own_excess * math.exp(-ratio * ratio)


def _report(values: Mapping[str, float]) -> dict[str, float]:
    return {
        "left": values["left"],
        "right": values["right"],
        "breakaway_left": values["left"] + values["excess_left"],
        "breakaway_right": values["right"] + values["excess_right"],
    }


def _from_baseline(given: Mapping[str, float]) -> dict[str, float]:
    numbers = {name: given[name] for name in ("left", "right") if name in given}
    for side in ("left", "right"):
        if f"breakaway_{side}" in given:
            numbers[f"excess_{side}"] = given[f"breakaway_{side}"] - given.get(side, 0.0)
    return numbers


def _exercised(data: SetData) -> float:
    return exercise.enough(exercise.starts_and_stops(data), 10.0)


EFFECT = Effect(
    extends="coulomb_friction",
    name="stribeck_friction",
    title="breakaway (Stribeck) friction",
    equation="F(v) = F_run + (F_break - F_run) exp(-(v / v_s)^2)",
    source="Stribeck 1902; Canudas de Wit et al. 1995, IEEE TAC 40, equation 5",
    signature="the wheel sticks, then jumps; it runs on below the effort that started it",
    separated_by={
        "coulomb_friction": "slow ramps of effort through zero, several breakaways",
        "driver_deadband": "slow ramps of effort up and down: friction keeps running on the way down",
        "torque_ripple": "slow creep over several turns of the wheel",
    },
    excited_by=(
        "Start and stop each wheel from rest ten times or more, with small efforts that barely break it away."
    ),
    parameters=(
        *per_wheel("", "effort", 0.0, 0.6, 0.0, (0.03, 0.1)),
        Parameter("excess_left", "effort", 0.0, 0.6, 0.0, (0.03, 0.1), "left"),
        Parameter("excess_right", "effort", 0.0, 0.6, 0.0, (0.03, 0.1), "right"),
        Parameter(
            "stribeck",
            "m/s",
            0.002,
            0.5,
            0.05,
            (0.02, 0.08),
            scale="speed",
            log=True,
            nuisance=True,
            scan=True,
        ),
    ),
    report=_report,
    from_baseline=_from_baseline,
    units={"breakaway_left": "effort", "breakaway_right": "effort"},
    non_negative=("breakaway_left", "breakaway_right"),
    exercised=_exercised,
    step_share=0.025,
)
