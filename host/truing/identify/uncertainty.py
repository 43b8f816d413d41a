"""How well a least-squares fit pins its parameters down when the residuals are not white."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter
from scipy.stats import t as student_t

from truing.recording import FloatArray

# Longest memory that is looked for in the residuals, rows.
LONGEST_MEMORY = 12


def covariance(
    jacobian: FloatArray, residual: FloatArray, weight: FloatArray, run_of: NDArray[np.intp]
) -> tuple[FloatArray, float]:
    """Covariance of the parameters, and the factor that makes a 95 % interval of a deviation.

    Each run's residuals are taken as an autoregression of their own order; the estimate's
    covariance under that noise is the sandwich (J'WJ)^-1 J'W R WJ (J'WJ)^-1. Samples that repeat
    each other count once: the Student factor uses the effective number of them.

    Parameters
    ----------
    jacobian : shape (n, p), slope of the simulated speed in each parameter.
    residual : shape (n,), simulated minus measured.
    weight : shape (n,), square root of each row's weight, zero for rows that are not judged.
    run_of : shape (n,), which run a row belongs to; runs are independent.
    """
    scaled = jacobian * weight[:, None]
    inverse = np.linalg.pinv(scaled.T @ scaled)
    judged = int((weight > 0.0).sum())
    parameters = jacobian.shape[1]
    inflation = judged / max(judged - parameters, 1)
    meat = np.zeros((parameters, parameters))
    effective = 0.0
    for run in np.unique(run_of):
        rows = (run_of == run) & (weight > 0.0)
        model, innovation = autoregression(residual[rows])
        gradient = jacobian[rows] * weight[rows, None] ** 2
        # R = s^2 (A'A)^-1 with A the whitening filter, so J'RJ = s^2 |A'^-1 J|^2: filter backwards.
        shaped = lfilter([1.0], model, gradient[::-1], axis=0)
        meat += innovation * inflation * (shaped.T @ shaped)
        effective += _effective_samples(int(rows.sum()), model, innovation)
    spread = inverse @ meat @ inverse
    freedom = max(effective - parameters, 1.0)
    return spread, float(student_t.ppf(0.975, freedom))


def autoregression(residual: FloatArray) -> tuple[FloatArray, float]:
    """Whitening filter (leading 1) and innovation variance of a residual; order by Akaike's criterion.

    Parameters
    ----------
    residual : shape (n,), one run.
    """
    n = residual.size
    longest = min(LONGEST_MEMORY, n // 8)
    # The mean is not removed: a residual's offset is an error too.
    lags = np.array([residual[: n - lag] @ residual[lag:] for lag in range(longest + 1)]) / n
    best_score, best = np.inf, (np.array([1.0]), float(lags[0]))
    if lags[0] <= 0.0:
        return best
    for order in range(longest + 1):
        if order == 0:
            model, innovation = np.array([1.0]), float(lags[0])
        else:
            coefficients = solve_toeplitz(lags[:order], lags[1 : order + 1])
            model = np.concatenate(([1.0], -coefficients))
            innovation = float(lags[0] - coefficients @ lags[1 : order + 1])
        if innovation <= 0.0:
            break
        score = n * np.log(innovation) + 2.0 * (order + 1)
        if score < best_score:
            best_score, best = score, (model, innovation)
    return best


def _effective_samples(n: int, model: FloatArray, innovation: float) -> float:
    """How many independent samples a run's mean is worth, never more than it has."""
    if innovation <= 0.0:
        return float(n)
    impulse = np.zeros(4 * n)
    impulse[0] = 1.0
    variance = float(np.sum(lfilter([1.0], model, impulse) ** 2))
    long_run = 1.0 / float(np.sum(model)) ** 2
    return float(np.clip(n * variance / long_run, 1.0, n))
