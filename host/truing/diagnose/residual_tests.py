"""Residual tests: predictable structure, by cross-validated regression, and bursts.

The residual of a complete model is unpredictable. A wide linear basis (powers and products of effort and
speed, terms near standstill, past efforts, elapsed time, wheel angle, heading, place) is fitted to the
residual of some runs by ridge regression and evaluated on the others. The share of the residual's energy
that is predicted out of sample is structure; no physical effect is attached to it.

The regressors are taken from the *simulated* speed: the measured speed contains the disturbance, which
would make the residual of every correct model look predictable.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truing.arrays import FloatArray, IntArray
from truing.diagnose.data.set_data import SetData
from truing.diagnose.distributions import chi2_quantile, chi2_quantiles
from truing.diagnose.fit import Fit
from truing.diagnose.held_out import folds_of
from truing.diagnose.noise import Noise, Past, whiten, whiten_wheel
from truing.diagnose.problem import Problem
from truing.model.compiled import compiled

RIDGES = (3.0, 30.0, 300.0, 3000.0)
# Longest lag of the past-effort regressors, s.
HISTORY_S = 0.5
# Frequencies, Hz, and damping ratio of the transients in the basis: a tenth off a frequency is still found.
TRANSIENT_HZ, TRANSIENT_DAMPING = np.geomspace(0.6, 3.5, 11), 0.06
# Radial basis functions over the floor along each axis.
PLACE_BASIS_COUNT = 6
# Length of the stretches in which bursts are tested, s.
BURST_S = 0.4
# Stretches from which a run's own noise level is estimated.
MIN_STRETCHES = 8


@dataclass(frozen=True, slots=True)
class Structure:
    """The part of a residual that is predictable out of sample.

    Attributes
    ----------
    share : shape (2,), of each wheel's whitened residual energy, on runs left out of the regression.
    error : shape (2,), standard error of the share over runs.
    predicted_runs : shape (2,), share of the runs in which the prediction reduces the energy.
    predicted : shape (n, 2), m/s, the prediction (each run from the others).
    """

    share: FloatArray
    error: FloatArray
    predicted_runs: FloatArray
    predicted: FloatArray

    @property
    def times_noise(self) -> FloatArray:
        """RMS of the structure over RMS of the rest, shape (2,), from shares of the whitened energy."""
        share = np.clip(self.share, 0.0, 0.99)
        return np.asarray(np.sqrt(share / (1.0 - share)))


def find_structure(
    data: SetData,
    residual: FloatArray,
    speeds: FloatArray,
    taus: FloatArray,
    noise: Noise,
    counted: FloatArray,
    past: Past,
    folds: IntArray,
) -> Structure:
    """Cross-validated regression of the residual on the basis.

    Parameters
    ----------
    residual, speeds : shape (n, 2), m/s, measured minus simulated, and simulated.
    taus : shape (2,), s, the wheels' time constants: torque regressors are filtered with them.
    folds : shape (n,), which group of runs each row belongs to.
    """
    share, error, predicted_runs = np.zeros(2), np.zeros(2), np.zeros(2)
    predicted = np.zeros_like(residual)
    target = whiten(noise, residual, counted, past)
    runs = np.unique(data.run_of_row)
    for wheel in data.judged_sides:
        basis = features(data, speeds, wheel, float(taus[wheel]))
        white = whiten_wheel(noise, basis, wheel, counted, past)
        scale = np.sqrt(np.mean(white**2, axis=0)) + 1e-12
        y = np.clip(target[:, wheel], -4.0, 4.0)
        prediction, weights = _cross_validated(white / scale, y, folds)
        for group, weight in weights.items():
            predicted[folds == group, wheel] = (basis[folds == group] / scale) @ weight
        gain = y**2 - (y - prediction) ** 2
        total = max(float(np.sum(y**2)), 1e-12)
        share[wheel] = float(gain.sum()) / total
        by_run = np.array([gain[data.run_of_row == run].sum() for run in runs])
        error[wheel] = float(np.sqrt(np.sum((by_run - by_run.mean()) ** 2)) / total)
        predicted_runs[wheel] = float((by_run > 0.0).mean())
    return Structure(share, error, predicted_runs, predicted)


def _cross_validated(
    regressors: FloatArray, y: FloatArray, folds: IntArray
) -> tuple[FloatArray, dict[int, FloatArray]]:
    """Ridge regression of `y` (n,) without each fold in turn, by the penalty that predicts best.

    Returns
    -------
    Prediction of each row by the regression without its fold, shape (n,), and the weights (f,) of each fold.
    """
    groups = [int(group) for group in np.unique(folds)]
    parts = {g: regressors[folds == g] for g in groups}
    grams = {g: part.T @ part for g, part in parts.items()}
    moments = {g: part.T @ y[folds == g] for g, part in parts.items()}
    width = regressors.shape[1]
    others = {
        g: (
            sum((grams[h] for h in groups if h != g), np.zeros((width, width))),
            sum((moments[h] for h in groups if h != g), np.zeros(width)),
        )
        for g in groups
    }
    best, prediction = np.inf, np.zeros_like(y)
    weights: dict[int, FloatArray] = {}
    for ridge in RIDGES:
        trial, kept = np.zeros_like(y), {}
        for g, (gram, moment) in others.items():
            kept[g] = np.linalg.solve(gram + ridge * np.eye(width), moment)
            trial[folds == g] = parts[g] @ kept[g]
        cost = float(np.sum((y - trial) ** 2))
        if cost < best:
            best, prediction, weights = cost, trial, kept
    return prediction, weights


def features(data: SetData, speeds: FloatArray, wheel: int, tau: float) -> FloatArray:
    """Regressors of one wheel, shape (n, f): torque terms filtered by the wheel's lag, and direct ones."""
    u, v = data.effort[:, wheel], speeds[:, wheel]
    top = max(float(np.max(np.abs(speeds))), 1e-6)
    x = v / top
    time = _elapsed(data)
    moving = np.abs(v) > 1e-3 * top
    sign = np.where(moving, np.sign(v), 0.0)
    torque = [
        u,
        u * np.abs(u),
        u**3,
        np.abs(u),
        u**2,
        x * np.abs(x),
        x**3,
        np.abs(x),
        x**2,
        sign,
        sign * np.exp(-np.abs(x) / 0.05),
        sign * np.exp(-np.abs(x) / 0.15),
        np.sign(u) * (np.abs(u) < 0.12),
        u * x,
        u * np.abs(x),
        u - x,
        np.maximum(np.abs(u) - 0.7, 0.0) * np.sign(u),
        (u == 0.0) * x,
        np.where(u * x < 0.0, x, 0.0),
        np.where(u * x < 0.0, u, 0.0),
        time * u,
        time * x,
        time * sign,
        time**2 * u,
        time**2 * x,
        _heat(data, wheel) * u,
        u * np.abs(u - x),
    ]
    driven = u
    if len(data.sides) == 2:
        other, z = data.effort[:, 1 - wheel], speeds[:, 1 - wheel] / top
        driven = 0.5 * (u + other)
        torque += [
            other,
            np.abs(other) * np.sign(u),
            z,
            x - z,
            np.sign(x - z) * (np.abs(x - z) > 0.02),
            np.abs(u) * u * (np.abs(other)),
        ]
    angle = None if data.angle_rad is None else data.angle_rad[:, wheel]
    if angle is not None:
        torque += [trig(k * angle) * moving for k in (1, 2, 3, 4, 6) for trig in (np.sin, np.cos)]
    if data.heading_rad is not None:
        torque += [np.sin(data.heading_rad), np.cos(data.heading_rad)]
        place = _place(data)
        torque += [radial * direction for radial in _place_basis(place) for direction in (sign, x)]
        torque += _position_forces(data, place, data.heading_rad)
    through = _lag(data, np.stack(torque, axis=1), tau)
    plain = [x, x * np.abs(x), x**3, np.abs(x), time * x, *_steps(data, u)]
    plain += _transients(data, driven)
    if angle is not None:
        plain += [trig(k * angle) * x for k in (1, 2) for trig in (np.sin, np.cos)]
    return np.concatenate((through, np.stack(plain, axis=1)), axis=1)


