"""The floor slopes: gravity pulls along the heading.

    dv/dt of both wheels - g_e sin(slope) cos(heading - uphill heading)

Gravity's component along an inclined plane (any mechanics text; Wong, Theory of Ground Vehicles, section
3.1 on grade resistance); slopes are small, so that the sine is taken as the slope. It is fitted as the
two components slope·cos(uphill) and slope·sin(uphill), in which it is linear.

In data: the same efforts give less speed on one heading and more on the opposite one; at rest nothing,
while friction holds; a robot that turns on the spot sways once per turn.

Confused with: direction asymmetry (29 %), when forward always meant uphill; an offset on one heading. The
same path after a half turn separates them. On one heading alone it is not distinguishable from an offset in
the driver.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from truing.diagnose.data.set_data import GRAVITY, SetData
from truing.diagnose.effect import Effect, Parameter


def push(uphill_cosine: float, uphill_sine: float, heading: float, effort_per_mps2: float) -> float:
    """Gravity along the heading, as an effort."""
    grade = uphill_cosine * math.cos(heading) + uphill_sine * math.sin(heading)
    return -GRAVITY * grade * effort_per_mps2


def _report(values: Mapping[str, float]) -> dict[str, float]:
    return {
        "slope": math.hypot(values["uphill_cosine"], values["uphill_sine"]),
        "uphill_heading": math.atan2(values["uphill_sine"], values["uphill_cosine"]),
    }


def _from_baseline(given: Mapping[str, float]) -> dict[str, float]:
    slope, uphill = given.get("slope", 0.0), given.get("uphill_heading", 0.0)
    return {"uphill_cosine": slope * math.cos(uphill), "uphill_sine": slope * math.sin(uphill)}


def _exercised(data: SetData) -> float:
    if data.heading_rad is None:
        return 0.0
    fast = np.abs(data.speed_mps).max(axis=1) > 0.02 * data.top_mps
    if not fast.any():
        return 0.0
    # Headings spread over the circle: the resultant of unit vectors is short.
    vector = np.exp(1j * data.heading_rad[fast])
    return float(2.0 * (1.0 - abs(vector.mean())))


EFFECT = Effect(
    name="floor_slope",
    title="the floor slopes",
    equation="dv/dt - g sin(slope) cos(heading - uphill heading)",
    source="Wong, Theory of Ground Vehicles, section 3.1",
    signature="the same efforts give less speed on one heading and more on the opposite one",
    separated_by={
        "direction_asymmetry": "the same path after a half turn",
        "supply_sag": "the same path after a half turn",
    },
    excited_by=(
        "Drive the same path on headings all around the circle, there and back or in four directions, "
        "with the heading in the log."
    ),
    parameters=(
        Parameter("uphill_cosine", "rad", -0.4, 0.4, 0.0, (0.01, -0.01)),
        Parameter("uphill_sine", "rad", -0.4, 0.4, 0.0, (0.01, -0.01)),
    ),
    needs=("heading",),
    report=_report,
    from_baseline=_from_baseline,
    units={"slope": "rad", "uphill_heading": "rad"},
    non_negative=("slope",),
    exercised=_exercised,
    step_share=0.08,
)
