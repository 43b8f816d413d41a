"""Does anything remain that the inputs and the robot's state foretell? A flexible model asks, on unseen runs.

What a complete model leaves over is unpredictable. So a wide linear basis (powers and products of effort
and speed, what happens near standstill, past efforts, elapsed time, wheel angle, heading, place) is
regressed on the residual of some runs by ridge regression, and judged on the others. A share of the
residual's energy that is foretold there is structure; nothing in the basis names it.

Features are taken from the *simulated* speed: the measured one carries the disturbance itself and would
condemn every correct model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.signal import lfilter

from truing.diagnose.data import SetData
from truing.diagnose.noise import Noise, whiten
from truing.model.kernel import FloatArray, IntArray

RIDGES = (3.0, 30.0, 300.0, 3000.0)
# Past efforts are looked at this far back, s.
HISTORY_S = 0.5
# Ringing is looked for at these frequencies, Hz, with this damping: a swing within a tenth of one is seen.
RINGING_HZ, RINGING_DAMPING = np.geomspace(0.6, 3.5, 11), 0.06
# Bumps over the floor along each axis.
PLACES = 6
# Bursts are looked for in stretches of this length, s.
BURST_S = 0.4
# So many stretches of a run tell its own noise.
LEAST_STRETCHES = 8


@dataclass(frozen=True, slots=True)
class Structure:
    """What a flexible model foretells of a residual.

    Attributes
    ----------
    share : shape (2,), of each wheel's whitened residual energy, on runs that it was not fitted to.
    error : shape (2,), standard error of the share over runs.
    helped : shape (2,), share of the runs in which it foretells anything.
    foretold : shape (n, 2), m/s, the part of the residual that it foretells (each run from the others).
    """

    share: FloatArray
    error: FloatArray
    helped: FloatArray
    foretold: FloatArray

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
    lagged: IntArray,
    folds: IntArray,
) -> Structure:
    """Regress the residual on the basis, fold by fold.

    Parameters
    ----------
    residual, speeds : shape (n, 2), m/s, measured minus simulated, and simulated.
    taus : shape (2,), s, the wheels' time constants: torque features reach the speed through them.
    folds : shape (n,), which group of runs each row belongs to.
    """
    share, error, helped = np.zeros(2), np.zeros(2), np.zeros(2)
    foretold = np.zeros_like(residual)
    target = whiten(noise, residual, counted, lagged)
    for wheel in range(2):
        basis = features(data, speeds, wheel, float(taus[wheel]))
        pair = np.repeat(basis[:, None, :], 2, axis=1)
        white = whiten(noise, pair, counted, lagged)[:, wheel]
        scale = np.sqrt(np.mean(white**2, axis=0)) + 1e-12
        white, basis = white / scale, basis / scale
        y = np.clip(target[:, wheel], -4.0, 4.0)
        groups = np.unique(folds)
        gram = {g: white[folds == g].T @ white[folds == g] for g in groups}
        moment = {g: white[folds == g].T @ y[folds == g] for g in groups}
        best, guess = np.inf, np.zeros_like(y)
        weights: dict[int, FloatArray] = {}
        for ridge in RIDGES:
            trial, kept = np.zeros_like(y), {}
            for g in groups:
                a = sum((gram[h] for h in groups if h != g), np.zeros_like(gram[g]))
                b = sum((moment[h] for h in groups if h != g), np.zeros_like(moment[g]))
                kept[int(g)] = np.linalg.solve(a + ridge * np.eye(len(b)), b)
                trial[folds == g] = white[folds == g] @ kept[int(g)]
            cost = float(np.sum((y - trial) ** 2))
            if cost < best:
                best, guess, weights = cost, trial, kept
        for g in groups:
            foretold[folds == g, wheel] = basis[folds == g] @ weights[int(g)]
        gain = y**2 - (y - guess) ** 2
        total = max(float(np.sum(y**2)), 1e-12)
        share[wheel] = float(gain.sum()) / total
        runs = np.unique(data.run_of_row)
        by_run = np.array([gain[data.run_of_row == run].sum() for run in runs])
        error[wheel] = float(np.sqrt(np.sum((by_run - by_run.mean()) ** 2)) / total)
        helped[wheel] = float((by_run > 0.0).mean())
    return Structure(share, error, helped, foretold)


def features(data: SetData, speeds: FloatArray, wheel: int, tau: float) -> FloatArray:
    """The basis for one wheel, shape (n, f): torque features through the wheel's lag, and plain ones."""
    u, other = data.effort[:, wheel], data.effort[:, 1 - wheel]
    v, w = speeds[:, wheel], speeds[:, 1 - wheel]
    top = max(float(np.max(np.abs(speeds))), 1e-6)
    x, z = v / top, w / top
    time = _elapsed(data)
    moving = np.abs(v) > 1e-3 * top
    sign = np.where(moving, np.sign(v), 0.0)
    torque = [
        u,
        u * np.abs(u),
        u**3,
        np.abs(u),
        u**2,
        other,
        np.abs(other) * np.sign(u),
        x * np.abs(x),
        x**3,
        np.abs(x),
        x**2,
        sign,
        z,
        x - z,
        np.sign(x - z) * (np.abs(x - z) > 0.02),
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
        np.abs(u) * u * (np.abs(other)),
        u * np.abs(u - x),
    ]
    angle = None if data.angle_rad is None else data.angle_rad[:, wheel]
    if angle is not None:
        torque += [trig(k * angle) * moving for k in (1, 2, 3, 4, 6) for trig in (np.sin, np.cos)]
    if data.heading_rad is not None:
        torque += [np.sin(data.heading_rad), np.cos(data.heading_rad)]
        place = _place(data)
        torque += [bump * direction for bump in _bumps(place) for direction in (sign, x)]
        torque += _pulls(data, place, data.heading_rad)
    through = _lag(data, np.stack(torque, axis=1), tau)
    plain = [x, x * np.abs(x), x**3, np.abs(x), time * x, *_steps(data, u)]
    plain += _ringing(data, 0.5 * (u + other))
    if angle is not None:
        plain += [trig(k * angle) * x for k in (1, 2) for trig in (np.sin, np.cos)]
    return np.concatenate((through, np.stack(plain, axis=1)), axis=1)