def _place(data: SetData) -> FloatArray:
    """Position, shape (n, 2), m: from outside, or dead reckoning from each run's start."""
    assert data.heading_rad is not None
    if np.isfinite(data.truth).all():
        return np.asarray(data.truth[:, :2])
    step = np.zeros(len(data))
    step[1:] = np.diff(data.travel_m.mean(axis=1))
    step[data.first] = 0.0
    heading = data.heading_rad
    place = np.stack([step * np.cos(heading), step * np.sin(heading)], axis=1)
    for a, b in zip(data.starts[:-1], data.starts[1:], strict=True):
        place[a:b] = np.cumsum(place[a:b], axis=0)
    return place


def _place_basis(place: FloatArray) -> list[FloatArray]:
    """Gaussian radial basis over the area that the robot covered, each (n,)."""
    low, high = np.percentile(place, (2, 98), axis=0)
    size = np.maximum((high - low) / (PLACE_BASIS_COUNT - 1), 0.05)
    basis = []
    for i in range(PLACE_BASIS_COUNT):
        for j in range(PLACE_BASIS_COUNT):
            centre = low + size * (i, j)
            radial = np.exp(-0.5 * np.sum(((place - centre) / (0.6 * size)) ** 2, axis=1))
            if radial.mean() > 2e-3:
                basis.append(radial)
    return basis


