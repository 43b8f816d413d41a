"""Autoregressive noise model of the measured wheel speeds, estimated from residuals, one per wheel.

The residual of a correct model is not white. A differenced encoder count carries a moving average of
quantisation errors, and a small torque disturbance reaches the speed through the wheel's own lag. An
autoregression approximates both (any rational spectrum; Ljung 1999, section 4.2), so that its innovations
can be counted as independent samples. At high log rates its coefficients are constant over spans of rows
that grow with their distance: means of the past show a slow disturbance under the counts' noise, which single
rows hide.

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

# Longest lag, s; at 20 Hz six lags represent an encoder's moving average and a wheel's lag.
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
    lags : shape (2, order); e_k = r_k - sum_j lags[w, j] mean(r over the span j before row k) is white.
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


@dataclass(frozen=True, slots=True)
class Past:
    """The rows before each row that the autoregression takes.

    Attributes
    ----------
    nearest, farthest : shape (order,), rows back, the span that each coefficient multiplies the mean of.
    first : shape (n,), the first row of each row's segment: no span reaches before it.
    """

    nearest: IntArray
    farthest: IntArray
    first: IntArray

    @property
    def order(self) -> int:
        """Coefficients per wheel."""
        return len(self.nearest)


def past_of(starts: IntArray, interval_s: float) -> Past:
    """The past of every row of these segments, shape (segments + 1,), at this sampling interval."""
    ends = farthest_rows(interval_s)
    return Past(
        np.concatenate(([1], ends[:-1] + 1)), ends, np.repeat(starts[:-1], np.diff(starts)).astype(np.int64)
    )


def farthest_rows(interval_s: float) -> IntArray:
    """Last row of each span, in rows back, shape (order,): single rows, then spaced geometrically."""
    reach = int(max(round(MAX_LAG_S / max(interval_s, 1e-6)), MIN_ORDER))
    if reach <= MAX_ORDER:
        return np.arange(1, reach + 1)
    return np.unique(np.round(np.geomspace(1.0, reach, MAX_ORDER)).astype(np.int64))


def _mean_over_spans(past: Past) -> FloatArray:
    """Matrix, shape (order, reach), that takes the rows 1, 2, ... back to the means of the spans."""
    back = np.arange(1, int(past.farthest[-1]) + 1)
    within = (back >= past.nearest[:, None]) & (back <= past.farthest[:, None])
    return np.asarray(within / within.sum(axis=1, keepdims=True))


def _rows_back(past: Past, count: int) -> IntArray:
    """Row indices 1, 2, ... rows back, shape (count, n); n marks a row before the segment."""
    rows = len(past.first)
    back = np.arange(rows) - np.arange(1, count + 1)[:, None]
    return np.asarray(np.where(back >= past.first, back, rows))


def white_noise(past: Past, rms_mps: float) -> Noise:
    """White noise of this size: under it a fit minimises the free-run error itself."""
    rms = np.full(2, rms_mps)
    return Noise(np.zeros((2, past.order)), rms, rms.copy(), rms.copy(), np.zeros(2))


def estimate_noise(
    residual: FloatArray,
    counted: FloatArray,
    past: Past,
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
    decay_s : shape (2,), s, correlations are multiplied by an exponential with this time constant.
    floor : shape (2,), m/s, lower bound of the RMS from the sensor's resolution.
    ceiling : shape (2,), m/s, upper bound of the RMS that noise of these recordings can have.
    """
    reach = int(past.farthest[-1])
    index, mean_over_spans = _rows_back(past, reach), _mean_over_spans(past)
    noise = Noise(np.zeros((2, past.order)), np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2))
    compared_rows = max(round(COMPARED_S / max(interval_s, 1e-6)), 1)
    rows_apart = np.abs(np.subtract.outer(np.arange(reach), np.arange(reach)))
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
        gram = (
            mean_over_spans @ covariance[rows_apart] @ mean_over_spans.T + np.eye(past.order) * RIDGE * power
        )
        noise.lags[wheel] = np.linalg.solve(gram, mean_over_spans @ covariance[1:])
        innovations = r - r_past.T @ (noise.lags[wheel] @ mean_over_spans)
        innovation_power = float(innovations @ innovations / max(weight @ weight, 1.0))
        noise.rms[wheel] = min(np.sqrt(power), ceiling[wheel])
        rows_per_sample = _correlated_rows(innovations, past) if power > ceiling[wheel] ** 2 else 1.0
        noise.sigma[wheel] = np.sqrt(max(innovation_power, (0.5 * floor[wheel]) ** 2) * rows_per_sample)
        correlation = covariance / power
        cutoff = int(np.argmax(correlation < 0.05)) or len(correlation)
        noise.memory_s[wheel] = max(float(correlation[:cutoff].sum()) - 0.5, 0.5) * interval_s
    return noise


