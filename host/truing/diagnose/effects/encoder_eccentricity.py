"""An eccentric encoder: a measuring error periodic in the wheel's angle, once per revolution.

    measured angle = true angle + a sin φ + b cos φ,   φ the measured angle

A disc that runs off its centre by e reads an angle wrong by e over the track's radius, as a sine of the
angle (Doebelin, Measurement Systems, section 4.3 on digital transducers). Phase comes from the counts
themselves.

In data: the speed oscillates once per turn by an amount that grows with the speed; the robot's true motion
does not.

Confused with: torque ripple of N = 1, whose amplitude falls with speed while this one grows. The same
distance at several speeds separates them. `per_run` is 1 where every run begins at the same wheel angle,
and 0 where the wheel stays as the last run left it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter
from truing.model.compiled import part


def measure(
    increment: float,
    own_sine: float,
    own_cosine: float,
    per_run: float,
    angle: float,
    angle_before: float,
    origin: float,
    radius: float,
) -> float:
    """Reported travel of a row: the true one and the change of the error."""
    here, before = angle - per_run * origin, angle_before - per_run * origin
    return increment + radius * _change(own_sine, own_cosine, here, before)


def ground(
    increment: float,
    own_sine: float,
    own_cosine: float,
    per_run: float,
    angle: float,
    angle_before: float,
    origin: float,
    radius: float,
) -> float:
    """The wheel's true travel from the measured one."""
    here, before = angle - per_run * origin, angle_before - per_run * origin
    return increment - radius * _change(own_sine, own_cosine, here, before)


@part
def _change(sine: float, cosine: float, angle: float, angle_before: float) -> float:
    """Change of the angle's error over a row, rad."""
    error = sine * (math.sin(angle) - math.sin(angle_before))
    return error + cosine * (math.cos(angle) - math.cos(angle_before))


def _report(values: Mapping[str, float]) -> dict[str, float]:
    return {
        "amplitude_left": math.hypot(values["sine_left"], values["cosine_left"]),
        "amplitude_right": math.hypot(values["sine_right"], values["cosine_right"]),
    }


def _from_baseline(given: Mapping[str, float]) -> dict[str, float]:
    return {f"sine_{side}": given.get(f"amplitude_{side}", 0.0) for side in ("left", "right")}


def _exercised(data: SetData) -> float:
    if data.angle_rad is None:
        return 0.0
    turned = np.zeros(len(data))
    turned[1:] = np.abs(np.diff(data.angle_rad, axis=0)).max(axis=1)
    turned[data.first] = 0.0
    turned[turned > 2.0] = 0.0  # more than a third of a turn per sample: the error is averaged out
    return exercise.enough(float(turned.sum()) / (2.0 * math.pi), 4.0)


EFFECT = Effect(
    name="encoder_eccentricity",
    title="an eccentric encoder",
    equation="measured angle = true angle + a sin φ + b cos φ",
    source="Doebelin, Measurement Systems, section 4.3",
    signature="the speed oscillates once per turn of the wheel, the more the faster it turns",
    separated_by={
        "torque_ripple": "the same distance at several speeds: eccentricity grows with speed, ripple falls",
        "gear_backlash": "creep in one direction, without reversals",
    },
    excited_by=(
        "Turn each wheel steadily through four or more turns, slowly enough for several rows in every turn."
    ),
    parameters=(
        Parameter("sine_left", "rad", -1.0, 1.0, 0.0, (0.02, -0.02), "left"),
        Parameter("sine_right", "rad", -1.0, 1.0, 0.0, (0.02, -0.02), "right"),
        Parameter("cosine_left", "rad", -1.0, 1.0, 0.0, (0.02, -0.02), "left"),
        Parameter("cosine_right", "rad", -1.0, 1.0, 0.0, (0.02, -0.02), "right"),
        Parameter("per_run", "1", 0.0, 1.0, 0.0, (0.0, 1.0), nuisance=True, scan=True, fixed=True),
    ),
    needs=("angle",),
    report=_report,
    from_baseline=_from_baseline,
    units={"amplitude_left": "rad", "amplitude_right": "rad"},
    non_negative=("amplitude_left", "amplitude_right"),
    exercised=_exercised,
)
