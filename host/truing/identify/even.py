"""Evenly sampled stretches of a wheel's signal, for the discrete models."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from truing.arrays import FloatArray
from truing.errors import IdentifyError
from truing.identify.signals import WheelSignal


@dataclass(frozen=True, slots=True, eq=False)
class EvenStretch:
    """Rows at even times: `effort` and `speed` (m/s), each of shape (n,); `run` indexes the names."""

    run: int
    effort: FloatArray
    speed: FloatArray


@dataclass(frozen=True, slots=True)
class EvenSignal:
    """All stretches of a wheel at one interval.

    Attributes
    ----------
    uneven_share : share of the original intervals that differ from `interval_s` by more than a tenth.
    """

    interval_s: float
    stretches: tuple[EvenStretch, ...]
    names: tuple[str, ...]
    scale_mps: float
    uneven_share: float

    def select(self, runs: list[int]) -> tuple[EvenStretch, ...]:
        """The stretches of these runs."""
        return tuple(stretch for stretch in self.stretches if stretch.run in runs)


def even_signal(signal: WheelSignal, shortest: int) -> EvenSignal:
    """Put every segment on an even grid at the median interval.

    Effort and speed are means over intervals, so that their running integrals are interpolated:
    travel and impulse are conserved, and an even segment comes back as it was.

    Parameters
    ----------
    shortest : stretches with fewer rows than this are of no use and are left out.
    """
    t = signal.excitation.t_s
    starts = signal.excitation.starts
    steps = np.concatenate([np.diff(t[a:b]) for a, b in pairwise(starts)])
    interval = float(np.median(steps))
    stretches = []
    for a, b in pairwise(starts):
        if b - a < shortest:
            continue
        effort = _resample(t[a:b], signal.excitation.effort[a:b], interval)
        speed = _resample(t[a:b], signal.speed_mps[a:b], interval)
        # A run that was logged faster than the others has fewer rows at the common interval.
        if len(speed) >= shortest:
            stretches.append(EvenStretch(int(signal.run_of_row[a]), effort, speed))
    if not stretches:
        raise IdentifyError(f"no stretch without a gap has {shortest} rows or more")
    uneven = float(np.mean(np.abs(steps - interval) > 0.1 * interval))
    return EvenSignal(interval, tuple(stretches), signal.names, signal.scale_mps, uneven)


def _resample(t: FloatArray, values: FloatArray, interval: float) -> FloatArray:
    count = int(np.floor((t[-1] - t[0]) / interval + 1e-6)) + 1
    grid = t[0] + interval * np.arange(count)
    if count == len(t) and np.allclose(grid, t, rtol=0.0, atol=1e-6 * interval):
        return values.copy()
    integral = np.concatenate(([0.0], np.cumsum(values[1:] * np.diff(t))))
    resampled = np.diff(np.interp(grid, t, integral)) / interval
    return np.concatenate((values[:1], resampled))
