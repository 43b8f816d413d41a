"""Autoregressive noise model of the measured wheel speeds, estimated from residuals, one per wheel.

The residual of a correct model is not white. A differenced encoder count carries a moving average of
quantisation errors, and a small torque disturbance reaches the speed through the wheel's own lag. An
autoregression of a few lags approximates both (any rational spectrum; Ljung 1999, section 4.2), so that
its innovations can be counted as independent samples.

The correlation time is bounded: the speed error that a torque disturbance causes decays with the wheel's
time constant, so correlations are made to decay at that rate. Without the bound an autoregression models
any slow model error (friction missing from a linear model) as noise with a pole near one, and whitening
then gives slow errors no weight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.model.compiled import compiled

# Longest lag, s; at 20 Hz six lags represent an encoder's moving average and a wheel's lag. At higher log
# rates the later lags are spaced geometrically.
MAX_LAG_S = 0.3
MIN_ORDER, MAX_ORDER = 4, 8
# Correlations of the noise decay at least as fast as with this many time constants of the wheel.
MEMORY_TAUS = 2.0
# Correlation of the innovations is followed over so many rows.
MAX_CORRELATED_ROWS = 60
# Sizes of effects are compared with the noise of means over this time, s, so that they do not depend on how
# fast a recorder logs: a speed from whole counts has ten times the noise in rows of 5 ms.
COMPARED_S = 0.05
# Relative ridge on the normal equations: keeps them regular for a wheel that hardly moves.
RIDGE = 1e-6


@dataclass(frozen=True, slots=True)
class Noise:
    """Autoregressive noise of both wheels.

    Attributes
    ----------
    lags : shape (2, order); e_k = r_k - sum_j lags[w, j] r_{k-1-j} is white.
    sigma : shape (2,), m/s, RMS of the innovations e.
    rms : shape (2,), m/s, RMS of the noise itself.
    compared : shape (2,), m/s, RMS of its means over `COMPARED_S`; that of a row where rows are longer.
    memory_s : shape (2,), s, correlation time: the integral of the autocorrelation.
    """

    lags: FloatArray
    sigma: FloatArray
    rms: FloatArray
    compared: FloatArray
    memory_s: FloatArray


def lags_for(interval_s: float) -> IntArray:
    """Lags of the autoregression, in rows, for this sampling interval; shape (order,)."""
    reach = int(max(round(MAX_LAG_S / max(interval_s, 1e-6)), MIN_ORDER))
    if reach <= MAX_ORDER:
        return np.arange(1, reach + 1)
    return np.unique(np.round(np.geomspace(1.0, reach, MAX_ORDER)).astype(np.int64))


def lag_index(starts: IntArray, rows: int, lags: IntArray) -> IntArray:
    """Row indices at each lag, shape (order, n); `rows` marks a lag that reaches before the segment."""
    first = np.repeat(starts[:-1], np.diff(starts))
    index = np.arange(rows)
    lagged = np.stack([index - k for k in lags])
    return np.asarray(np.where(lagged >= first, lagged, rows))


def white_noise(lagged: IntArray, rms_mps: float) -> Noise:
    """White noise of this size: under it a fit minimises the free-run error itself."""
    rms = np.full(2, rms_mps)
    return Noise(np.zeros((2, lagged.shape[0])), rms, rms.copy(), rms.copy(), np.zeros(2))


def estimate_noise(
    residual: FloatArray,
    counted: FloatArray,
    starts: IntArray,
    interval_s: float,
    decay_s: FloatArray,
    floor: FloatArray,
    ceiling: FloatArray,
) -> Noise:
    """Autoregressions from the correlations of a model's residual (Yule 1927, Walker 1931).

    Power above `ceiling` is model error, not noise. It enters the variance of a row and not the correlations:
    whitened by its own correlation, a slow model error would have no weight at all. The correlation that the
    innovations keep for it reduces the number of independent rows, and so every log-likelihood gain.

    Parameters
    ----------
    residual : shape (n, 2), m/s.
    counted : shape (n, 2), weights 0..1 of the rows (0: not measured, or excluded).
    starts : shape (segments + 1,), first row of every segment, and n.
    decay_s : shape (2,), s, correlations are multiplied by an exponential with this time constant.
    floor : shape (2,), m/s, lower bound of the RMS from the sensor's resolution.
    ceiling : shape (2,), m/s, upper bound of the RMS that noise of these recordings can have.
    """
    lags = lags_for(interval_s)
    reach = int(lags[-1])
    index = lag_index(starts, len(residual), np.arange(1, reach + 1))
    noise = Noise(np.zeros((2, len(lags))), np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2))
    compared_rows = max(round(COMPARED_S / max(interval_s, 1e-6)), 1)
    lag_difference = np.abs(np.subtract.outer(lags, lags))
    for wheel in range(2):
        weight = np.sqrt(counted[:, wheel])
        r = np.where(weight > 0.0, residual[:, wheel] * weight, 0.0)
        r_past, weight_past = np.append(r, 0.0)[index], np.append(weight, 0.0)[index]
        power = max(float(r @ r / max(weight @ weight, 1.0)), floor[wheel] ** 2)
        cross = (r_past @ r) / np.maximum(weight_past @ weight, 1.0)
        means = _power_of_means(power, cross, compared_rows)
        noise.compared[wheel] = min(max(np.sqrt(means), floor[wheel] / compared_rows), ceiling[wheel])
        decay = np.exp(-np.arange(1, reach + 1) * interval_s / max(float(decay_s[wheel]), interval_s))
        cross = cross * min(1.0, ceiling[wheel] ** 2 / power)
        covariance = np.concatenate(([power], cross * decay))
        gram = covariance[lag_difference] + np.eye(len(lags)) * RIDGE * power
        noise.lags[wheel] = np.linalg.solve(gram, covariance[lags])
        innovations = r - r_past[lags - 1].T @ noise.lags[wheel]
        innovation_power = float(innovations @ innovations / max(weight @ weight, 1.0))
        noise.rms[wheel] = min(np.sqrt(power), ceiling[wheel])
        rows_per_sample = _correlated_rows(innovations, starts) if power > ceiling[wheel] ** 2 else 1.0
        noise.sigma[wheel] = np.sqrt(max(innovation_power, (0.5 * floor[wheel]) ** 2) * rows_per_sample)
        correlation = covariance / power
        cutoff = int(np.argmax(correlation < 0.05)) or len(correlation)
        noise.memory_s[wheel] = max(float(correlation[:cutoff].sum()) - 0.5, 0.5) * interval_s
    return noise


def _power_of_means(power: float, cross: FloatArray, rows: int) -> float:
    """Mean square of means over so many rows, from the covariances at lags 1 and more."""
    lag = np.arange(1, min(rows, len(cross) + 1))
    return max((power + 2.0 * float((1.0 - lag / rows) @ cross[: len(lag)])) / rows, 0.0)


def _correlated_rows(values: FloatArray, starts: IntArray) -> float:
    """Rows per independent sample, at least 1: 1 + 2 times the summed autocorrelation (Bartlett 1946)."""
    power = float(values @ values)
    if power <= 0.0:
        return 1.0
    rows = 1.0
    first = np.repeat(starts[:-1], np.diff(starts))
    for lag in range(1, MAX_CORRELATED_ROWS):
        same = first[lag:] == first[:-lag]
        correlation = float((values[lag:] * values[:-lag])[same].sum()) / power
        if correlation < 0.05:
            break
        rows += 2.0 * correlation
    return rows


def whiten(noise: Noise, columns: FloatArray, counted: FloatArray, lagged: IntArray) -> FloatArray:
    """Innovations in units of their RMS: (n, 2) or (n, 2, p) like `columns`; uncounted rows are zero."""
    flat = np.ascontiguousarray(columns.reshape(*columns.shape[:2], -1))
    out = np.zeros_like(flat)
    _whiten(flat, counted, lagged, noise.lags, noise.sigma, out)
    return out.reshape(columns.shape)


def whiten_wheel(
    noise: Noise, columns: FloatArray, wheel: int, counted: FloatArray, lagged: IntArray
) -> FloatArray:
    """Innovations of one wheel's columns (n, p), likewise."""
    own = slice(wheel, wheel + 1)
    out = np.zeros((len(columns), 1, columns.shape[1]))
    weights = np.ascontiguousarray(counted[:, own])
    _whiten(np.ascontiguousarray(columns[:, None]), weights, lagged, noise.lags[own], noise.sigma[own], out)
    return out[:, 0]


