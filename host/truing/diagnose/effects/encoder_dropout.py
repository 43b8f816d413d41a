"""Lost counts: the faster the wheel turns, the larger the share that the counter misses.

    reported speed = v (1 - d (|v| / v_top)^n),   v_top the baseline's full-effort speed

A counter that polls its inputs, or an interrupt that comes too late, misses edges once they follow too
fast; what is lost is lost for good (Petrella, Tursini, Peretti and Zigliotto 2007, "Speed measurement
algorithms for low-resolution incremental encoder equipped drives", ACEMP, on limits of counting). The
exponent n is a nuisance: 1 where losses grow evenly, 3 where they set in late.

In data: measured speeds bend down towards the top, and the travel is short by what was lost; against an
outside pose the robot has gone farther than its encoders show.

Confused with: quadratic drag and a speed limit, which slow the robot down instead of its counts. An
outside pose shows which; otherwise a drop from full speed: drag brakes it faster, dropout recovers the
lost counts.
"""

from __future__ import annotations

import math

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter, per_wheel


def measure(increment: float, own: float, exponent: float, dt: float, top: float) -> float:
    """Travel that is left after the lost counts."""
    share = min(abs(increment) / (dt * top), 1.5)
    return increment * (1.0 - min(own * math.pow(share, exponent), 1.0))


def ground(increment: float, own: float, exponent: float, dt: float, top: float) -> float:
    """Travel before counts were lost: the measured one, solved for it."""
    true = increment
    for _ in range(6):
        share = min(abs(true) / (dt * top), 1.5)
        true = increment / (1.0 - min(own * math.pow(share, exponent), 0.9))
    return true


def _exercised(data: SetData) -> float:
    fast = exercise.seconds(data, abs(exercise.relative_speed(data)) > 0.5)
    return min(exercise.enough(exercise.speed_levels(data), 3.0), exercise.enough(fast, 3.0))


EFFECT = Effect(
    name="encoder_dropout",
    title="encoder counts lost at speed",
    equation="reported speed = v (1 - d (|v| / v_top)^n)",
    source="Petrella et al. 2007, ACEMP, on the limits of counting",
    signature="measured speeds bend down towards the top; the robot goes farther than its counts show",
    separated_by={
        "quadratic_drag": "an outside pose; or steps down from full speed",
        "speed_limit": "a staircase of effort to the top",
        "encoder_scale": "a staircase of speeds: a scale is the same at every speed",
    },
    excited_by=(
        "Hold three or more levels of speed for a second each, at least three seconds of it above half of "
        "the full-effort speed."
    ),
    parameters=(
        *per_wheel("", "1", 0.0, 0.9, 0.0, (0.06, 0.2)),
        Parameter("exponent", "1", 0.5, 6.0, 1.0, (1.0, 3.0), nuisance=True, scan=True),
    ),
    domain="both",
    exercised=_exercised,
)
