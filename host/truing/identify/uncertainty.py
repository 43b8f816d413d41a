"""How well a least-squares fit pins its parameters down when the residuals are not white.

Neighbouring residuals of a simulation resemble each other, so that a run of a thousand rows may
hold ten independent errors. Each run's residuals are therefore taken as an autoregression, and
the deviation of the parameters under such noise is computed. Both steps flatter: a fit swallows
a part of the very noise it is judged by, most of all the slow part. How much it flatters is found
by repeating the whole procedure on noise of the fitted kind (a parametric bootstrap of the
studentised error), and the interval is widened by that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from truing.recording import FloatArray

# Longest memory that is looked for in the residuals, blocks.
LONGEST_MEMORY = 6
# Blocks per run that an autoregression needs for each of its coefficients.
BLOCKS_PER_COEFFICIENT = 8
# Repetitions on made-up noise, and the seed that makes them the same every time.
REPETITIONS = 200
SEED = 20_08
CONFIDENCE = 0.95
# Noise whose memory does not end within a run cannot be told from an offset.
LARGEST_ROOT = 0.99
# Two standard deviations hold 95 % when nothing flatters; no repetition may claim less.
LEAST_QUANTILE = 1.96


@dataclass(frozen=True, slots=True)
class _RunNoise:
    """One run in blocks: slopes (m, p), weighted slopes (m, p), and the noise model found in it."""

    slope: FloatArray
    gradient: FloatArray
    model: FloatArray
    innovation: float


def half_widths(
    jacobian: FloatArray, residual: FloatArray, weight: FloatArray, run_of: NDArray[np.intp], block: int = 1
) -> FloatArray:
    """Half widths of the 95 % intervals of the parameters, shape (p,).

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
    runs = []
    for run in np.unique(run_of):
        rows = (run_of == run) & (weight > 0.0)
        if not rows.any():
            continue
        noise = _block_means(residual[rows], block)
        slope = _block_means(jacobian[rows], block)
        # Slopes per block stand for all of its rows.
        gradient = _block_means(jacobian[rows] * weight[rows, None] ** 2, block) * (rows.sum() / len(noise))
        models, innovations = autoregressions(noise[None, :])
        runs.append(_RunNoise(slope, gradient, models[0], float(innovations[0])))
    inverse = np.linalg.pinv(np.sum([run.gradient.T @ run.slope for run in runs], axis=0))
    meats = [_meats(run.gradient, run.model[None, :], np.array([run.innovation]))[0] for run in runs]
    meat = np.sum(meats, axis=0)
    deviation = np.sqrt(np.diag(inverse @ meat @ inverse))
    return np.asarray(deviation * _studentised_quantile(runs, inverse))


def _studentised_quantile(runs: list[_RunNoise], inverse: FloatArray) -> FloatArray:
    """What the error is of its own estimated deviation, at 95 %, shape (p,), by repetition."""
    rng = np.random.default_rng(SEED)
    swallowed, _ = _refit(runs, inverse, rng)
    corrected = []
    for run, (models, innovations) in zip(runs, swallowed, strict=True):
        model = _stable(run.model, run.model - models.mean(axis=0))
        corrected.append(replace(run, model=model, innovation=run.innovation**2 / float(innovations.mean())))
    found, errors = _refit(corrected, inverse, rng)
    meat = np.zeros((REPETITIONS, *inverse.shape))
    for run, (models, innovations) in zip(runs, found, strict=True):
        meat += _meats(run.gradient, models, innovations)
    deviations = np.sqrt(np.einsum("ij,kjl,li->ki", inverse, meat, inverse))
    ratios = np.abs(errors) / np.maximum(deviations, 1e-300)
    return np.maximum(np.quantile(ratios, CONFIDENCE, axis=0), LEAST_QUANTILE)


def _refit(
    runs: list[_RunNoise], inverse: FloatArray, rng: np.random.Generator
) -> tuple[list[tuple[FloatArray, FloatArray]], FloatArray]:
    """Noise models found in the residuals of made-up noise, run by run, and the errors it caused (k, p)."""
    noises = []
    errors = np.zeros((REPETITIONS, inverse.shape[0]))
    for run in runs:
        m = len(run.slope)
        # A run-in of its own length lets the noise forget that it began at zero.
        shocks = rng.normal(0.0, np.sqrt(run.innovation), (2 * m, REPETITIONS))
        noise = _unwhiten(run.model, shocks)[m:].T
        noises.append(noise)
        errors += noise @ run.gradient @ inverse
    found = [autoregressions(noise - errors @ run.slope.T) for run, noise in zip(runs, noises, strict=True)]
    return found, errors


