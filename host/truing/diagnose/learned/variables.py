"""The variables that a correction may depend on, from a set's rows, and the candidates that are tried."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.data.set_data import SetData
from truing.model.compiled import compiled
from truing.model.correction import PERIODIC, Place, Variable

# Time constants of memories, s, and frequencies of ringing, Hz, with its damping ratio.
RECENT_S = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0)
HEAT_S = (5.0, 20.0, 60.0)
RINGING_HZ, RINGING_DAMPING = (0.6, 0.8, 1.1, 1.5, 2.0, 2.7, 3.6, 4.8, 6.5), 0.1
# Intervals of a lookup: of time and place, of a repeating variable, and of any other.
TIME_POINTS, PERIODIC_POINTS, POINTS = 21, 17, 9
# Seconds of a run that a step of a lookup over time is at least.
MIN_TIME_STEP_S = 0.4
# Shares of the rows that lie outside of a lookup at either end.
OUTSIDE = 0.002
# Moving mean of measured speeds that stands for the state in the first, linear stage, s.
SMOOTHED_S = 0.15


@dataclass(frozen=True, slots=True)
class Candidate:
    """A place, a variable and the grid of its lookup."""

    place: Place
    variable: Variable
    constant: float
    grid: tuple[float, ...]

    @property
    def key(self) -> tuple[str, float]:
        """The variable with its constant."""
        return self.variable, self.constant


def row_variable(data: SetData, variable: str, constant: float) -> FloatArray:
    """Values of a variable that the rows alone determine, shape (n, 2).

    Travel and heading are the measured ones, as in the catalogue's periodic effects: a simulated one drifts.
    """
    effort = data.effort
    if variable == "effort":
        return effort
    if variable == "other_effort":
        return np.ascontiguousarray(effort[:, ::-1])
    if variable == "load":
        return _both(np.abs(effort).mean(axis=1))
    if variable == "run_time":
        return _both(data.t_s - _at_run_start(data, data.t_s))
    if variable == "set_time":
        return _both(data.elapsed_s)
    if variable == "travel":
        return data.travel_m
    if variable == "travel_repeating":
        return np.asarray(np.mod(data.travel_m, constant))
    if variable == "angle_repeating":
        return np.asarray(np.mod(running_travel(data), constant))
    if variable == "heading":
        heading = np.zeros(len(data)) if data.heading_rad is None else data.heading_rad
        return _both(np.mod(heading, 2.0 * math.pi))
    if variable in ("place_x", "place_y", "ahead", "place_x_repeating", "place_y_repeating"):
        x, y, ahead = places(data)
        at = {"place_x": x, "place_y": y, "ahead": ahead}[variable.removesuffix("_repeating")]
        return _both(np.mod(at, constant) if variable.endswith("_repeating") else at)
    out = np.zeros_like(effort)
    if variable == "recent_effort":
        _low_pass(data.starts, data.dt_s, effort, constant, True, out)
        return out - effort
    if variable == "heat":
        _low_pass(np.array([0, len(data)]), data.dt_s, effort**2, constant, False, out)
        return out
    rate = np.zeros_like(effort)
    driven = _both(effort.mean(axis=1)) if variable.startswith("mean_") else effort
    _ring(data.starts, data.dt_s, driven, 2.0 * math.pi * constant, RINGING_DAMPING, out, rate)
    return rate if variable.endswith("_rate") else out - driven


def places(data: SetData) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Place on the floor x, y and the part of it along the heading, m, each (n,), as the wheels measure it.

    Each run starts at the origin along x: floors are found only by runs that start at the same place. Without
    a wheelbase all is travel along a line.
    """
    out = np.zeros((3, len(data)))
    base = data.baseline.wheelbase_m
    for run in range(data.runs):
        rows = data.rows_of(run)
        step = np.diff(data.travel_m[rows], axis=0, prepend=data.travel_m[rows][:1])
        turn = np.zeros(len(step)) if base is None else (step[:, 1] - step[:, 0]) / base
        heading = np.cumsum(turn)
        middle = heading - 0.5 * turn
        x = np.cumsum(step.mean(axis=1) * np.cos(middle))
        y = np.cumsum(step.mean(axis=1) * np.sin(middle))
        out[:, rows] = x, y, x * np.cos(heading) + y * np.sin(heading)
    return out[0], out[1], out[2]


def running_travel(data: SetData) -> FloatArray:
    """Travel of the wheels, m, running on from run to run as the wheels' angles do, shape (n, 2)."""
    out = data.travel_m.copy()
    offset = np.zeros(2)
    for run in range(data.runs):
        rows = data.rows_of(run)
        out[rows] += offset
        offset = out[rows][-1]
    return out


def _both(values: FloatArray) -> FloatArray:
    return np.ascontiguousarray(np.repeat(values[:, None], 2, axis=1))


def _at_run_start(data: SetData, values: FloatArray) -> FloatArray:
    first = np.searchsorted(data.run_of_row, np.arange(data.runs))
    return np.asarray(values[first][data.run_of_row])


@compiled
def _low_pass(starts, dt, u, constant, rests, out) -> None:  # type: ignore[no-untyped-def]
    """Mean over each row of a first-order lag of u (n, 2); a segment starts at rest where `rests`."""
    state = np.zeros(2)
    for segment in range(len(starts) - 1):
        if rests:
            state[:] = 0.0
        for i in range(starts[segment], starts[segment + 1]):
            keep = math.exp(-dt[i] / constant)
            for w in range(2):
                before = state[w]
                state[w] = u[i, w] + (before - u[i, w]) * keep
                out[i, w] = u[i, w] + (before - u[i, w]) * (1.0 - keep) * constant / dt[i]


