"""Excitation measures: counts of events and durations of regimes that an effect needs.

Effects combine them in their `exercised`: 0 without excitation, 1 where it is sufficient.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.diagnose.data.set_data import SetData

# Share of full speed below which a wheel is at rest.
REST_SPEED_SHARE = 0.01
# A wheel is hardly driven at this share of the other one's effort; other driving than turns on the spot
# that separates the wheels from the chassis, s.
IDLE_SHARE, MIN_OFF_THE_SPOT_S = 0.2, 1.0
# Bands of |speed| up to full speed.
SPEED_BANDS = 6


def gains(data: SetData) -> FloatArray:
    """Full-effort speed by wheel, shape (2,), m/s."""
    return np.array([data.baseline.left.gain_mps, data.baseline.right.gain_mps])


def time_constant_s(data: SetData) -> float:
    """Mean time constant of the baseline's wheels, s."""
    return 0.5 * (data.baseline.left.time_constant_s + data.baseline.right.time_constant_s)


def relative_speed(data: SetData) -> FloatArray:
    """Measured speed over the baseline's full-effort speed, shape (n, 2)."""
    return np.asarray(data.speed_mps / gains(data))


def moving(data: SetData) -> BoolArray:
    """Whether each wheel moves, shape (n, 2)."""
    return np.asarray(np.abs(relative_speed(data)) > REST_SPEED_SHARE)


def seconds(data: SetData, where: BoolArray) -> float:
    """Time for which a condition (n,) or (n, 2) holds, on either wheel, s."""
    either = where if where.ndim == 1 else where.any(axis=1)
    return float(data.dt_s[either & data.judged].sum())


def enough(amount: float, needed: float) -> float:
    """`amount` as a share of what is needed."""
    return float(amount / needed) if needed > 0.0 else 0.0


def starts_and_stops(data: SetData) -> int:
    """Number of stops, starts and reversals of the wheels."""
    turning = np.sign(np.where(moving(data), data.speed_mps, 0.0))
    changed = (np.diff(turning, axis=0) != 0.0) & data.judged[1:, None]
    return int(changed.sum())


def reversals(data: SetData) -> int:
    """Number of sign changes of the efforts."""
    count = 0
    for w in (0, 1):
        for k in range(data.segments):
            effort = data.effort[data.starts[k] : data.starts[k + 1], w]
            signs = np.sign(effort[np.abs(effort) > 0.02])
            count += int((np.diff(signs) != 0.0).sum())
    return count


def effort_steps(data: SetData, minimum: float = 0.1) -> int:
    """How often the effort of a wheel jumps by at least this much within two rows."""
    return len(effort_step_rows(data, minimum))


def effort_step_rows(data: SetData, minimum: float = 0.1) -> IntArray:
    """Rows at which the effort of a wheel jumps by at least this much within two rows, each wheel's own."""
    jump = np.zeros_like(data.effort)
    jump[2:] = np.abs(data.effort[2:] - data.effort[:-2])
    near_start = np.zeros(len(data), dtype=bool)
    for a in data.starts[:-1]:
        near_start[a : a + 2] = True
    high = (jump >= minimum) & ~near_start[:, None]
    return np.nonzero(np.diff(high.astype(np.int8), axis=0) == 1)[0] + 1


def speeds_up_after(data: SetData, rows: IntArray) -> BoolArray:
    """Whether the faster wheel is faster half a time constant after each of these rows, shape (rows,)."""
    later = max(1, round(0.5 * time_constant_s(data) / float(np.median(data.interval_s))))
    last = np.repeat(data.starts[1:], np.diff(data.starts)) - 1
    speed = np.abs(data.speed_mps).max(axis=1)
    return np.asarray(speed[np.minimum(rows + later, last[rows])] > speed[rows])


def speed_levels(data: SetData) -> int:
    """In how many of the SPEED_BANDS of |speed| a wheel stays for at least a second."""
    speed = np.abs(relative_speed(data))
    edges = np.linspace(0.0, 1.0, SPEED_BANDS + 1)
    edges[0], edges[-1] = REST_SPEED_SHARE, np.inf
    return sum(seconds(data, (speed >= low) & (speed < high)) >= 1.0 for low, high in pairwise(edges))


def turns(data: SetData) -> float:
    """Time for which the wheels turn clearly differently, s."""
    difference = np.abs(data.speed_mps[:, 1] - data.speed_mps[:, 0])
    return seconds(data, difference > 0.1 * data.top_mps)


def turns_on_the_spot_only(data: SetData) -> bool:
    """Whether the wheels hardly ever move the same way, and none moves while the other is hardly driven."""
    moves, effort = moving(data), np.abs(data.effort)
    same_way = moves.all(axis=1) & (data.speed_mps[:, 0] * data.speed_mps[:, 1] > 0.0)
    alone = (moves.sum(axis=1) == 1) & (effort.min(axis=1) < IDLE_SHARE * effort.max(axis=1))
    return seconds(data, same_way | alone) < MIN_OFF_THE_SPOT_S


def both_driven(data: SetData) -> float:
    """Time for which both wheels are driven, s."""
    return seconds(data, np.asarray((np.abs(data.effort) > 0.05).all(axis=1)))
