"""The baseline's own structure, refitted: the gain and time constant that serve a robot's output best."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numba
import numpy as np
from numpy.typing import NDArray

from support.practice_robots.recorder import Layout

Array: TypeAlias = NDArray[np.float64]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def unit_speed(
    effort: NDArray[np.float64],
    start: NDArray[np.bool_],
    row: NDArray[np.bool_],
    tau: float,
    dt: float,
    instant: bool,
) -> NDArray[np.float64]:
    """Mean speed per row of a first-order wheel of gain 1 under efforts per ms, at rest when a run starts.

    `instant`: the speed at each row's time instead.
    """
    out = np.empty(int(row.sum()))
    keep = np.exp(-1e-3 / tau)
    v = 0.0
    travel = 0.0
    at = 0
    for ms in range(effort.shape[0]):
        if start[ms]:
            v = 0.0
            travel = 0.0
        u = effort[ms]
        travel += u * 1e-3 + (v - u) * tau * (1.0 - keep)
        v = u + (v - u) * keep
        if row[ms]:
            out[at] = v if instant else travel / dt
            travel = 0.0
            at += 1
    return out


def best_gain(
    layout: Layout, tau: float, speed: Array, wheels: tuple[int, ...], *, instant: bool
) -> tuple[float, float, Array]:
    """Gain, sum of squares and prediction (rows, wheels) at one time constant common to `wheels`."""
    shape = np.stack(
        [
            unit_speed(
                np.ascontiguousarray(layout.effort[:, w]),
                layout.start,
                layout.row,
                tau,
                layout.dt_s,
                instant,
            )
            for w in wheels
        ],
        axis=1,
    )
    wanted = speed[:, list(wheels)]
    gain = float((shape * wanted).sum() / max((shape * shape).sum(), 1e-30))
    left = wanted - gain * shape
    return gain, float((left * left).sum()), gain * shape


def _golden(cost: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    ratio = (np.sqrt(5) - 1) / 2
    a, b = low, high
    c, d = b - ratio * (b - a), a + ratio * (b - a)
    fc, fd = cost(c), cost(d)
    while b - a > tolerance:
        if fc < fd:
            b, d, fd = d, c, fc
            c = b - ratio * (b - a)
            fc = cost(c)
        else:
            a, c, fc = c, d, fd
            d = a + ratio * (b - a)
            fd = cost(d)
    return (a + b) / 2


def refit(
    layout: Layout,
    speed: Array,
    near_s: Array,
    *,
    sides_equal: bool = False,
    instant: bool = False,
    tolerance: float = 4e-3,
) -> Array:
    """Prediction (rows, 2) of the first-order baseline with its best gains and time constants.

    `near_s` (2,) are the time constants around which (a factor of 5 either way) is searched; `instant`: the
    speeds are those at the rows' times.
    """
    groups: tuple[tuple[int, ...], ...] = ((0, 1),) if sides_equal else ((0,), (1,))
    out = np.empty_like(speed)
    for wheels in groups:
        centre = float(np.log(near_s[list(wheels)].mean()))
        log_tau = _golden(
            lambda x, wheels=wheels: best_gain(  # type: ignore[misc]
                layout, float(np.exp(x)), speed, wheels, instant=instant
            )[1],
            centre - 1.6,
            centre + 1.6,
            tolerance,
        )
        out[:, list(wheels)] = best_gain(layout, float(np.exp(log_tau)), speed, wheels, instant=instant)[2]
    return out
