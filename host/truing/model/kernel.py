"""The compiled rollout of one wheel: delay, dry friction that sticks exactly, exponential steps.

The equation, in effort units, for a wheel that turns in direction s = sign(v):

    tau_s dv/dt = gain_s (u(t - delay) + offset - s F_s(|v|)) - v
    u           = sign(e) max(|e| - deadband, 0) of the effort e
    F_s(|v|)    = friction_s + excess_s exp(-(|v| / stribeck_mps)^shape) + drag |v|^2

At rest the wheel stays exactly at rest while |u + offset| <= friction_s + excess_s. The input is
constant between its own (delayed) changes, so with constant friction every piece is solved in closed
form, reversals and stops included: the result does not depend on a step size, and it is a smooth
function of the delay between samples. Where friction depends on speed, pieces are cut to `max_step_s`
and friction is linearised in each (the exponential Rosenbrock-Euler method, second order).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.model.compiled import cached, part

# Layout of the kernel's parameter vector.
GAIN_FORWARD, GAIN_REVERSE = 0, 1  # m/s per unit effort
TAU_FORWARD, TAU_REVERSE = 2, 3  # s
FRICTION_FORWARD, FRICTION_REVERSE = 4, 5  # effort
EXCESS_FORWARD, EXCESS_REVERSE = 6, 7  # effort: breakaway above running friction
STRIBECK_MPS = 8  # 0: the excess acts at rest only
STRIBECK_SHAPE = 9  # 1 or 2
DRAG = 10  # effort per (m/s)^2
OFFSET = 11  # effort
DELAY_S = 12
RECORDER_LAG_S = 13  # first-order filter of the reported speed
RECORDER_WINDOW_S = 14  # the reported speed is a mean over this long; 0: see `mean_over_interval`
SUPPLY_SHARE = 15  # how much of the relative change of the supply acts on the wheel
LAG_S = 16  # first-order lag ahead of the motor (driver filter, winding)
DEADBAND = 17  # effort below which the driver gives nothing, and which it takes off above
PARAMETER_COUNT = 18

# The wheel's state.
STATE = np.dtype([
    ("speed", float),  # m/s
    ("travel", float),  # m, since the segment's first row
    ("filtered", float),  # m/s, the speed through the recorder's filter
    ("drive", float),  # effort, behind the lag
])  # fmt: skip

_TINY = 1e-12
_MAX_PIECES = 1_000_000


class Inputs(NamedTuple):
    """Segments laid end to end, n rows in all, and their m pieces of constant input.

    Attributes
    ----------
    t : shape (n,), s, increasing inside a segment.
    starts : shape (segments + 1,), first row of each segment, and n.
    piece_end : shape (m,), s, where each piece ends, before delay.
    piece_effort : shape (m,).
    piece_supply : shape (m,), relative deviation of the supply from nominal (0 when not measured).
    piece_starts : shape (segments + 1,), first piece of each segment, and m.
    interval : shape (segments,), s, the usual time between rows.
    initial : shape (segments,), m/s, speed at the first row of each segment.
    """

    t: FloatArray
    starts: IntArray
    piece_end: FloatArray
    piece_effort: FloatArray
    piece_supply: FloatArray
    piece_starts: IntArray
    interval: FloatArray
    initial: FloatArray


class Outputs(NamedTuple):
    """What a simulation writes and works in.

    Attributes
    ----------
    speed : shape (n,), m/s, the speed as the recorder would report it.
    travel : shape (n,), m, true travel since the segment's first row.
    filtered : shape (n,), m/s, the speed through the recorder's filter.
    state : shape (1,) of STATE.
    """

    speed: FloatArray
    travel: FloatArray
    filtered: FloatArray
    state: Any


def new_outputs(rows: int) -> Outputs:
    """Outputs for segments of this many rows in all."""
    return Outputs(np.empty(rows), np.empty(rows), np.empty(rows), np.zeros(1, STATE))


@cached
def rollout(
    p: FloatArray, inputs: Inputs, outputs: Outputs, mean_over_interval: bool, max_step: float
) -> None:
    """Free-run simulation of segments.

    Parameters
    ----------
    p : shape (PARAMETER_COUNT,).
    mean_over_interval : speed as the mean since the last row, else at the row's instant.
    """
    for segment in range(inputs.starts.shape[0] - 1):
        first, last = inputs.starts[segment], inputs.starts[segment + 1]
        _simulate(p, inputs, outputs, segment, max_step)
        if p[RECORDER_WINDOW_S] > 0.0:
            _report_window(p, inputs.t, outputs, first, last)
        elif mean_over_interval:
            _report_mean(p, inputs.t, outputs, first, last)
        else:
            for k in range(first, last):
                outputs.speed[k] = outputs.filtered[k]


@part
def _simulate(p: FloatArray, inputs: Inputs, outputs: Outputs, segment: int, max_step: float) -> None:
    """Filtered speed and travel at every row of a segment."""
    t, delay, state = inputs.t, p[DELAY_S], outputs.state[0]
    first, v0 = inputs.starts[segment], inputs.initial[segment]
    state.speed = v0
    state.travel = 0.0
    state.filtered = v0
    # The first row tells the input of the usual interval before it. What came earlier is unknown,
    # so the wheel keeps its initial speed until the first known input arrives.
    j = inputs.piece_starts[segment]
    last_piece = inputs.piece_starts[segment + 1] - 1
    arrival = t[first] - inputs.interval[segment] + delay
    state.drive = _drive(p, inputs, j)
    outputs.filtered[first] = v0
    outputs.travel[first] = 0.0
    now = t[first]
    for k in range(first + 1, inputs.starts[segment + 1]):
        while now < t[k]:
            if now < arrival:
                until = min(arrival, t[k])
                state.travel += v0 * (until - now)
                now = until
                continue
            while j < last_piece and inputs.piece_end[j] + delay <= now:
                j += 1
            until = t[k]
            if j < last_piece and inputs.piece_end[j] + delay < until:
                until = inputs.piece_end[j] + delay
            _advance(p, state, _drive(p, inputs, j), until - now, max_step)
            now = until
        outputs.filtered[k] = state.filtered
        outputs.travel[k] = state.travel


@part
def _drive(p: FloatArray, inputs: Inputs, j: int) -> float:
    """Effort of a piece, with the supply's deviation and the offset."""
    u = inputs.piece_effort[j]
    if p[DEADBAND] > 0.0:
        u = math.copysign(max(abs(u) - p[DEADBAND], 0.0), u)
    u *= 1.0 + p[SUPPLY_SHARE] * inputs.piece_supply[j]
    return float(u + p[OFFSET])


