"""Torque ripple: cogging and commutation, periodic in the wheel's angle.

    T dv/dt = g (u + a sin N φ + b cos N φ) - v,   φ the measured wheel angle

Cogging repeats with the least common multiple of poles and slots, commutation with the segments, each times
the gear ratio (Holtz and Springob 1996, "Identification and compensation of torque ripple in high-precision
permanent magnet motor drives", IEEE Trans. Industrial Electronics 43). The phase comes from the measured
counts: a simulated angle drifts away from it. Between samples the angle follows a cubic through the counts,
and the ripple's mean over each substep is taken exactly.

In data: at creeping speed the wheel surges and hangs at the same angles in every turn; at speed the wheel's
inertia smooths it away.

Confused with: Stribeck friction (56 %); an eccentric encoder, which oscillates as much at speed as at
creep. Slow creep over several turns, and the same distance at several speeds, separates them. Ripple whose
frequency lies above half of the log's rate aliases: its N is then not identifiable. `per_run` is 1 where
every run begins at the same wheel angle, and 0 where the wheel stays as the last run left it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter


def push(
    own_sine: float,
    own_cosine: float,
    per_revolution: float,
    per_run: float,
    angle_start: float,
    angle_end: float,
    origin: float,
) -> float:
    """Mean effort of the ripple over the substep."""
    middle = per_revolution * (0.5 * (angle_start + angle_end) - per_run * origin)
    half = 0.5 * per_revolution * (angle_end - angle_start)
    square = half * half
    mean = 1.0 - square / 6.0 * (1.0 - square / 20.0) if square < 1e-2 else math.sin(half) / half
    return mean * (own_sine * math.sin(middle) + own_cosine * math.cos(middle))


def _report(values: Mapping[str, float]) -> dict[str, float]:
    return {
        "amplitude_left": math.hypot(values["sine_left"], values["cosine_left"]),
        "amplitude_right": math.hypot(values["sine_right"], values["cosine_right"]),
        "per_revolution": values["per_revolution"],
    }


def _from_baseline(given: Mapping[str, float]) -> dict[str, float]:
    numbers = {f"sine_{side}": given.get(f"amplitude_{side}", 0.0) for side in ("left", "right")}
    if "per_revolution" in given:
        numbers["per_revolution"] = given["per_revolution"]
    return numbers


def _exercised(data: SetData) -> float:
    if data.angle_rad is None:
        return 0.0
    slow = (abs(exercise.relative_speed(data)) < 0.35) & exercise.moving(data)
    return exercise.enough(exercise.seconds(data, slow), 4.0)


EFFECT = Effect(
    name="torque_ripple",
    title="torque ripple (cogging)",
    equation="effort + a sin N φ + b cos N φ, φ the measured wheel angle",
    source="Holtz and Springob 1996, IEEE Trans. Industrial Electronics 43",
    signature="surges at the same wheel angles in every turn, at creeping speed above all",
    separated_by={
        "stribeck_friction": "slow creep over several turns of the wheel",
        "encoder_eccentricity": "the same distance at several speeds: ripple falls, eccentricity does not",
        "gear_backlash": "creep in one direction, without reversals",
    },
    excited_by=(
        "Creep below a third of the full-effort speed for at least four seconds, over several turns of "
        "each wheel."
    ),
    parameters=(
        Parameter("sine_left", "effort", -0.5, 0.5, 0.0, (0.03, -0.03), "left"),
        Parameter("sine_right", "effort", -0.5, 0.5, 0.0, (0.03, -0.03), "right"),
        Parameter("cosine_left", "effort", -0.5, 0.5, 0.0, (0.03, -0.03), "left"),
        Parameter("cosine_right", "effort", -0.5, 0.5, 0.0, (0.03, -0.03), "right"),
        Parameter(
            "per_revolution",
            "1",
            1.0,
            60.0,
            6.0,
            tuple(float(n) for n in (*range(1, 25), 28, 30, 32, 36, 40, 48)),
            scan=True,
            fixed=True,
        ),
        Parameter("per_run", "1", 0.0, 1.0, 0.0, (0.0, 1.0), nuisance=True, scan=True, fixed=True),
    ),
    needs=("angle",),
    report=_report,
    from_baseline=_from_baseline,
    units={"amplitude_left": "effort", "amplitude_right": "effort"},
    non_negative=("amplitude_left", "amplitude_right"),
    exercised=_exercised,
    step_share=0.03,
    settles=False,
)