def _stable(model: FloatArray, correction: FloatArray) -> FloatArray:
    """The model with as much of a bias correction as leaves it stable (after Kilian, 1998)."""
    for share in np.linspace(1.0, 0.0, 21):
        corrected = model + share * correction
        if np.abs(np.roots(corrected)).max(initial=0.0) < LARGEST_ROOT:
            return np.asarray(corrected)
    return model


def autoregressions(noise: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Whitening filters (leading 1, zero padded), and innovation variances, of several residuals.

    Burg's recursion, which stays stable and is less biased on short records than autocovariances;
    order by Akaike's criterion for small samples. The mean is kept: an offset is an error too.

    Parameters
    ----------
    noise : shape (k, n).

    Returns
    -------
    Filters of shape (k, order + 1) and variances of shape (k,).
    """
    count, n = noise.shape
    longest = max(min(LONGEST_MEMORY, n // BLOCKS_PER_COEFFICIENT), 0)
    variance = np.mean(noise**2, axis=1)
    model = np.zeros((count, longest + 1))
    model[:, 0] = 1.0
    best, best_variance = model.copy(), variance.copy()
    best_score = np.full(count, np.inf)
    forward, backward = noise[:, 1:].copy(), noise[:, :-1].copy()
    for order in range(longest + 1):
        score = n * np.log(np.maximum(variance, 1e-300)) + 2.0 * (order + 1) * n / max(n - order - 2, 1)
        better = score < best_score
        best_score[better] = score[better]
        best[better], best_variance[better] = model[better], variance[better]
        if order == longest:
            break
        energy = np.sum(forward**2 + backward**2, axis=1)
        reflection = -2.0 * np.sum(forward * backward, axis=1) / np.maximum(energy, 1e-300)
        # Levinson's step: the filter plus its mirror image, shifted by one.
        mirrored = np.zeros_like(model)
        mirrored[:, 1 : order + 2] = model[:, order::-1] if order else model[:, :1]
        model = model + reflection[:, None] * mirrored
        variance = variance * (1.0 - reflection**2)
        forward, backward = (
            (forward + reflection[:, None] * backward)[:, 1:],
            (backward + reflection[:, None] * forward)[:, :-1],
        )
    return best, best_variance


def _meats(gradient: FloatArray, models: FloatArray, innovations: FloatArray) -> FloatArray:
    """J' R J for one run under several noise models, shape (k, p, p).

    R = s^2 (A'A)^-1 with A the whitening filter, so J'RJ = s^2 |A'^-1 J|^2; and A' is A backwards.
    """
    order = models.shape[1] - 1
    latest_last = models[:, :0:-1]
    n, parameters = gradient.shape
    shaped = np.zeros((order + n, len(models), parameters))
    for row, value in enumerate(gradient[::-1]):
        past = np.einsum("ki,ikp->kp", latest_last, shaped[row : row + order])
        shaped[row + order] = value - past
    return np.asarray(innovations[:, None, None] * np.einsum("nkp,nkq->kpq", shaped, shaped))


def _unwhiten(model: FloatArray, values: FloatArray) -> FloatArray:
    """Noise of the autoregression `model` driven by `values`, shape (n, k), along the first axis.

    (scipy.signal.lfilter does the same, at half a second of import time.)
    """
    order = min(int(np.flatnonzero(model)[-1]), len(values) - 1)
    bands = np.repeat(model[: order + 1, None], len(values), axis=1)
    return np.asarray(solve_banded((order, 0), bands, values))


def _block_means(values: FloatArray, block: int) -> FloatArray:
    """Means over `block` rows, shape (n // block, ...); rows left over at the end join the last block."""
    if block <= 1 or len(values) < 2 * block:
        return values
    starts = np.arange(0, len(values) - block + 1, block)
    lengths = np.diff(starts, append=len(values))
    sums = np.add.reduceat(values, starts, axis=0)
    return np.asarray(sums / (lengths if values.ndim == 1 else lengths[:, None]))
