"""The effective wheelbase differs from the baseline's.

    heading change = (right travel - left travel) / (factor * wheelbase)

The second systematic error of odometry in Borenstein and Feng (1996, "Measurement and correction of
systematic odometry errors in mobile robots", IEEE Trans. Robotics and Automation 12, section II): tyres
touch the floor over an area, and where in it they turn differs from the geometric wheelbase.

In data: every turn is off by the same share, left and right alike; straight runs are right.

Confused with: wheel radius error of both wheels together (which also scales straight runs). Turns on
the spot and a straight run of known length separate them.
"""

from __future__ import annotations

import numpy as np

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter


def turning(turn: float, factor: float) -> float:
    """Heading change over a row."""
    return turn / factor


def _exercised(data: SetData) -> float:
    base = data.baseline.wheelbase_m
    if base is None or not data.has_pose:
        return 0.0
    difference = np.abs(data.speed_mps[:, 1] - data.speed_mps[:, 0]) * data.dt_s / base
    return exercise.enough(float(difference[data.judged].sum()), 6.0)


EFFECT = Effect(
    name="wheelbase_error",
    title="the effective wheelbase differs",
    equation="heading change = (right - left) / (factor * wheelbase)",
    source="Borenstein and Feng 1996, IEEE Trans. Robotics and Automation 12, section II",
    signature="every turn is off by the same share; straight runs are right",
    separated_by={
        "wheel_radius_error": "turns on the spot and a straight run of known length",
        "heading_drift": "turns on the spot: drift needs distance",
    },
    excited_by=(
        "Turn through six radians or more, on the spot both ways, with a pose from outside the robot and "
        "a measured wheelbase."
    ),
    parameters=(Parameter("factor", "1", 0.5, 2.0, 1.0, (1.05, 0.95)),),
    domain="pose",
    needs=("pose", "geometry"),
    exercised=_exercised,
)
