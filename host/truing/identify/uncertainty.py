"""How well a least-squares fit pins its parameters down when the residuals are not white.

Neighbouring residuals of a simulation resemble each other, so that a run of a thousand rows may
hold ten independent errors. The residuals are therefore taken as an autoregression (of one shape
for all runs, as they come from one robot), and the deviation of the parameters under such noise
is computed. Both steps flatter: a fit swallows
a part of the very noise it is judged by, most of all the slow part. How much it flatters is found
by repeating the whole procedure on noise of the fitted kind (a parametric bootstrap of the
studentised error), and the interval is widened by that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truing.arrays import BoolArray, FloatArray

# Longest memory that is looked for in the residuals, blocks.
LONGEST_MEMORY = 6
# Blocks per run that an autoregression needs for each of its coefficients.
BLOCKS_PER_COEFFICIENT = 8
# Repetitions on made-up noise, and the seed that makes them the same every time.
REPETITIONS = 200
# So many of them are held at once, which bounds the memory.
AT_ONCE = 25
SEED = 20_08
CONFIDENCE = 0.95
# Noise whose memory does not end within a run cannot be distinguished from an offset.
LARGEST_ROOT = 0.99
TINY = 1e-300
# Directions of less information than this share of the largest, slopes taken at one size, are rounding
# errors; a parameter with this part of its direction in them is not determined.
MIN_POWER, MIN_PART = 1e-12, 1e-3
# Two standard deviations hold 95 % when nothing flatters; no repetition may claim less.
MIN_QUANTILE = 1.96


@dataclass(frozen=True, slots=True)
class NoiseModel:
    """Autoregressions of one shape for all runs, each run with a level of its own.

    Attributes
    ----------
    filters : shape (k, order + 1), whitening filters of k repetitions, each with a leading 1.
    innovations : shape (k, runs), variance of what the filter leaves.
    """

    filters: FloatArray
    innovations: FloatArray


@dataclass(frozen=True, slots=True)
class _RunBlocks:
    """One run in blocks: slopes of the simulation, and the same weighted, both of shape (m, p)."""

    slope: FloatArray
    gradient: FloatArray


def half_widths(
    jacobian: FloatArray, residual: FloatArray, weight: FloatArray, run_of: NDArray[np.intp], block: int = 1
) -> FloatArray:
    """Half widths of the parameters' 95 % intervals, shape (p,); infinite where the rows determine none.

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
    runs, noises = [], []
    for run in np.unique(run_of[weight > 0.0]):
        rows = (run_of == run) & (weight > 0.0)
        slope = _block_means(jacobian[rows], block)
        # A block's weighted slope stands for all of its rows.
        rows_per_block = float(rows.sum()) / len(slope)
        weighted = _block_means(jacobian[rows] * weight[rows, None] ** 2, block)
        runs.append(_RunBlocks(slope, rows_per_block * weighted))
        noises.append(_block_means(residual[rows], block)[None, :])
    inverse, determined = _inverse(np.sum([run.gradient.T @ run.slope for run in runs], axis=0))
    found = fit_noise(noises)
    deviation = _deviations(runs, found, inverse)[0]
    return np.where(determined, deviation * _studentised_quantile(runs, found, inverse), np.inf)


