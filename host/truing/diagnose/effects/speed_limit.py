"""A governor: the wheel does not exceed a speed.

    T dv/dt = g u - v for |v| < limit;  v = ±limit while g u would take it beyond

An ideal saturation of the speed (Åström and Hägglund, Advanced PID Control, section 3.5), as speed-
limited drives and gear motors with a governor show it. The moment at which the limit is reached is solved
as an event.

In data: the staircase of steady speeds is flat above a level; on the way up nothing is missing until the
limit, and on the way down the wheel leaves it late.

Confused with: quadratic drag (57 % on a full staircase, 5 % on ordinary driving), which bends instead of
breaking off; supply sag. A staircase of effort to the top separates them.
"""

from __future__ import annotations

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter


def speed_limit(limit: float) -> float:
    """The speed that the wheel does not exceed, m/s."""
    return limit


def _exercised(data: SetData) -> float:
    return exercise.enough(exercise.seconds(data, abs(data.effort) > 0.55), 2.0)


EFFECT = Effect(
    name="speed_limit",
    title="a speed limit",
    equation="|v| <= limit",
    source="Åström and Hägglund, Advanced PID Control, section 3.5",
    signature="the staircase of speeds is flat above a level",
    separated_by={
        "quadratic_drag": "a staircase of effort to the top: drag bends, a limit is flat",
        "supply_sag": "a staircase of effort to the top, one wheel at a time",
    },
    excited_by="Hold efforts above 55 % for at least two seconds, best as a staircase up to full effort.",
    parameters=(Parameter("limit", "m/s", 0.05, 3.0, 3.0, (0.85, 0.7, 0.5, 0.35), scale="speed", scan=True),),
    exercised=_exercised,
    step_share=0.05,
    exact=True,
)
