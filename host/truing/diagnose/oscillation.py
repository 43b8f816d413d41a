"""Whether what a model leaves oscillates: a part that swings, or springs, and is in no equation.

Disturbances reach the speed through the wheel's own lag, and so does every error of a first-order equation:
the autocorrelation of such a residual falls and stays near zero. A mass on a hinge or a spring gives its
energy back: half a period later the residual has the opposite sign, and a whole period later the same again.
It is asked of the plain residual, of both wheels together and against each other. An autoregressive noise
model represents an oscillation as well as a disturbance, and whitens it away; and a basis of transients
misses it where the phase is lost after some periods.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.diagnose.data.set_data import SetData
from truing.diagnose.fit import Fit
from truing.diagnose.problem import MIN_NOISE_COUNTS, Problem

# Means over this time are correlated, s: the counts' noise in faster rows hides what is slower.
MEANS_S = 0.05
# RMS of the means over that of rounding, up to which they are rounding: it beats at a steady speed.
OVER_ROUNDING = 1.2
# Half periods that are looked for, s.
MIN_HALF_PERIOD_S, MAX_HALF_PERIOD_S = 0.1, 1.0
# Smallest depth (`_depth`) of an oscillation, and over its standard error between runs.
MIN_DEPTH, DEPTH_ERRORS = 0.4, 2.5
# Runs have to last this many of the longest periods on average, and there are at least so many runs.
MIN_PERIODS, MIN_RUNS = 1.0, 3


@dataclass(frozen=True, slots=True)
class Oscillation:
    """An oscillation in a residual: of both wheels together, or of one against the other."""

    frequency_hz: float
    together: bool


def find_oscillation(problem: Problem, done: Fit) -> Oscillation | None:
    """The oscillation in the residual of a fit, or None."""
    data = problem.data
    residual = np.where(problem.counted > 0.0, data.speed_mps - done.residual.speeds, 0.0)
    for together, mode in ((True, (0.5, 0.5)), (False, (0.5, -0.5))):
        half_period_s = _half_period_s(data, residual @ mode)
        if half_period_s is not None:
            return Oscillation(0.5 / half_period_s, together)
    return None


def _half_period_s(data: SetData, residual: FloatArray) -> float | None:
    """Half the period of the oscillation of a residual, shape (n,), or None without a significant one."""
    interval_s = float(np.median(data.interval_s))
    rows = max(1, round(MEANS_S / interval_s))
    shortest, longest = (
        max(1, round(half_s / (rows * interval_s))) for half_s in (MIN_HALF_PERIOD_S, MAX_HALF_PERIOD_S)
    )
    covariance = _covariances(data, residual, rows, 2 * longest)
    total, runs = covariance.sum(axis=0), len(covariance)
    short = len(data) < MIN_PERIODS * 2 * longest * rows * runs
    if runs < MIN_RUNS or short or _is_rounding(data, float(total[0]) * rows / len(data), rows):
        return None
    halves = np.arange(shortest, longest + 1)
    depths = _depth(total, halves)
    half = int(halves[np.argmax(depths)])
    without = np.array([_depth(total - own, half) for own in covariance])
    # The jackknife's standard error over runs (Efron and Stein 1981).
    error = float(np.sqrt((runs - 1) / runs * np.sum((without - without.mean()) ** 2)))
    return half * rows * interval_s if depths.max() > max(MIN_DEPTH, DEPTH_ERRORS * error) else None


def _is_rounding(data: SetData, mean_square: float, rows: int) -> bool:
    """Whether means over so many rows differ by rounding alone, which telescopes in differences of counts."""
    rounding_mps = MIN_NOISE_COUNTS * data.resolution_mps / rows
    return mean_square <= (OVER_ROUNDING * rounding_mps) ** 2


def _covariances(data: SetData, residual: FloatArray, rows: int, reach: int) -> FloatArray:
    """Autocovariance of the means over so many rows, summed over each run, shape (runs, reach + 1)."""
    out = np.zeros((data.runs, reach + 1))
    for a, b in zip(data.starts[:-1], data.starts[1:], strict=True):
        count = (b - a) // rows
        means = residual[a : a + count * rows].reshape(count, rows).mean(axis=1)
        for lag in range(min(reach + 1, count)):
            # Later lags have fewer products; each has the weight of the whole segment.
            out[data.run_of_row[a], lag] += float(means[lag:] @ means[: count - lag]) * count / (count - lag)
    return out


def _depth(covariance: FloatArray, half: IntArray | int) -> FloatArray:
    """The smaller of minus the correlation half a period later and the one a period later, -1 to 1."""
    return np.asarray(np.minimum(-covariance[half], covariance[2 * half]) / covariance[0])