def _inverse(information: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Inverse (p, p) of an information matrix where it has one, and the parameters (p,) that it determines.

    Parameters that change the speed alike, gain and time constant of a wheel that never settles, are
    determined together only; rounding errors would stand for the variance of each.
    """
    size = np.sqrt(np.maximum(np.abs(np.diag(information)), TINY))
    left, power, right = np.linalg.svd(information / np.outer(size, size))
    known = power > MIN_POWER * max(float(power[0]), MIN_POWER)
    inverse = (right[known].T / power[known]) @ left[:, known].T / np.outer(size, size)
    return inverse, np.asarray((np.abs(right[~known]) < MIN_PART).all(axis=0))


def rounding_half_widths(jacobian: FloatArray, weight: FloatArray, resolution_mps: float) -> FloatArray:
    """Half widths (p,) that the rounding of the speed causes by itself: no interval is narrower.

    A row of counts that happens to repeat itself leaves no residual, and yet its speed is known to half a
    count at either end of its interval only (variance of the difference of two uniform errors: 1/6).

    Parameters
    ----------
    jacobian, weight : as in `half_widths`.
    resolution_mps : smallest step that the speed can show.
    """
    weighted = jacobian * weight[:, None]
    inverse = np.linalg.pinv(weighted.T @ weighted)
    # An error of a row enters by its squared weight.
    spread = (jacobian * weight[:, None] ** 2) @ inverse
    deviation = resolution_mps / np.sqrt(6.0) * np.sqrt(np.sum(spread**2, axis=0))
    return np.asarray(MIN_QUANTILE * deviation)


def _studentised_quantile(runs: list[_RunBlocks], found: NoiseModel, inverse: FloatArray) -> FloatArray:
    """What the error is of its own estimated deviation, at 95 %, shape (p,), by repetition."""
    rng = np.random.default_rng(SEED)
    swallowed, _ = _refit(runs, found, inverse, rng)
    # The memory that is found is shorter than the memory that was put in: put in more.
    model = _stable(found.filters[0], found.filters[0] - swallowed.filters.mean(axis=0))
    level = found.innovations**2 / np.maximum(swallowed.innovations.mean(axis=0), TINY)
    again, errors = _refit(runs, NoiseModel(model[None, :], level), inverse, rng)
    ratios = np.abs(errors) / np.maximum(_deviations(runs, again, inverse), 1e-300)
    return np.asarray(np.maximum(np.quantile(ratios, CONFIDENCE, axis=0), MIN_QUANTILE))


def _refit(
    runs: list[_RunBlocks], noise: NoiseModel, inverse: FloatArray, rng: np.random.Generator
) -> tuple[NoiseModel, FloatArray]:
    """Noise models found behind fits to made-up noise, and the errors that the noise caused, shape (k, p)."""
    made = [_refit_some(runs, noise, inverse, rng) for _ in range(REPETITIONS // AT_ONCE)]
    found = NoiseModel(
        np.concatenate([model.filters for model, _ in made]),
        np.concatenate([model.innovations for model, _ in made]),
    )
    return found, np.concatenate([errors for _, errors in made])


def _refit_some(
    runs: list[_RunBlocks], noise: NoiseModel, inverse: FloatArray, rng: np.random.Generator
) -> tuple[NoiseModel, FloatArray]:
    noises = []
    errors = np.zeros((AT_ONCE, inverse.shape[0]))
    for run, variance in zip(runs, noise.innovations[0], strict=True):
        m = len(run.slope)
        # A run-in of its own length lets the noise forget that it began at zero.
        shocks = rng.normal(0.0, np.sqrt(variance), (2 * m, AT_ONCE))
        noises.append(_unwhiten(noise.filters[0], shocks)[m:].T)
        errors += noises[-1] @ run.gradient @ inverse.T
    rest = [values - errors @ run.slope.T for run, values in zip(runs, noises, strict=True)]
    return fit_noise(rest), errors


def _deviations(runs: list[_RunBlocks], noise: NoiseModel, inverse: FloatArray) -> FloatArray:
    """Standard deviations of the parameters under each of k noise models, shape (k, p)."""
    meat = np.zeros((len(noise.filters), *inverse.shape))
    for number, run in enumerate(runs):
        meat += _meats(run.gradient, noise.filters, noise.innovations[:, number])
    # Of a variance that rounding errors are larger than, nothing is left.
    return np.asarray(np.sqrt(np.maximum(np.einsum("ij,kjl,il->ki", inverse, meat, inverse), 0.0)))


def _stable(model: FloatArray, correction: FloatArray) -> FloatArray:
    """The model with as much of a bias correction as leaves it stable (after Kilian, 1998)."""
    for share in np.linspace(1.0, 0.0, 21):
        corrected = model + share * correction
        if np.abs(np.roots(corrected)).max(initial=0.0) < LARGEST_ROOT:
            return np.asarray(corrected)
    return model


def fit_noise(noises: Sequence[FloatArray]) -> NoiseModel:
    """The autoregression of one robot's residuals: a shape for all runs, a level for each.

    Burg's recursion, which stays stable and is less biased on short records than autocovariances;
    order by Akaike's criterion for small samples. The mean is kept: an offset is an error too.

    Parameters
    ----------
    noises : one array per run, shape (k, n) each: k repetitions of a residual.
    """
    count = noises[0].shape[0]
    n = sum(noise.shape[1] for noise in noises)
    shortest = min(noise.shape[1] for noise in noises)
    longest = max(min(LONGEST_MEMORY, n // BLOCKS_PER_COEFFICIENT, shortest - 2), 0)
    powers = np.stack([np.mean(noise**2, axis=1) for noise in noises], axis=1)
    sizes = np.sqrt(np.maximum(powers, TINY))
    scaled = [noise / size[:, None] for noise, size in zip(noises, sizes.T, strict=True)]
    forward = [noise[:, 1:] for noise in scaled]
    backward = [noise[:, :-1] for noise in scaled]
    model, share = np.zeros((count, longest + 1)), np.ones(count)
    model[:, 0] = 1.0
    best, best_share, best_score = model.copy(), share.copy(), np.full(count, np.inf)
    for order in range(longest + 1):
        score = n * np.log(np.maximum(share, TINY)) + 2.0 * (order + 1) * n / max(n - order - 2, 1)
        better = score < best_score
        best_score[better] = score[better]
        best[better], best_share[better] = model[better], share[better]
        if order == longest:
            break
        product, energy = np.zeros(count), np.zeros(count)
        for f, b in zip(forward, backward, strict=True):
            product += np.einsum("kn,kn->k", f, b)
            energy += np.einsum("kn,kn->k", f, f) + np.einsum("kn,kn->k", b, b)
        reflection = -2.0 * product / np.maximum(energy, TINY)
        # Levinson's step: the filter plus its mirror image, shifted by one.
        mirrored = np.zeros_like(model)
        mirrored[:, 1 : order + 2] = model[:, order::-1] if order else model[:, :1]
        model = model + reflection[:, None] * mirrored
        share = share * (1.0 - reflection**2)
        k = reflection[:, None]
        forward, backward = (
            [(f + k * b)[:, 1:] for f, b in zip(forward, backward, strict=True)],
            [(b + k * f)[:, :-1] for f, b in zip(forward, backward, strict=True)],
        )
    return NoiseModel(best, powers * best_share[:, None])


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
    from scipy.linalg import solve_banded

    order = min(int(np.flatnonzero(model)[-1]), len(values) - 1)
    bands = np.repeat(model[: order + 1, None], len(values), axis=1)
    return np.asarray(solve_banded((order, 0), bands, values, check_finite=False))


def _block_means(values: FloatArray, block: int) -> FloatArray:
    """Means over `block` rows, shape (n // block, ...); rows left over at the end join the last block."""
    if block <= 1 or len(values) < 2 * block:
        return values
    starts = np.arange(0, len(values) - block + 1, block)
    lengths = np.diff(starts, append=len(values))
    sums = np.add.reduceat(values, starts, axis=0)
    return np.asarray(sums / (lengths if values.ndim == 1 else lengths[:, None]))
