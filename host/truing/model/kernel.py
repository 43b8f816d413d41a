"""The compiled rollout of one wheel: delay, dry friction that sticks exactly, exponential steps.

The equation, in effort units, for a wheel that turns in direction s = sign(v):

    tau_s dv/dt = gain_s (u(t - delay) + offset - s F_s(|v|)) - v
    F_s(|v|)    = friction_s + excess_s exp(-(|v| / stribeck_mps)^shape) + drag |v|^2

At rest the wheel stays exactly at rest while |u + offset| <= friction_s + excess_s. The input is
constant between its own (delayed) changes, so with constant friction every piece is solved in closed
form, reversals and stops included: the result does not depend on a step size, and it is a smooth
function of the delay between samples. Where friction depends on speed, pieces are cut to `max_step_s`
and friction is linearised in each (the exponential Rosenbrock-Euler method, second order).
"""

from __future__ import annotations

import math

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.model.compiled import compiled
from truing.model.decay import decay_integral

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
PARAMETER_COUNT = 17

_TINY = 1e-12


@compiled
def _advance(p: FloatArray, state: FloatArray, drive: float, h_total: float, max_step: float) -> None:
    """Advance speed, travel and filtered speed (state 0, 1, 2) by `h_total` under a constant drive."""
    left = h_total
    speed_dependent = p[DRAG] != 0.0 or (
        p[STRIBECK_MPS] > 0.0 and (p[EXCESS_FORWARD] != 0.0 or p[EXCESS_REVERSE] != 0.0)
    )
    filter_s = p[RECORDER_LAG_S]
    lag = p[LAG_S]
    guard = 0
    while left > _TINY and guard < 1_000_000:
        guard += 1
        v = state[0]
        h = left
        if speed_dependent and h > max_step:
            h = max_step
        if lag > 0.0 and h > max_step:
            h = max_step
        now = drive
        if lag > 0.0:
            # The lagged drive over this piece is represented by its mean: second order in the step.
            share = decay_integral(1.0 / lag, h) / h
            now = drive + (state[3] - drive) * share
        if v > 0.0:
            s = 1.0
        elif v < 0.0:
            s = -1.0
        else:
            s = 1.0 if now >= 0.0 else -1.0
        side = 0 if s > 0.0 else 1
        gain = p[GAIN_FORWARD + side]
        tau = p[TAU_FORWARD + side]
        friction = p[FRICTION_FORWARD + side]
        excess = p[EXCESS_FORWARD + side]

        if v == 0.0 and abs(now) <= friction + excess:
            rate, level = 0.0, 0.0  # stuck: v stays exactly zero
        else:
            slope = 0.0
            if speed_dependent:
                speed = abs(v)
                if p[STRIBECK_MPS] > 0.0 and excess != 0.0:
                    z = (speed / p[STRIBECK_MPS]) ** p[STRIBECK_SHAPE]
                    part = excess * math.exp(-z)
                    friction += part
                    if speed > 0.0:
                        slope -= part * p[STRIBECK_SHAPE] * z / speed
                    elif p[STRIBECK_SHAPE] == 1.0:
                        slope -= part / p[STRIBECK_MPS]
                friction += p[DRAG] * speed * speed
                slope += 2.0 * p[DRAG] * speed
            rate = (1.0 + gain * slope) / tau
            level = gain * (now - s * friction + slope * v) / tau  # dv/dt = level - rate v
            if v != 0.0:
                # Does the wheel stop inside this piece? If so the piece ends there.
                end = v * math.exp(-rate * h) + level * decay_integral(rate, h)
                if end * s <= 0.0:
                    if abs(rate * v) < 1e-9 * abs(level):
                        stop = -v / level
                    else:
                        stop = math.log1p(-rate * v / level) / rate
                    if 0.0 <= stop < h:
                        h = stop
        decay = decay_integral(rate, h)
        v_end = v * math.exp(-rate * h) + level * decay
        stopped = v != 0.0 and v_end * s <= 1e-15
        if abs(rate * h) < 1e-6:
            travel = v * h + (level - rate * v) * 0.5 * h * h
        else:
            travel = level / rate * h + (v - level / rate) * decay
        if filter_s > 0.0:
            # d y/dt = (v - y) / filter_s with v constant plus a decaying part.
            fast = 1.0 / filter_s
            fall = math.exp(-fast * h)
            if abs(rate) < 1e-9:
                ramp = level  # v = v0 + level t
                y = state[2] * fall + v * (1.0 - fall) + ramp * (h - filter_s * (1.0 - fall))
            else:
                steady = level / rate
                difference = fast - rate
                if abs(difference * h) < 1e-7:
                    mixed = fast * h * fall
                else:
                    mixed = fast * (math.exp(-rate * h) - fall) / difference
                y = state[2] * fall + steady * (1.0 - fall) + (v - steady) * mixed
            state[2] = y
        else:
            state[2] = v_end
        if lag > 0.0:
            state[3] = drive + (state[3] - drive) * math.exp(-h / lag)
        state[0] = 0.0 if stopped else v_end
        if stopped and filter_s <= 0.0:
            state[2] = 0.0
        state[1] += travel
        left -= h


