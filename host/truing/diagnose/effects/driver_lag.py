"""A second lag ahead of the motor: a filter in the driver, or the winding's inductance.

    L du/dt = command - u,    T dv/dt = g u - v

With the inductance this is the classical second-order motor, L = inductance over resistance (Franklin,
Powell and Emami-Naeini, Feedback Control of Dynamic Systems, section 2.3); a driver that ramps or filters
its duty cycle does the same with a longer time.

In data: speed sets off with a rounded corner; the error after a step rises and falls within a few L.

Confused with: a pure delay, which shifts the corner instead of rounding it; the recorder's speed
filter, which is the same curve once more but leaves counts alone; a longer time constant. A chirp up to a
few hertz or a step logged at 100 to 200 Hz separates it from a delay.
"""

from __future__ import annotations

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter


def lag(time_constant: float) -> float:
    """Time constant between the driver's command and the motor, s."""
    return time_constant


def _exercised(data: SetData) -> float:
    return exercise.enough(exercise.effort_steps(data), 6.0)


EFFECT = Effect(
    name="driver_lag",
    title="a second lag ahead of the motor",
    equation="L du/dt = command - u",
    source="Franklin, Powell and Emami-Naeini, Feedback Control of Dynamic Systems, section 2.3",
    signature="rounded corners: the error after every step rises and falls within a few lags",
    separated_by={
        "input_delay": "a chirp to 4-8 Hz, or a step logged at 100-200 Hz",
        "speed_filter": "a log with counts beside the recorder's speed",
    },
    excited_by=(
        "Give six or more steps of effort of at least 10 %, or a chirp up to a few hertz, and log at 100 "
        "Hz or more."
    ),
    parameters=(Parameter("time_constant", "s", 0.0, 1.0, 0.0, (0.03, 0.1)),),
    exercised=_exercised,
    step_share=0.02,
    exact=True,
)