@part
def _advance(p: FloatArray, state: Any, drive: float, h_total: float, max_step: float) -> None:
    """Advance the state by `h_total` under a constant drive."""
    speed_dependent = p[DRAG] != 0.0 or (
        p[STRIBECK_MPS] > 0.0 and (p[EXCESS_FORWARD] != 0.0 or p[EXCESS_REVERSE] != 0.0)
    )
    lag = p[LAG_S]
    left = h_total
    for _ in range(_MAX_PIECES):
        if left <= _TINY:
            break
        h = left
        if (speed_dependent or lag > 0.0) and h > max_step:
            h = max_step
        now = drive
        if lag > 0.0:
            # The lagged drive over this piece is represented by its mean: second order in the step.
            now = drive + (state.drive - drive) * (decay_integral(1.0 / lag, h) / h)
        v = state.speed
        s = math.copysign(1.0, v) if v != 0.0 else (1.0 if now >= 0.0 else -1.0)
        rate, level = _motion(p, v, s, now, speed_dependent)
        # One exponential is enough for a piece: exp(-rate h) is 1 - rate decay.
        decay = decay_integral(rate, h)
        v_end = v + (level - rate * v) * decay
        if v != 0.0 and v_end * s <= 0.0:
            h = _until_stop(v, rate, level, h)
            decay = decay_integral(rate, h)
            v_end = v + (level - rate * v) * decay
        _take_over(p, state, s, rate, level, h, decay, v_end)
        if lag > 0.0:
            state.drive = drive + (state.drive - drive) * math.exp(-h / lag)
        left -= h


@part
def _motion(p: FloatArray, v: float, s: float, drive: float, speed_dependent: bool) -> tuple[float, float]:
    """Rate and level of dv/dt = level - rate v in direction s, friction linearised at the speed v."""
    side = 0 if s > 0.0 else 1
    gain, tau = p[GAIN_FORWARD + side], p[TAU_FORWARD + side]
    friction, excess = p[FRICTION_FORWARD + side], p[EXCESS_FORWARD + side]
    if v == 0.0 and abs(drive) <= friction + excess:
        return 0.0, 0.0  # stuck: v stays exactly zero
    slope = 0.0
    if speed_dependent:
        speed = abs(v)
        if p[STRIBECK_MPS] > 0.0 and excess != 0.0:
            z = speed / p[STRIBECK_MPS]
            if p[STRIBECK_SHAPE] != 1.0:
                z = z ** p[STRIBECK_SHAPE]
            part = excess * math.exp(-z)
            friction += part
            if speed > 0.0:
                slope -= part * p[STRIBECK_SHAPE] * z / speed
            elif p[STRIBECK_SHAPE] == 1.0:
                slope -= part / p[STRIBECK_MPS]
        friction += p[DRAG] * speed * speed
        slope += 2.0 * p[DRAG] * speed
    return (1.0 + gain * slope) / tau, gain * (drive - s * friction + slope * v) / tau