def predicted_uncertainty(noise: Noise, uncertainty: FloatArray, lagged: IntArray) -> FloatArray:
    """Uncertainty of the autoregressive prediction of each row, shape (n, 2), m/s.

    Parameters
    ----------
    uncertainty : shape (n, 2), m/s, of each row itself.
    """
    padded = np.concatenate((uncertainty, np.zeros((1, 2))))  # index n: no such predecessor
    return np.asarray(np.einsum("knw,wk->nw", padded[lagged], np.abs(noise.lags)))


@compiled
def _whiten(
    columns: FloatArray,
    counted: FloatArray,
    lagged: IntArray,
    lags: FloatArray,
    sigma: FloatArray,
    out: FloatArray,
) -> None:
    rows, wheels, width = columns.shape
    for row in range(rows):
        for wheel in range(wheels):
            weight = counted[row, wheel]
            if weight <= 0.0:
                continue
            for k in range(width):
                out[row, wheel, k] = columns[row, wheel, k]
            for lag in range(lagged.shape[0]):
                previous = lagged[lag, row]
                if previous >= rows or counted[previous, wheel] <= 0.0:
                    continue
                coefficient = lags[wheel, lag]
                for k in range(width):
                    out[row, wheel, k] -= coefficient * columns[previous, wheel, k]
            scale = math.sqrt(weight) / sigma[wheel]
            for k in range(width):
                out[row, wheel, k] *= scale