def _power_of_means(power: float, cross: FloatArray, rows: int) -> float:
    """Mean square of means over so many rows, from the covariances at lags 1 and more."""
    lag = np.arange(1, min(rows, len(cross) + 1))
    return max((power + 2.0 * float((1.0 - lag / rows) @ cross[: len(lag)])) / rows, 0.0)


def _correlated_rows(values: FloatArray, past: Past) -> float:
    """Rows per independent sample, at least 1: 1 + 2 times the summed autocorrelation (Bartlett 1946)."""
    power = float(values @ values)
    if power <= 0.0:
        return 1.0
    rows = 1.0
    for lag in range(1, MAX_CORRELATED_ROWS):
        same = past.first[lag:] == past.first[:-lag]
        correlation = float((values[lag:] * values[:-lag])[same].sum()) / power
        if correlation < 0.05:
            break
        rows += 2.0 * correlation
    return rows


def whiten(noise: Noise, columns: FloatArray, counted: FloatArray, past: Past) -> FloatArray:
    """Innovations in units of their RMS: (n, 2) or (n, 2, p) like `columns`; uncounted rows are zero."""
    flat = np.ascontiguousarray(columns.reshape(*columns.shape[:2], -1))
    out = np.zeros_like(flat)
    spans = np.stack((past.nearest, past.farthest), axis=1)
    _whiten(flat, counted, past.first, spans, noise.lags, noise.sigma, out)
    return out.reshape(columns.shape)


def whiten_wheel(
    noise: Noise, columns: FloatArray, wheel: int, counted: FloatArray, past: Past
) -> FloatArray:
    """Innovations of one wheel's columns (n, p), likewise."""
    own = slice(wheel, wheel + 1)
    of_wheel = Noise(
        noise.lags[own], noise.sigma[own], noise.rms[own], noise.compared[own], noise.memory_s[own]
    )
    return whiten(of_wheel, columns[:, None], np.ascontiguousarray(counted[:, own]), past)[:, 0]


def predicted_uncertainty(noise: Noise, uncertainty: FloatArray, past: Past) -> FloatArray:
    """Uncertainty of the autoregressive prediction of each row, shape (n, 2), m/s.

    Parameters
    ----------
    uncertainty : shape (n, 2), m/s, of each row itself.
    """
    padded = np.concatenate((uncertainty, np.zeros((1, 2))))  # index n: no such predecessor
    weights = np.abs(noise.lags) @ _mean_over_spans(past)
    index = _rows_back(past, weights.shape[1])
    return np.asarray(np.einsum("knw,wk->nw", padded[index], weights))


@compiled
def _whiten(
    columns: FloatArray,
    counted: FloatArray,
    first: IntArray,
    spans: IntArray,
    lags: FloatArray,
    sigma: FloatArray,
    out: FloatArray,
) -> None:
    rows, wheels, width = columns.shape
    before = np.zeros((rows + 1, width))  # sums of the counted rows before each row
    for wheel in range(wheels):
        for row in range(rows):
            for k in range(width):
                own = columns[row, wheel, k] if counted[row, wheel] > 0.0 else 0.0
                before[row + 1, k] = before[row, k] + own
        for row in range(rows):
            weight = counted[row, wheel]
            if weight <= 0.0:
                continue
            for k in range(width):
                out[row, wheel, k] = columns[row, wheel, k]
            for lag in range(len(spans)):
                nearest, farthest = spans[lag]
                start, stop = max(row - farthest, first[row]), row - nearest + 1
                if stop <= start:
                    continue
                coefficient = lags[wheel, lag] / (farthest - nearest + 1)
                single = nearest == farthest
                if single and counted[start, wheel] <= 0.0:
                    continue
                for k in range(width):
                    total = columns[start, wheel, k] if single else before[stop, k] - before[start, k]
                    out[row, wheel, k] -= coefficient * total
            scale = math.sqrt(weight) / sigma[wheel]
            for k in range(width):
                out[row, wheel, k] *= scale