def _place(data: SetData) -> FloatArray:
    """Where the robot is, shape (n, 2), m: from outside, or summed up from each run's start."""
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


def _bumps(place: FloatArray) -> list[FloatArray]:
    """Bumps over the floor that the robot crossed, each (n,): does the place itself matter."""
    low, high = np.percentile(place, (2, 98), axis=0)
    size = np.maximum((high - low) / (PLACES - 1), 0.05)
    bumps = []
    for i in range(PLACES):
        for j in range(PLACES):
            centre = low + size * (i, j)
            bump = np.exp(-0.5 * np.sum(((place - centre) / (0.6 * size)) ** 2, axis=1))
            if bump.mean() > 2e-3:
                bumps.append(bump)
    return bumps


def _pulls(data: SetData, place: FloatArray, heading: FloatArray) -> list[FloatArray]:
    """Forces along the heading that grow with the way from a run's start or from the floor's middle."""
    runs = np.unique(data.run_of_row, return_inverse=True)[1]
    begins = np.unique(data.run_of_row, return_index=True)[1]
    out = []
    for away in (place - place[begins][runs], place - place.mean(axis=0)):
        away = away / max(float(np.sqrt(np.mean(away**2))), 1e-6)
        out += [away[:, i] * turned for i in range(2) for turned in (np.cos(heading), np.sin(heading))]
    return out


def _steps(data: SetData, u: FloatArray) -> list[FloatArray]:
    """Changes of effort at lags 0 to HISTORY_S, each row its own; zero before a segment starts."""
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


def _ringing(data: SetData, u: FloatArray) -> list[FloatArray]:
    """What changes of effort leave swinging, at every frequency as sine and cosine; none before a segment."""
    interval_s = interval_of(data)
    out = []
    for hertz in RINGING_HZ[RINGING_HZ * interval_s < 0.2]:
        pole = np.exp(2.0 * np.pi * hertz * interval_s * (1j - RINGING_DAMPING))
        swing = np.zeros(len(u), dtype=complex)
        for a, b in zip(data.starts[:-1], data.starts[1:], strict=True):
            swing[a:b] = lfilter([1.0], [1.0, -pole], np.diff(u[a:b], prepend=u[a]))
        out += [swing.real, swing.imag]
    return out


