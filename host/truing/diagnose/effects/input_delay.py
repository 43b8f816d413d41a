"""A pure delay between command and torque.

    u(t) = command(t - D)

Transport over buses, filters with linear phase and the hold of a controller all end up here (Åström and
Murray, Feedback Systems, second edition, section 9.2). The kernel moves the input's edges, so that the
result is a smooth function of D between the log's samples.

In data: the first sample after a step shows too little motion and the curve then runs parallel; the error
is a spike at every change of effort, of the same sign as the change, and nothing in between.

Confused with: a driver's lag, which rounds the corner instead of moving it (87 to 90 % shared at 20
Hz); a recorder's filter; backlash, whose spike appears on reversals alone. From encoders and efforts
alone an actuator's delay and a measuring delay are one thing. A chirp up to a few hertz, or one step
logged at 100 Hz or more, separates delay from lag.

Two motor controllers on a bus are asked one after the other: `difference` is how much later the right wheel's
command arrives, or its speed is read, than the left one's.
"""

from __future__ import annotations

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter


def delay(wheel: int, delay: float, difference: float) -> float:
    """How late the wheel's command arrives, s."""
    return max(delay + (wheel - 0.5) * difference, 0.0)


def _exercised(data: SetData) -> float:
    return exercise.enough(exercise.effort_steps(data), 6.0)


EFFECT = Effect(
    name="input_delay",
    title="a delay between command and torque",
    equation="u(t) = command(t - D)",
    source="Åström and Murray, Feedback Systems, section 9.2",
    signature="a spike of error at every change of effort, the curve shifted in time",
    separated_by={
        "driver_lag": "a chirp to 4-8 Hz, or a step logged at 100-200 Hz",
        "speed_filter": "a log with counts beside the recorder's speed",
        "gear_backlash": "a reversal step against a step in the same direction",
    },
    excited_by="Give six or more steps of effort of at least 10 %, and log at 100 Hz or more.",
    parameters=(
        Parameter("delay", "s", 0.0, 0.4, 0.0, (0.02, 0.06, 0.12), scan=True),
        Parameter("difference", "s", -0.4, 0.4, 0.0, (0.01,), pull=0.006, plain=True),
    ),
    exercised=_exercised,
)
