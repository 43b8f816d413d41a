"""How well a least-squares fit pins its parameters down when the residuals are not white."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.special import stdtrit

from truing.recording import FloatArray

# Longest memory that is looked for in the residuals, blocks.
LONGEST_MEMORY = 6
# Blocks per run that an autoregression needs for each of its coefficients.
BLOCKS_PER_COEFFICIENT = 8


def covariance(
    jacobian: FloatArray, residual: FloatArray, weight: FloatArray, run_of: NDArray[np.intp], block: int = 1
) -> tuple[FloatArray, float]:
    """Covariance of the parameters, and the factor that makes a 95 % interval of a deviation.

    Each run's residuals are taken as an autoregression of their own order; the estimate's
    covariance under that noise is the sandwich (J'WJ)^-1 J'W R WJ (J'WJ)^-1. Samples that repeat
    each other count once: both the noise level and the Student factor use the effective number
    of samples, less the parameters that were fitted to them.

    Parameters
    ----------
    jacobian : shape (n, p), slope of the simulated speed in each parameter.
    residual : shape (n,), simulated minus measured.
    weight : shape (n,), square root of each row's weight, zero for rows that are not judged.
    run_of : shape (n,), which run a row belongs to; runs are independent.
    block : rows that are averaged before the noise is modelled. The slopes change little within
        it; what is quantised or repeated from row to row averages out instead of drowning the
        slow part of the noise, which is the part that moves the parameters.
    """
    scaled = jacobian * weight[:, None]
    inverse = np.linalg.pinv(scaled.T @ scaled)
    parameters = jacobian.shape[1]
    meat = np.zeros((parameters, parameters))
    effective = 0.0
    for run in np.unique(run_of):
        rows = (run_of == run) & (weight > 0.0)
        noise = _block_means(residual[rows], block)
        gradient = _block_means(jacobian[rows] * weight[rows, None] ** 2, block) * block
        model, innovation = autoregression(noise)
        # R = s^2 (A'A)^-1 with A the whitening filter, so J'RJ = s^2 |A'^-1 J|^2: filter backwards.
        shaped = lfilter([1.0], model, gradient[::-1], axis=0)
        meat += innovation * (shaped.T @ shaped)
        effective += _effective_samples(len(noise), model, innovation)
    freedom = max(effective - parameters, 2.0)
    spread = inverse @ meat @ inverse * (freedom + parameters) / freedom
    # scipy.stats would give the same quantile, and half a second of import time with it.
    return spread, float(stdtrit(freedom, 0.975))


def autoregression(noise: FloatArray) -> tuple[FloatArray, float]:
    """Whitening filter (leading 1) and innovation variance of a residual, shape (n,).

    Burg's recursion, which stays stable and is less biased on short records than autocovariances;
    order by Akaike's criterion for small samples. The mean is kept: an offset is an error too.
    """
    n = noise.size
    longest = max(min(LONGEST_MEMORY, n // BLOCKS_PER_COEFFICIENT), 0)
    variance = float(np.mean(noise**2)) if n else 0.0
    model = np.array([1.0])
    best_score, best = np.inf, (model, variance)
    forward, backward = noise[1:].copy(), noise[:-1].copy()
    for order in range(longest + 1):
        if variance <= 0.0 or n - order - 3 <= 0:
            break
        score = n * np.log(variance) + 2.0 * (order + 1) * n / (n - order - 2)
        if score < best_score:
            best_score, best = score, (model, variance)
        energy = float(forward @ forward + backward @ backward)
        if energy <= 0.0:
            break
        reflection = -2.0 * float(forward @ backward) / energy
        extended = np.append(model, 0.0)
        model = extended + reflection * extended[::-1]
        variance *= 1.0 - reflection**2
        forward, backward = (forward + reflection * backward)[1:], (backward + reflection * forward)[:-1]
    return best


def _block_means(values: FloatArray, block: int) -> FloatArray:
    """Means over `block` rows, shape (n // block, ...); the rest of an uneven end joins the last."""
    if block <= 1 or len(values) < 2 * block:
        return values
    starts = np.arange(0, len(values) - block + 1, block)
    sums = np.add.reduceat(values, starts, axis=0)
    return np.asarray(sums / block)


def _effective_samples(n: int, model: FloatArray, innovation: float) -> float:
    """How many independent samples a run's mean is worth, never more than it has."""
    if innovation <= 0.0 or n == 0:
        return float(n)
    impulse = np.zeros(8 * n)
    impulse[0] = 1.0
    variance = float(np.sum(lfilter([1.0], model, impulse) ** 2))
    long_run = 1.0 / float(np.sum(model)) ** 2
    return float(np.clip(n * variance / long_run, 1.0, n))