def _position_forces(data: SetData, place: FloatArray, heading: FloatArray) -> list[FloatArray]:
    """Forces along the heading proportional to the distance from a run's start or from the mean position."""
    runs = np.unique(data.run_of_row, return_inverse=True)[1]
    begins = np.unique(data.run_of_row, return_index=True)[1]
    out = []
    for away in (place - place[begins][runs], place - place.mean(axis=0)):
        away = away / max(float(np.sqrt(np.mean(away**2))), 1e-6)
        out += [away[:, i] * turned for i in range(2) for turned in (np.cos(heading), np.sin(heading))]
    return out


def _steps(data: SetData, u: FloatArray) -> list[FloatArray]:
    """Changes of effort at lags 0 to HISTORY_S; zero before a segment starts."""
    first = np.repeat(data.starts[:-1], np.diff(data.starts))
    index = np.arange(len(u))
    change = np.where(index > first, u - u[np.maximum(index - 1, 0)], 0.0)
    lags = range(max(2, min(10, round(HISTORY_S / interval_of(data)))))
    stride = max(1, round(HISTORY_S / interval_of(data) / 10))
    out = []
    for k in lags:
        back = index - k * stride
        out.append(np.where(back >= first, change[np.maximum(back, 0)], 0.0))
    return out


def _transients(data: SetData, u: FloatArray) -> list[FloatArray]:
    """Damped oscillations after changes of effort, in phase and quadrature; at rest before a segment."""
    interval_s = interval_of(data)
    change = np.diff(u, prepend=u[0])
    change[data.first] = 0.0
    out = []
    for hertz in TRANSIENT_HZ[TRANSIENT_HZ * interval_s < 0.2]:
        pole = np.exp(2.0 * np.pi * hertz * interval_s * (1j - TRANSIENT_DAMPING))
        transient = _one_pole(1.0, pole, change, data.starts)
        out += [transient.real, transient.imag]
    return out


def _lag(data: SetData, columns: FloatArray, tau: float) -> FloatArray:
    """First-order lag of each column within each segment (exact for even steps)."""
    keep = float(np.exp(-interval_of(data) / max(tau, 1e-3)))
    return _one_pole(1.0 - keep, keep, columns, data.starts)


def _one_pole(gain: float, pole: complex, values: FloatArray, starts: IntArray) -> NDArray[Any]:
    """y[n] = pole y[n - 1] + gain values[n], along the first axis; from zero at each of `starts`.

    (scipy.signal.lfilter does the same, at half a second of import time.)
    """
    columns = np.ascontiguousarray(values if values.ndim > 1 else values[:, None])
    out = np.empty(columns.shape, dtype=np.result_type(pole, columns))
    _recursion(gain, pole, columns, starts, out)
    return out.reshape(values.shape)


@compiled
def _recursion(
    gain: float,
    pole: complex,
    values: NDArray[np.floating[Any]],
    starts: IntArray,
    out: NDArray[np.inexact[Any]],
) -> None:
    for segment in range(len(starts) - 1):
        for column in range(values.shape[1]):
            last = 0.0 * pole
            for row in range(starts[segment], starts[segment + 1]):
                last = pole * last + gain * values[row, column]
                out[row, column] = last


def _elapsed(data: SetData) -> FloatArray:
    """Time over the whole set, 0 to 1."""
    time = data.elapsed_s
    return np.asarray((time - time[0]) / max(float(time[-1] - time[0]), 1e-9))