@compiled
def _ring(starts, dt, u, omega, damping, out, rate) -> None:  # type: ignore[no-untyped-def]
    """An oscillator driven by u (n, 2): its mean deflection and its rate over omega in each row."""
    for segment in range(len(starts) - 1):
        x, y = np.zeros(2), np.zeros(2)
        for i in range(starts[segment], starts[segment + 1]):
            count = max(1, math.ceil(dt[i] * omega / 0.1))
            h = dt[i] / count
            for w in range(2):
                for _ in range(count):
                    y[w] += h * omega * (u[i, w] - x[w] - 2.0 * damping * y[w])
                    x[w] += h * omega * y[w]
                    out[i, w] += x[w] / count
                    rate[i, w] += y[w] / count


def smoothed_speeds(data: SetData) -> FloatArray:
    """Measured speeds for the state: a moving mean, and 0 where a wheel stands, shape (n, 2)."""
    from scipy.ndimage import uniform_filter1d

    rows = max(1, round(SMOOTHED_S / float(np.median(data.interval_s))))
    rows += 1 - rows % 2
    valid = np.where(data.valid, data.speed_mps, np.nan)
    filled = np.stack([_filled(valid[:, w]) for w in range(2)], axis=1)
    out = np.concatenate(
        [uniform_filter1d(filled[a:b], rows, axis=0, mode="nearest") for a, b in pairwise(data.starts)]
    )
    return np.asarray(np.where(np.abs(out) < 1.5e-3 * data.top_mps, 0.0, out))


def _filled(values: FloatArray) -> FloatArray:
    good = np.isfinite(values)
    if good.all() or not good.any():
        return np.nan_to_num(values)
    return np.asarray(np.interp(np.arange(len(values)), np.flatnonzero(good), values[good]))


def state_variable(variable: str, speeds: FloatArray, effort: FloatArray, gain: FloatArray) -> FloatArray:
    """A variable of the state at the given speeds (n, 2), shape (n, 2)."""
    if variable == "speed":
        return speeds
    if variable == "speed_difference":
        return np.asarray(speeds - speeds[:, ::-1])
    net = effort - speeds / gain
    return net if variable == "net_effort" else np.ascontiguousarray(net[:, ::-1])


def candidates(data: SetData, speeds: FloatArray, gain: FloatArray) -> Iterator[Candidate]:
    """All candidates but repeating ones; the simplest first."""

    def spread(variable: str, constant: float = 0.0) -> FloatArray:
        if variable in ("speed", "speed_difference", "net_effort", "other_net_effort"):
            return state_variable(variable, speeds, data.effort, gain)
        return row_variable(data, variable, constant)

    def even(
        place: Place, variable: Variable, constant: float = 0.0, points: int = POINTS
    ) -> Candidate | None:
        z = spread(variable, constant)
        low, high = np.quantile(z, [OUTSIDE, 1.0 - OUTSIDE])
        if high - low < 1e-6:
            return None
        if low < 0.0 < high:  # symmetric, so that zero is a point of the grid
            high = max(-low, high)
            low = -high
        return Candidate(place, variable, constant, tuple(np.linspace(low, high, points).tolist()))

    top = float(np.quantile(np.abs(speeds), 1.0 - OUTSIDE))
    if top > 0.0:
        half = top * np.array([0.0, 0.04, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0])
        yield Candidate("friction", "speed", 0.0, (*(-half[::-1]).tolist(), *half.tolist()))
        yield Candidate("signal", "speed", 0.0, (*(-half[::-1]).tolist(), *half.tolist()))
        yield Candidate("inertia", "speed", 0.0, (*(-half[::-1]).tolist(), *half.tolist()))
    run_s = float(np.quantile(spread("run_time"), 1.0 - OUTSIDE))
    time_points = int(np.clip(run_s / MIN_TIME_STEP_S, 4, 2 * TIME_POINTS)) + 1
    wanted: list[Candidate | None] = [
        even("force", "effort", points=13),
        even("force", "net_effort", points=13),
        even("force", "speed_difference", points=11),
        even("force", "other_net_effort"),
        even("friction", "run_time", points=time_points),
        even("force", "run_time", points=time_points),
        even("gain", "set_time"),
        even("inertia", "set_time"),
        even("gain", "load"),
        even("inertia", "load"),
        even("inertia", "effort", points=11),
        even("friction", "travel", points=TIME_POINTS),
        even("force", "travel", points=13),
        *(even("gain", "heat", each) for each in HEAT_S if each < data.duration_s),
        *(even("force", "recent_effort", each, 7) for each in RECENT_S),
        *(even("force", "ringing", each, 5) for each in RINGING_HZ),
        *(even("force", "ringing_rate", each, 5) for each in RINGING_HZ),
        *(even("force", "mean_ringing", each, 5) for each in RINGING_HZ),
        *(even("force", "mean_ringing_rate", each, 5) for each in RINGING_HZ),
        even("force", "ahead", points=13),
        even("friction", "place_x", points=TIME_POINTS),
        even("friction", "place_y", points=TIME_POINTS),
    ]
    if data.heading_rad is not None and data.heading_source in ("truth", "gyro", "odometry", "wheels"):
        wanted.append(repeating("force", "heading", 2.0 * math.pi))
    yield from (one for one in wanted if one is not None)


def repeating(place: Place, variable: Variable, period: float) -> Candidate:
    """A candidate over one period."""
    assert variable in PERIODIC
    return Candidate(place, variable, period, tuple(np.linspace(0.0, period, PERIODIC_POINTS).tolist()))