def _lag(data: SetData, columns: FloatArray, tau: float) -> FloatArray:
    """First-order lag of each column within each segment (exact for even steps)."""
    keep = float(np.exp(-interval_of(data) / max(tau, 1e-3)))
    out = np.empty_like(columns)
    for a, b in zip(data.starts[:-1], data.starts[1:], strict=True):
        out[a:b] = lfilter([1.0 - keep], [1.0, -keep], columns[a:b], axis=0)
    return out


def _elapsed(data: SetData) -> FloatArray:
    """Time over the whole set, 0 to 1."""
    time = data.elapsed_s
    return np.asarray((time - time[0]) / max(float(time[-1] - time[0]), 1e-9))


def _heat(data: SetData, wheel: int) -> FloatArray:
    """Squared effort, remembered over half a minute: what warms a winding or drains a battery."""
    keep = float(np.exp(-interval_of(data) / 30.0))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], data.effort[:, wheel] ** 2))


def interval_of(data: SetData) -> float:
    """The usual time between rows over the whole set, s."""
    return float(np.median(data.interval_s))


@dataclass(frozen=True, slots=True)
class Bursts:
    """Moments at which a residual is larger than its own noise makes it at other moments.

    Attributes
    ----------
    share : shape (2,), of each wheel's whitened energy that sits in bursts beyond chance.
    rows : shape (n, 2), whether a row lies in one.
    """

    share: FloatArray
    rows: FloatArray


def find_bursts(data: SetData, white: FloatArray) -> Bursts:
    """Energy in stretches beyond what Gaussian innovations of the typical size leave there.

    The typical size is that of the median stretch in which the wheel moves, of the set or of its run where
    that is noisier, so that bursts cannot hide in it; a stretch is a burst beyond the level that noise passes
    once in ten thousand. Where the innovations still follow each other, a stretch holds fewer that count.
    """
    per = max(2, round(BURST_S / interval_of(data)))
    within = np.concatenate(
        [np.arange(b - a) // per for a, b in zip(data.starts[:-1], data.starts[1:], strict=True)]
    )
    segment = np.repeat(np.arange(len(data.starts) - 1), np.diff(data.starts))
    _, stretch = np.unique(segment * 1_000_000 + within, return_inverse=True)
    size = np.bincount(stretch).astype(float)
    run = np.zeros(len(size), dtype=np.int64)
    run[stretch] = data.run_of_row
    share, rows = np.zeros(2), np.zeros_like(white)
    for wheel in range(2):
        energy = np.bincount(stretch, white[:, wheel] ** 2)
        mean = energy / size
        active = mean > 0.05 * float(np.mean(mean))
        if active.sum() < 20:
            continue
        typical = np.full(len(size), float(np.median(mean[active])))
        for number in range(int(run.max()) + 1):
            own = active & (run == number)
            if own.sum() >= LEAST_STRETCHES:
                typical[run == number] = max(typical[0], float(np.median(mean[own])))
        free = size / _variance_of_squares(white[:, wheel], stretch, per)
        typical /= _median_of_mean_square(per)
        limit = typical * size * stats.chi2.ppf(0.9999, free) / free
        excess = np.where(energy > limit, energy - typical * size, 0.0)
        share[wheel] = float(excess.sum() / max(energy.sum(), 1e-12))
        rows[:, wheel] = (excess > 0.0)[stretch]
    return Bursts(share, rows)


def _variance_of_squares(white: FloatArray, stretch: IntArray, per: int) -> float:
    """By how much the correlation of a stretch's rows widens the spread of its energy, 1 or more."""
    clipped = np.clip(white, -3.0, 3.0)
    power = max(float(np.mean(clipped**2)), 1e-12)
    widened = 1.0
    for k in range(1, per):
        same = stretch[k:] == stretch[:-k]
        if same.any():
            correlation = float(np.mean((clipped[k:] * clipped[:-k])[same])) / power
            widened += 2.0 * (1.0 - k / per) * correlation**2
    return widened


def _median_of_mean_square(count: int) -> float:
    """Median of the mean of `count` squared standard normal numbers."""
    return float(stats.chi2.median(count) / count)
