"""The recorded speed lags the encoder's own counts: a filter in the recorder.

    L dy/dt = v - y;  the row holds y at its time, or the mean of y over its interval

The robot is as in the baseline; the *signal* differs. Motor controllers average their speed over 50 to
200 ms (measured on real recordings: 60 ms on one family, 160 to 200 ms on another); a first-order lag
stands for it. Only where the judged speed is a recorder's own column can this be: counts and positions
have no filter. Where positions are logged as well, `direct_lag` compares the two without any model of the
robot.

In data: the reported speed sets off late and with a rounded corner, on the way up and down alike, also
when the robot is pushed.

Confused with: driver lag (the same curve) and delay; positions beside the speeds, or a hand-pushed
run, distinguish them.

Each motor controller filters its own wheel's speed: `difference` is the right filter's time constant less the
left one's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeGuard

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter
from truing.model.compiled import compiled

# Speeds lag positions when the lag leaves less than this share of their difference.
CLEARLY = 0.6
# Neighbouring rows are correlated: as many rows count as one independent sample.
ROWS_PER_SAMPLE = 10.0


def after_step(
    state: float,
    wheel: int,
    h: float,
    speed_start: float,
    speed_end: float,
    travel: float,
    time_constant: float,
    difference: float,
) -> float:
    """The filter's output after a substep, the speed a parabola with these ends and this travel."""
    own = time_constant + (wheel - 0.5) * difference
    if own < 1e-6:
        return speed_end
    bend = 6.0 * (0.5 * (speed_start + speed_end) - travel / h) / h
    first = (speed_end - speed_start) / h - bend
    share = own / h
    ramp = own * first
    curve = 2.0 * own * bend
    start = speed_start - ramp + curve * share
    end = speed_end - ramp + curve * (share - 1.0)
    return end + (state - start) * math.exp(-1.0 / share)


def measure(
    increment: float,
    wheel: int,
    state: float,
    state_before: float,
    time_constant: float,
    difference: float,
    instant: float,
    dt: float,
) -> float:
    """The filter's output, read at the row's time or integrated over the row."""
    if instant > 0.5:
        return state * dt
    return increment - max(time_constant + (wheel - 0.5) * difference, 0.0) * (state - state_before)


@dataclass(frozen=True, slots=True)
class DirectLag:
    """Recorded speed against differenced positions, no robot model between them.

    Attributes
    ----------
    time_constant_s : the lag that fits best.
    rms_mps : difference left with it; `rms_without_mps` without any lag.
    """

    time_constant_s: float
    rms_mps: float
    rms_without_mps: float


def direct_lag(data: SetData) -> DirectLag | None:
    """The recorder's lag from a set that holds both its speeds and counts or positions, else None."""
    reported, positions = data.recorded_vel_mps, data.position_speed_mps
    if reported is None or positions is None:
        return None

    def rms(lag: float) -> float:
        return min(left(filtered) for filtered in _filtered(positions, data, lag))

    def left(filtered: FloatArray) -> float:
        difference = (reported - filtered)[data.judged]
        # Recorders repeat and reset positions: a robust estimate, against these outliers.
        return float(1.4826 * np.median(np.abs(difference[np.abs(positions[data.judged]) > 0.0])))

    if not np.any(positions[data.judged]):
        return None
    lags = np.concatenate(([0.0], np.geomspace(0.004, 0.6, 60)))
    sizes = [rms(float(lag)) for lag in lags]
    best = int(np.argmin(sizes))
    return DirectLag(float(lags[best]), sizes[best], sizes[0])


def _filtered(speed: FloatArray, data: SetData, lag: float) -> tuple[FloatArray, FloatArray]:
    """Mean speeds of the rows (n, 2) through the filter: means of its output, and its output at each row."""
    if lag <= 0.0:
        return speed, speed
    mean, instant = np.empty_like(speed), np.empty_like(speed)
    _filter_rows(speed, data.dt_s, data.starts, lag, mean, instant)
    return mean, instant


@compiled
def _filter_rows(
    speed: FloatArray, dt_s: FloatArray, starts: IntArray, lag: float, mean: FloatArray, instant: FloatArray
) -> None:
    for segment in range(len(starts) - 1):
        for wheel in range(2):
            y = speed[starts[segment], wheel]
            mean[starts[segment], wheel] = instant[starts[segment], wheel] = y
            for row in range(starts[segment] + 1, starts[segment + 1]):
                after = speed[row, wheel] + (y - speed[row, wheel]) * math.exp(-dt_s[row] / lag)
                mean[row, wheel] = speed[row, wheel] - lag * (after - y) / dt_s[row]
                y = after
                instant[row, wheel] = y


def lag_is_significant(data: SetData) -> bool:
    """Whether the recorder's speeds lag its own counts or positions significantly."""
    return _is_significant(direct_lag(data))


def _is_significant(lag: DirectLag | None) -> TypeGuard[DirectLag]:
    return lag is not None and lag.time_constant_s > 0.0 and lag.rms_mps < CLEARLY * lag.rms_without_mps


def _evidence(data: SetData) -> float:
    lag = direct_lag(data)
    if not _is_significant(lag):
        return 0.0
    moving = np.count_nonzero(data.judged) / ROWS_PER_SAMPLE
    return float(moving * math.log(lag.rms_without_mps / max(lag.rms_mps, 1e-3 * lag.rms_without_mps)))


def _exercised(data: SetData) -> float:
    return exercise.enough(exercise.effort_steps(data), 4.0)


EFFECT = Effect(
    name="speed_filter",
    title="a filter in the recorder's speed",
    equation="L dy/dt = v - y",
    source="measured on real drivetrain recordings: reported speed lags differenced position by 60-200 ms",
    signature="reported speed sets off late with a rounded corner, up and down alike",
    separated_by={
        "driver_lag": "a log with counts beside the recorder's speed, or a hand-pushed run",
        "input_delay": "a log with counts beside the recorder's speed",
    },
    excited_by=(
        "Give four or more steps of effort, and log encoder counts or positions beside the recorder's own "
        "speed."
    ),
    parameters=(
        Parameter("time_constant", "s", 0.0, 1.0, 0.0, (0.03, 0.1)),
        Parameter("difference", "s", -1.0, 1.0, 0.0, (0.02,), pull=0.006, plain=True),
        Parameter("instant", "1", 0.0, 1.0, 0.0, (1.0, 0.0), nuisance=True, scan=True),
    ),
    needs=("vel",),
    exercised=_exercised,
    evidence=_evidence,
    step_share=0.1,
)
