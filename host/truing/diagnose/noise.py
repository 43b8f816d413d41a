"""The noise of the measured speeds, read from the recordings: autoregressive, one model per wheel.

What a correct model leaves over is no white noise. A differenced encoder count carries a moving average
of rounding errors, and a small disturbance of the torque reaches the speed through the wheel's own lag.
An autoregression of a few lags stands for both (any rational spectrum; Ljung 1999, section 4.2), so that
its innovations can be counted as independent samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from truing.model.compiled import compiled
from truing.model.kernel import FloatArray, IntArray

# Lags reach back this far, s; at 20 Hz six of them follow an encoder's moving average and a wheel's lag.
REACH_S = 0.3
LEAST_ORDER, LARGEST_ORDER = 4, 8
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
    """

    lags: FloatArray
    sigma: FloatArray
    rms: FloatArray

    @property
    def order(self) -> int:
        """Number of lags."""
        return int(self.lags.shape[1])

    def memory(self, wheel: int, interval_s: float) -> float:
        """Time over which the noise of a wheel forgets itself, s: the integral of its autocorrelation."""
        impulse = np.zeros(200)
        for k in range(len(impulse)):
            past = impulse[max(0, k - self.order) : k][::-1]
            impulse[k] = (1.0 if k == 0 else 0.0) + float(self.lags[wheel, : len(past)] @ past)
        power = float(impulse @ impulse)
        lagged = np.correlate(impulse, impulse, "full")[len(impulse) - 1 :] / max(power, 1e-300)
        return float(max(lagged[: np.argmax(lagged < 0.05) or None].sum(), 0.5) * interval_s)


def order_for(interval_s: float) -> int:
    """How many lags recordings with this sampling interval get."""
    return int(np.clip(round(REACH_S / max(interval_s, 1e-6)), LEAST_ORDER, LARGEST_ORDER))


def lag_index(starts: IntArray, rows: int, order: int) -> IntArray:
    """Row numbers of each row's predecessors, shape (order, n); `rows` stands for "before the segment"."""
    first = np.repeat(starts[:-1], np.diff(starts))
    index = np.arange(rows)
    lagged = np.stack([index - k for k in range(1, order + 1)])
    return np.asarray(np.where(lagged >= first, lagged, rows))


def estimate_noise(residual: FloatArray, counted: FloatArray, lagged: IntArray, floor: FloatArray) -> Noise:
    """Fit the autoregressions to what a model leaves over.

    Parameters
    ----------
    residual : shape (n, 2), m/s.
    counted : shape (n, 2), weights 0..1 of the rows (0: not measured, or judged by nobody).
    lagged : from `lag_index`.
    floor : shape (2,), m/s, the least RMS that the sensor's own resolution allows.
    """
    order = lagged.shape[0]
    lags, sigma, rms = np.zeros((2, order)), np.zeros(2), np.zeros(2)
    for wheel in range(2):
        weight = counted[:, wheel]
        r = np.where(weight > 0.0, residual[:, wheel], 0.0)
        past = np.append(r, 0.0)[lagged].T
        total = max(float(weight.sum()), 1.0)
        power = float(weight @ r**2) / total
        rms[wheel] = np.sqrt(max(power, floor[wheel] ** 2))
        gram = (past * weight[:, None]).T @ past + np.eye(order) * (RIDGE * max(power, 1e-18) * total)
        lags[wheel] = np.linalg.solve(gram, past.T @ (weight * r))
        innovations = r - past @ lags[wheel]
        sigma[wheel] = np.sqrt(max(float(weight @ innovations**2) / total, (0.5 * floor[wheel]) ** 2))
    return Noise(lags, sigma, rms)


def whiten(noise: Noise, columns: FloatArray, counted: FloatArray, lagged: IntArray) -> FloatArray:
    """Innovations in units of their RMS: (n, 2) or (n, 2, p) like `columns`; uncounted rows are zero."""
    flat = np.ascontiguousarray(columns.reshape(*columns.shape[:2], -1))
    out = np.zeros_like(flat)
    _whiten(flat, counted, lagged, noise.lags, noise.sigma, out)
    return out.reshape(columns.shape)


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