@compiled
def rollout(
    p: FloatArray,
    t: FloatArray,
    starts: IntArray,
    piece_end: FloatArray,
    piece_effort: FloatArray,
    piece_supply: FloatArray,
    piece_starts: IntArray,
    interval: FloatArray,
    initial: FloatArray,
    mean_over_interval: bool,
    max_step: float,
    out: FloatArray,
    travel_out: FloatArray,
) -> None:
    """Free-run simulation of segments laid end to end.

    Parameters
    ----------
    p : shape (PARAMETER_COUNT,).
    t : shape (n,), s, increasing inside a segment.
    starts : shape (segments + 1,), first row of each segment, and n.
    piece_end : shape (m,), s, where each piece of constant input ends, before delay.
    piece_effort : shape (m,).
    piece_supply : shape (m,), relative deviation of the supply from nominal (0 when not measured).
    piece_starts : shape (segments + 1,), first piece of each segment, and m.
    interval : shape (segments,), s, the usual time between rows.
    initial : shape (segments,), m/s, speed at the first row of each segment.
    mean_over_interval : speed as the mean since the last row, else at the row's instant.
    out : shape (n,), m/s, the speed as the recorder would report it (written).
    travel_out : shape (n,), m, true travel since the segment's first row (written).
    """
    state = np.zeros(4)
    n = t.shape[0]
    filtered = np.empty(n)
    delay = p[DELAY_S]
    lag = p[RECORDER_LAG_S]
    window = p[RECORDER_WINDOW_S]
    for segment in range(starts.shape[0] - 1):
        first = starts[segment]
        last = starts[segment + 1]
        v0 = initial[segment]
        state[0] = v0
        state[1] = 0.0
        state[2] = v0
        # The first row tells the input of the usual interval before it. What came earlier is unknown,
        # so the wheel keeps its initial speed until the first known input arrives.
        j = piece_starts[segment]
        last_piece = piece_starts[segment + 1] - 1
        arrival = t[first] - interval[segment] + delay
        u = piece_effort[j] * (1.0 + p[SUPPLY_SHARE] * piece_supply[j])
        state[3] = u + p[OFFSET]
        filtered[first] = v0
        travel_out[first] = 0.0
        now = t[first]
        for k in range(first + 1, last):
            while now < t[k]:
                if now < arrival:
                    until = min(arrival, t[k])
                    state[1] += v0 * (until - now)
                    now = until
                    continue
                while j < last_piece and piece_end[j] + delay <= now:
                    j += 1
                u = piece_effort[j] * (1.0 + p[SUPPLY_SHARE] * piece_supply[j])
                until = t[k]
                if j < last_piece and piece_end[j] + delay < until:
                    until = piece_end[j] + delay
                _advance(p, state, u + p[OFFSET], until - now, max_step)
                now = until
            filtered[k] = state[2]
            travel_out[k] = state[1]
        # What the recorder reports. The integral of the filtered speed is travel - lag (y - y0).
        y0 = v0
        if window > 0.0:
            m = first
            for k in range(first, last):
                back = t[k] - window
                reported = travel_out[k] - lag * (filtered[k] - y0)
                if back <= t[first]:
                    before = v0 * (back - t[first])
                else:
                    while t[m + 1] < back:
                        m += 1
                    h = t[m + 1] - t[m]
                    z = (back - t[m]) / h
                    a = travel_out[m] - lag * (filtered[m] - y0)
                    b = travel_out[m + 1] - lag * (filtered[m + 1] - y0)
                    before = (
                        (1.0 + 2.0 * z) * (1.0 - z) ** 2 * a
                        + z * (1.0 - z) ** 2 * h * filtered[m]
                        + z * z * (3.0 - 2.0 * z) * b
                        + z * z * (z - 1.0) * h * filtered[m + 1]
                    )
                out[k] = (reported - before) / window
        elif mean_over_interval:
            out[first] = v0
            for k in range(first + 1, last):
                h = t[k] - t[k - 1]
                if h > 0.0:
                    out[k] = (travel_out[k] - travel_out[k - 1] - lag * (filtered[k] - filtered[k - 1])) / h
                else:
                    out[k] = out[k - 1]
        else:
            for k in range(first, last):
                out[k] = filtered[k]