@part
def _until_stop(v: float, rate: float, level: float, h: float) -> float:
    """When a wheel that would turn round within `h` stops, s: a piece ends there."""
    if abs(rate * v) < 1e-9 * abs(level):
        stop = -v / level
    else:
        stop = math.log1p(-rate * v / level) / rate
    return stop if 0.0 <= stop < h else h


@part
def _take_over(
    p: FloatArray, state: Any, s: float, rate: float, level: float, h: float, decay: float, v_end: float
) -> None:
    """Take over speed, travel and filtered speed after `h`, with `decay` its integral."""
    v = state.speed
    stopped = v != 0.0 and v_end * s <= 1e-15
    if abs(rate * h) < 1e-6:
        state.travel += v * h + (level - rate * v) * 0.5 * h * h
    else:
        state.travel += level / rate * h + (v - level / rate) * decay
    state.speed = 0.0 if stopped else v_end
    if p[RECORDER_LAG_S] > 0.0:
        state.filtered = _filtered(state.filtered, p[RECORDER_LAG_S], v, rate, level, h, decay)
    else:
        state.filtered = state.speed


@part
def _filtered(
    y: float, filter_s: float, v: float, rate: float, level: float, h: float, decay: float
) -> float:
    """Solve dy/dt = (v - y) / filter_s, with v a constant and a decaying part."""
    fast = 1.0 / filter_s
    fall = math.exp(-fast * h)
    if abs(rate) < 1e-9:
        # v = v0 + level t
        return y * fall + v * (1.0 - fall) + level * (h - filter_s * (1.0 - fall))
    steady = level / rate
    difference = fast - rate
    if abs(difference * h) < 1e-7:
        mixed = fast * h * fall
    else:
        mixed = fast * (1.0 - rate * decay - fall) / difference
    return y * fall + steady * (1.0 - fall) + (v - steady) * mixed


@part
def _report_window(p: FloatArray, t: FloatArray, outputs: Outputs, first: int, last: int) -> None:
    """Mean of the filtered speed over a window; its integral is travel - lag (y - y0)."""
    lag, window = p[RECORDER_LAG_S], p[RECORDER_WINDOW_S]
    filtered, travel = outputs.filtered, outputs.travel
    y0 = filtered[first]
    m = first
    for k in range(first, last):
        back = t[k] - window
        reported = travel[k] - lag * (filtered[k] - y0)
        if back <= t[first]:
            before = y0 * (back - t[first])
        else:
            while t[m + 1] < back:
                m += 1
            h = t[m + 1] - t[m]
            z = (back - t[m]) / h
            a = travel[m] - lag * (filtered[m] - y0)
            b = travel[m + 1] - lag * (filtered[m + 1] - y0)
            before = (
                (1.0 + 2.0 * z) * (1.0 - z) ** 2 * a
                + z * (1.0 - z) ** 2 * h * filtered[m]
                + z * z * (3.0 - 2.0 * z) * b
                + z * z * (z - 1.0) * h * filtered[m + 1]
            )
        outputs.speed[k] = (reported - before) / window


@part
def _report_mean(p: FloatArray, t: FloatArray, outputs: Outputs, first: int, last: int) -> None:
    """Mean of the filtered speed since the last row."""
    filtered, travel, out = outputs.filtered, outputs.travel, outputs.speed
    out[first] = filtered[first]
    for k in range(first + 1, last):
        h = t[k] - t[k - 1]
        if h > 0.0:
            out[k] = (travel[k] - travel[k - 1] - p[RECORDER_LAG_S] * (filtered[k] - filtered[k - 1])) / h
        else:
            out[k] = out[k - 1]


@part
def decay_integral(rate: float, h: float) -> float:
    """(1 - exp(-rate h)) / rate, s, well-behaved for a rate near zero or below it."""
    z = rate * h
    if abs(z) < 1e-9:
        return h * (1.0 - 0.5 * z)
    return -math.expm1(-z) / rate
