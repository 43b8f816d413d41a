"""At zero effort the driver floats: the wheel coasts instead of braking.

    dv/dt = -v / T_coast at zero effort, the baseline otherwise; friction keeps its force

With the bridge open no current flows and back-EMF cannot brake; what is left is the viscous loss of
bearings and grease, and with it a longer time constant (Hughes and Drury, Electric Motors and Drives,
section 3.6).

In data: every stop takes longer than a start; only rows with exactly zero effort are off, and a small
effort of either sign behaves as in the baseline.

Confused with: dry friction with the wrong sign (the stop is too long rather than too short), a filter
in the recorder. Stops by zero effort against stops by a small effort separate it.
"""

from __future__ import annotations

from collections.abc import Mapping

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter

# Efforts below half a step of the log's resolution are zero.
ZERO_EFFORT = 5e-5


def gain(release: float, command: float) -> float:
    """Keeps acceleration per effort, and with it the force of friction, as it was."""
    return 1.0 / (1.0 - release) if abs(command) <= ZERO_EFFORT else 1.0


def inertia(release: float, command: float) -> float:
    """Factor on the time constant: coasting over braking."""
    return 1.0 / (1.0 - release) if abs(command) <= ZERO_EFFORT else 1.0


def _mean_tau(values: Mapping[str, float]) -> float:
    return 0.5 * (values["tau_left"] + values["tau_right"])


def _report(values: Mapping[str, float]) -> dict[str, float]:
    return {"time_constant": _mean_tau(values) / (1.0 - values["release"])}


def _from_baseline(given: Mapping[str, float]) -> dict[str, float]:
    if "time_constant" not in given:
        return {}
    return {"release": 1.0 - _mean_tau(given) / given["time_constant"]}


def _exercised(data: SetData) -> float:
    coasting = exercise.moving(data) & (abs(data.effort) <= ZERO_EFFORT)
    return exercise.enough(exercise.seconds(data, coasting), 2.0 * exercise.time_constant_s(data))


EFFECT = Effect(
    name="coast_decay",
    title="the wheel coasts at zero effort instead of braking",
    equation="dv/dt = -v / T_coast at zero effort",
    source="Hughes and Drury, Electric Motors and Drives, section 3.6",
    signature="every stop by zero effort takes longer than in the baseline; the rest is right",
    separated_by={
        "coulomb_friction": "stops by zero effort and by a small effort of the other sign",
        "driver_lag": "steps up and steps down to a level that is not zero",
    },
    excited_by=(
        "Drive to several speeds and give exactly zero effort for at least two time constants each time, "
        "until standstill."
    ),
    parameters=(Parameter("release", "1", -2.0, 0.97, 0.0, (0.25, 0.6)),),
    report=_report,
    from_baseline=_from_baseline,
    units={"time_constant": "s"},
    non_negative=("time_constant",),
    exercised=_exercised,
)
