"""The winding warms under load: its resistance rises, and the robot gets slower over minutes.

    T_th dθ/dt = i^2 - θ,   g(t) = g (1 - d x),   x = θ / largest θ of the set

The first-order thermal circuit of a motor (Hughes and Drury, Electric Motors and Drives, section 1.7; IEC
60034-1 duty S3): copper loss i^2 R heats one capacity that loses its heat through one resistance. A warmer
winding gives less torque for a voltage, so that every load costs more speed; the catalogue reports the
loss of gain, `gain_drop`, from the first sample to the warmest. The time constant may rise with the
resistance too (a motor whose losses are mostly outside the winding keeps its gain and gets slower instead):
`slowing` is that rise per loss of gain, a nuisance.

In data: the same level gives less speed the later it comes in a busy stretch, and recovers after a rest;
each wheel by its own load.

Confused with: discharge of the battery (85 to 93 %): only a rest distinguishes them: heat recovers and charge
does not. Load, rest, repeat; or log the voltage.
"""

from __future__ import annotations

import math

from truing.arrays import FloatArray
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter


def slow(
    thermal_time_constant: float, dt: FloatArray, heat: FloatArray, elapsed: FloatArray, out: FloatArray
) -> None:
    """Temperature rise at each row over the largest of the set, by wheel."""
    largest = 0.0
    for wheel in range(2):
        warmth = 0.0
        for row in range(len(dt)):
            span = elapsed[row] - elapsed[row - 1] if row > 0 else 0.0
            if span > 1.5 * dt[row]:  # a pause: no load, and heat leaves
                warmth *= math.exp(-(span - dt[row]) / thermal_time_constant)
            keep = math.exp(-dt[row] / thermal_time_constant)
            warmth = warmth * keep + heat[row, wheel] * (1.0 - keep)
            out[row, wheel] = warmth
            largest = max(largest, warmth)
    for row in range(len(dt)):
        for wheel in range(2):
            out[row, wheel] = out[row, wheel] / largest if largest > 0.0 else 0.0


def gain(gain_drop: float, slow: float) -> float:
    """Factor on the steady speed per effort."""
    return 1.0 - gain_drop * slow


def inertia(gain_drop: float, slowing: float, slow: float) -> float:
    """Factor on the time constant."""
    return 1.0 + slowing * gain_drop * slow


def _exercised(data: SetData) -> float:
    return data.duration_s / 60.0


EFFECT = Effect(
    name="winding_heating",
    title="the motor's winding warms up",
    equation="T_th dθ/dt = i^2 - θ; gain falls by d θ / θ_max",
    source="Hughes and Drury, Electric Motors and Drives, section 1.7",
    signature="a level gives less speed the later it comes in a busy stretch, and recovers after a rest",
    separated_by={
        "supply_sag": "load, rest, repeat: heat recovers, charge does not; or the logged voltage",
        "payload_change": "load, rest, repeat",
    },
    excited_by="Drive under heavy load for a minute or more, rest, and repeat the same levels.",
    parameters=(
        Parameter("gain_drop", "1", 0.0, 0.6, 0.0, (0.05, 0.15)),
        Parameter("thermal_time_constant", "s", 5.0, 2000.0, 60.0, (20.0, 60.0, 200.0), log=True, scan=True),
        Parameter("slowing", "1", -1.0, 5.0, 0.0, (0.0,), nuisance=True),
    ),
    exercised=_exercised,
)
