"""The noise of the measured speeds, read from the recordings: autoregressive, one model per wheel.

What a correct model leaves over is no white noise. A differenced encoder count carries a moving average
of rounding errors, and a small disturbance of the torque reaches the speed through the wheel's own lag.
An autoregression of a few lags stands for both (any rational spectrum; Ljung 1999, section 4.2), so that
its innovations can be counted as independent samples.

The noise's memory is bounded: a disturbing torque is forgotten about as fast as the wheel forgets, so
correlations fade with the wheel's own time constant. Without that bound an autoregression takes any slow
error of the model (friction that a linear model lacks) for noise that never forgets, and then no slow
error weighs anything.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from truing.model.compiled import compiled
from truing.model.kernel import FloatArray, IntArray

# Lags reach back this far, s; at 20 Hz six of them follow an encoder's moving average and a wheel's lag.
# Where rows come faster, the later lags lie further apart.
REACH_S = 0.3
LEAST_ORDER, LARGEST_ORDER = 4, 8
# Correlations of the noise fade at least as fast as in this many time constants of the wheel.
MEMORY_TAUS = 2.0
# Ridge on the normal equations, relative: keeps the lags of a wheel that hardly moves defined.
RIDGE = 1e-6


@dataclass(frozen=True, slots=True)
class Noise:
    """Autoregressive noise of both wheels.

    Attributes
    ----------
    lags : shape (2, order); e_k = r_k - sum_j lags[w, j] r_{k-1-j} is white.
    sigma : shape (2,), m/s, RMS of the innovations e.
    rms : shape (2,), m/s, RMS of the noise itself.
    memory_s : shape (2,), s, the time over which it forgets itself: the integral of its correlation.
    """

    lags: FloatArray
    sigma: FloatArray
    rms: FloatArray

    memory_s: FloatArray


def lags_for(interval_s: float) -> IntArray:
    """Which rows back the noise of recordings with this sampling interval is told from, shape (order,)."""
    reach = int(max(round(REACH_S / max(interval_s, 1e-6)), LEAST_ORDER))
    if reach <= LARGEST_ORDER:
        return np.arange(1, reach + 1)
    return np.unique(np.round(np.geomspace(1.0, reach, LARGEST_ORDER)).astype(np.int64))


def lag_index(starts: IntArray, rows: int, lags: IntArray) -> IntArray:
    """Row numbers of each row's predecessors, shape (order, n); `rows` stands for "before the segment"."""
    first = np.repeat(starts[:-1], np.diff(starts))
    index = np.arange(rows)
    lagged = np.stack([index - k for k in lags])
    return np.asarray(np.where(lagged >= first, lagged, rows))


def white_noise(lagged: IntArray) -> Noise:
    """Noise of 1 m/s without memory, to begin with."""
    return Noise(np.zeros((2, lagged.shape[0])), np.ones(2), np.ones(2), np.zeros(2))


def estimate_noise(
    residual: FloatArray,
    counted: FloatArray,
    starts: IntArray,
    interval_s: float,
    fade_s: FloatArray,
    floor: FloatArray,
) -> Noise:
    """Autoregressions from the correlations of what a model leaves over (Yule 1927, Walker 1931).

    Parameters
    ----------
    residual : shape (n, 2), m/s.
    counted : shape (n, 2), weights 0..1 of the rows (0: not measured, or judged by nobody).
    starts : shape (segments + 1,), first row of every segment, and n.
    fade_s : shape (2,), s, correlations are taken to fade at least this fast.
    floor : shape (2,), m/s, the least RMS that the sensor's own resolution allows.
    """
    lags = lags_for(interval_s)
    reach = int(lags[-1])
    index = lag_index(starts, len(residual), np.arange(1, reach + 1))
    found = Noise(np.zeros((2, len(lags))), np.zeros(2), np.zeros(2), np.zeros(2))
    apart = np.abs(np.subtract.outer(lags, lags))
    for wheel in range(2):
        weight = np.sqrt(counted[:, wheel])
        r = np.where(weight > 0.0, residual[:, wheel] * weight, 0.0)
        r_past, weight_past = np.append(r, 0.0)[index], np.append(weight, 0.0)[index]
        power = max(float(r @ r / max(weight @ weight, 1.0)), floor[wheel] ** 2)
        cross = (r_past @ r) / np.maximum(weight_past @ weight, 1.0)
        fade = np.exp(-np.arange(1, reach + 1) * interval_s / max(float(fade_s[wheel]), interval_s))
        covariance = np.concatenate(([power], cross * fade))
        gram = covariance[apart] + np.eye(len(lags)) * RIDGE * power
        found.lags[wheel] = np.linalg.solve(gram, covariance[lags])
        innovations = r - r_past[lags - 1].T @ found.lags[wheel]
        left = float(innovations @ innovations / max(weight @ weight, 1.0))
        found.rms[wheel] = np.sqrt(power)
        found.sigma[wheel] = np.sqrt(max(left, (0.5 * floor[wheel]) ** 2))
        correlation = covariance / power
        fades = int(np.argmax(correlation < 0.05)) or len(correlation)
        found.memory_s[wheel] = max(float(correlation[:fades].sum()) - 0.5, 0.5) * interval_s
    return found


def whiten(noise: Noise, columns: FloatArray, counted: FloatArray, lagged: IntArray) -> FloatArray:
    """Innovations in units of their RMS: (n, 2) or (n, 2, p) like `columns`; uncounted rows are zero."""
    flat = np.ascontiguousarray(columns.reshape(*columns.shape[:2], -1))
    out = np.zeros_like(flat)
    _whiten(flat, counted, lagged, noise.lags, noise.sigma, out)
    return out.reshape(columns.shape)


def foretold_doubt(noise: Noise, doubt: FloatArray, lagged: IntArray) -> FloatArray:
    """How doubtful is what the rows before foretell of each row, shape (n, 2), m/s.

    Parameters
    ----------
    doubt : shape (n, 2), m/s, of each row itself.
    """
    beyond = np.concatenate((doubt, np.zeros((1, 2))))  # a row that has no such predecessor has number n
    return np.asarray(np.einsum("knw,wk->nw", beyond[lagged], np.abs(noise.lags)))


@compiled
def _whiten(
    columns: FloatArray,
    counted: FloatArray,
    lagged: IntArray,
    lags: FloatArray,
    sigma: FloatArray,
    out: FloatArray,
) -> None:
    rows, _, width = columns.shape
    for row in range(rows):
        for wheel in range(2):
            weight = counted[row, wheel]
            if weight <= 0.0:
                continue
            for k in range(width):
                out[row, wheel, k] = columns[row, wheel, k]
            for lag in range(lagged.shape[0]):
                before = lagged[lag, row]
                if before >= rows or counted[before, wheel] <= 0.0:
                    continue
                share = lags[wheel, lag]
                for k in range(width):
                    out[row, wheel, k] -= share * columns[before, wheel, k]
            scale = math.sqrt(weight) / sigma[wheel]
            for k in range(width):
                out[row, wheel, k] *= scale
