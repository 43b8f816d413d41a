"""Periods along the travel: one candidate for each place where what is left repeats most clearly."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truing.arrays import FloatArray
from truing.diagnose.learned.regression import Left
from truing.diagnose.learned.variables import Candidate, places, repeating, running_travel
from truing.model.compiled import compiled
from truing.model.correction import Place, Variable

AnyFloats = NDArray[np.floating[Any]]
# Rows at most that the scan reads, and periods at most that it tries.
MAX_ROWS, MAX_PERIODS = 12_000, 500
SHORTEST_M = 0.03
# Repetitions per turn of a wheel whose circumference is known.
PER_TURN = (*range(1, 25), 28, 30, 32, 36, 40, 48)
# Periods are this share of a cycle apart over the longest run.
CYCLE_SHARE = 0.3


def periodic_candidates(left: Left) -> Iterator[Candidate]:
    """The clearest period of each place, from the rows of these groups."""
    data = left.data
    rows = slice(0, min(len(data), MAX_ROWS))
    runs = data.travel_m[rows]
    longest = float(np.ptp(runs))
    if longest > 4.0 * SHORTEST_M:
        waves = np.arange(1.5 / longest, 1.0 / SHORTEST_M, CYCLE_SHARE / longest)[:MAX_PERIODS]
        along: tuple[Place, ...] = ("friction", "force")
        for place in along:
            yield repeating(place, "travel_repeating", 1.0 / _clearest(left, rows, runs, waves, place))
    if longest > 4.0 * SHORTEST_M and data.baseline.wheelbase_m is not None:
        x, y, _ = places(data)
        floor: tuple[tuple[Variable, FloatArray], ...] = (("place_x_repeating", x), ("place_y_repeating", y))
        for variable, at in floor:
            span = float(np.ptp(at[rows]))
            if span > 4.0 * SHORTEST_M:
                waves = np.arange(1.5 / span, 1.0 / SHORTEST_M, CYCLE_SHARE / span)[:MAX_PERIODS]
                both = np.repeat(at[rows, None], 2, axis=1)
                yield repeating("friction", variable, 1.0 / _clearest(left, rows, both, waves, "friction"))
    radius = data.wheel_radius_m
    if radius is not None:
        angles = running_travel(data)[rows]
        waves = np.array(PER_TURN) / (2.0 * math.pi * radius)
        turning: tuple[Place, ...] = ("force", "signal")
        for place in turning:
            yield repeating(place, "angle_repeating", 1.0 / _clearest(left, rows, angles, waves, place))


def _clearest(left: Left, rows: slice, at: FloatArray, waves: AnyFloats, place: Place) -> float:
    """Waves per metre that take the most off the squared error."""
    data = left.data
    first = np.zeros(len(data), dtype=np.bool_)
    first[data.starts[:-1]] = True
    factor = {
        "friction": -np.sign(left.state), "force": np.ones_like(left.state), "signal": left.speeds
    }[place][rows]  # fmt: skip
    score = np.zeros(len(waves))
    for w in range(2):
        _scan(
            first[rows], data.dt_s[rows], np.ascontiguousarray(at[:, w]), np.ascontiguousarray(factor[:, w]),
            np.ascontiguousarray(left.error[rows, w]), np.ascontiguousarray(left.weight[rows, w]),
            left.gain[w], left.tau[w], place == "signal", waves, score,
        )  # fmt: skip
    return float(waves[int(np.argmax(score))])


@compiled
def _scan(first, dt, at, factor, error, weight, gain, tau, direct, waves, score) -> None:  # type: ignore[no-untyped-def]
    """Add the squared error that sine and cosine of each wave number take away, beside the plain factor."""
    for k in range(len(waves)):
        c = s = p = 0.0
        a = np.zeros((3, 3))
        b = np.zeros(3)
        x = np.zeros(3)
        for i in range(len(at)):
            if first[i]:
                c = s = p = 0.0
                continue
            phase = 2.0 * math.pi * waves[k] * at[i]
            fc, fs = factor[i] * math.cos(phase), factor[i] * math.sin(phase)
            if direct:
                x[0], x[1], x[2] = fc, fs, factor[i]
            else:
                keep = math.exp(-dt[i] / tau)
                mean = (1.0 - keep) * tau / dt[i]
                x[0] = gain * fc + (c - gain * fc) * mean
                x[1] = gain * fs + (s - gain * fs) * mean
                x[2] = gain * factor[i] + (p - gain * factor[i]) * mean
                c = gain * fc + (c - gain * fc) * keep
                s = gain * fs + (s - gain * fs) * keep
                p = gain * factor[i] + (p - gain * factor[i]) * keep
            for m in range(3):
                b[m] += weight[i] * x[m] * error[i]
                for n in range(3):
                    a[m, n] += weight[i] * x[m] * x[n]
        if a[0, 0] > 0.0 and a[1, 1] > 0.0:
            for m in range(3):
                a[m, m] *= 1.0 + 1e-6
                a[m, m] += 1e-12
            score[k] += b @ np.linalg.solve(a, b)