def _heat(data: SetData, wheel: int) -> FloatArray:
    """Squared effort through a lag of half a minute: winding heating or battery discharge."""
    keep = float(np.exp(-interval_of(data) / 30.0))
    return _one_pole(1.0 - keep, keep, data.effort[:, wheel] ** 2, data.starts[[0, -1]])


def interval_of(data: SetData) -> float:
    """The usual time between rows over the whole set, s."""
    return float(np.median(data.interval_s))


@dataclass(frozen=True, slots=True)
class Bursts:
    """Stretches in which a residual is larger than its typical noise level allows.

    Attributes
    ----------
    share : shape (2,), of each wheel's whitened energy in bursts beyond chance.
    rows : shape (n, 2), whether a row lies in a burst.
    """

    share: FloatArray
    rows: FloatArray


def find_bursts(data: SetData, white: FloatArray) -> Bursts:
    """Energy of stretches in excess of Gaussian innovations of the typical variance.

    The typical variance is that of the median stretch in which the wheel moves, of the set, or of its run
    where that is larger; a stretch is a burst beyond the 99.99 % quantile. Remaining correlation of the
    innovations reduces the degrees of freedom of a stretch.
    """
    rows_per_stretch = max(2, round(BURST_S / interval_of(data)))
    within = np.concatenate(
        [np.arange(b - a) // rows_per_stretch for a, b in zip(data.starts[:-1], data.starts[1:], strict=True)]
    )
    segment = np.repeat(np.arange(len(data.starts) - 1), np.diff(data.starts))
    _, stretch = np.unique(segment * 1_000_000 + within, return_inverse=True)
    size = np.bincount(stretch).astype(float)
    run = np.zeros(len(size), dtype=np.int64)
    run[stretch] = data.run_of_row
    share, rows = np.zeros(2), np.zeros_like(white)
    for wheel in data.judged_sides:
        energy = np.bincount(stretch, white[:, wheel] ** 2)
        mean = energy / size
        active = mean > 0.05 * float(np.mean(mean))
        if active.sum() < 20:
            continue
        typical = np.full(len(size), float(np.median(mean[active])))
        for number in range(int(run.max()) + 1):
            own = active & (run == number)
            if own.sum() >= MIN_STRETCHES:
                typical[run == number] = max(typical[0], float(np.median(mean[own])))
        free = size / _variance_of_squares(white[:, wheel], stretch, rows_per_stretch)
        typical /= _median_of_mean_square(rows_per_stretch)
        limit = typical * size * chi2_quantiles(0.9999, free) / free
        excess = np.where(energy > limit, energy - typical * size, 0.0)
        share[wheel] = float(excess.sum() / max(energy.sum(), 1e-12))
        rows[:, wheel] = (excess > 0.0)[stretch]
    return Bursts(share, rows)


def _variance_of_squares(white: FloatArray, stretch: IntArray, rows_per_stretch: int) -> float:
    """Factor by which correlation within a stretch increases the variance of its energy, 1 or more."""
    clipped = np.clip(white, -3.0, 3.0)
    power = max(float(np.mean(clipped**2)), 1e-12)
    factor = 1.0
    for k in range(1, rows_per_stretch):
        same = stretch[k:] == stretch[:-k]
        if same.any():
            correlation = float(np.mean((clipped[k:] * clipped[:-k])[same])) / power
            factor += 2.0 * (1.0 - k / rows_per_stretch) * correlation**2
    return factor


def _median_of_mean_square(count: int) -> float:
    """Median of the mean of `count` squared standard normal numbers."""
    return chi2_quantile(0.5, float(count)) / count


def wheel_taus(problem: Problem, theta: FloatArray) -> FloatArray:
    """Time constants of both wheels at these parameters, shape (2,), s."""
    layout = problem.simulator.layout
    return np.array([theta[layout.index("tau_left")], theta[layout.index("tau_right")]])


def residual_structure(problem: Problem, done: Fit) -> Structure:
    """Predictable structure in a fit's residual."""
    taus = wheel_taus(problem, done.theta)
    return find_structure(
        problem.data,
        problem.data.speed_mps - done.residual.speeds,
        done.residual.speeds,
        taus,
        problem.noise,
        problem.counted,
        problem.past,
        folds_of(problem.data),
    )
