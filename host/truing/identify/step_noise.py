"""The noise on a wheel's steady speed, and what it does to a mean, a crossing time and a spread.

A steady window of a step holds ten or twenty rows that resemble their neighbours. Its residuals from a line
are taken as an AR(1) process whose memory is common to all windows of a wheel in a run; each window keeps a
level of its own, since ripple grows with speed. A line fitted to so few rows swallows a part of the noise,
most of the slow part: with M the projection that removes the line, R the correlation of the process and L a
shift by a row, the residuals have the expectations tr(MR) sigma^2 and, a row apart, tr(LMRM) sigma^2. Both
are inverted instead of read off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from truing.arrays import FloatArray

MIN_ROWS = 4
# Longer windows are averaged down to so many blocks: what moves a mean is the slow part of the noise.
MAX_BLOCKS = 48
# Memories that are looked through; below, the counts' own rounding is all that is there.
MEMORIES = tuple(np.linspace(-0.5, 0.95, 30).tolist())
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class WindowNoise:
    """Noise of one steady window.

    Attributes
    ----------
    sigma : standard deviation of a row, m/s.
    memory : correlation of neighbouring rows.
    freedom : degrees of freedom that `sigma` rests on (Satterthwaite).
    mean_deviation : standard deviation of the window's mean, m/s.
    spread : standard deviation of the window's rows about their line, m/s: what was seen, where `sigma` adds
        what the line may have swallowed.
    """

    sigma: float
    memory: float
    freedom: float
    mean_deviation: float
    spread: float

    @property
    def quantile(self) -> float:
        """How many estimated standard deviations hold 95 %."""
        from scipy.special import stdtrit

        return float(stdtrit(self.freedom, 0.5 + 0.5 * CONFIDENCE))

    def deviation_of(self, rows: int) -> float:
        """Standard deviation of the mean of so many neighbouring rows, m/s."""
        return self.sigma * float(np.sqrt(_correlation(rows, self.memory).sum())) / rows

    def deviation_between(self, share: float) -> float:
        """Standard deviation of a value interpolated at `share` of the way between two rows, m/s."""
        a, b = 1.0 - share, share
        return self.sigma * float(np.sqrt(a * a + b * b + 2.0 * a * b * self.memory))

    def spread_interval(self) -> tuple[float, float]:
        """95 % interval of `spread`, m/s."""
        from scipy.special import chdtri

        tail = 0.5 - 0.5 * CONFIDENCE
        low, high = float(chdtri(self.freedom, tail)), float(chdtri(self.freedom, 1.0 - tail))
        return self.spread * float(np.sqrt(self.freedom / low)), self.spread * float(
            np.sqrt(self.freedom / high)
        )

    def largest_of(self, rows: int) -> float:
        """What the largest of so many rows of noise stays below with 95 %, m/s.

        Rows that resemble each other are fewer chances: n (1 - memory)/(1 + memory) of them, at least one.
        """
        from scipy.special import stdtrit

        memory = max(self.memory, 0.0)
        chances = max(rows * (1.0 - memory) / (1.0 + memory), 1.0)
        return self.sigma * float(stdtrit(self.freedom, CONFIDENCE ** (1.0 / chances)))


def window_noise(windows: Sequence[FloatArray]) -> list[WindowNoise | None]:
    """Noise of each steady window of a wheel in a run; None where a window is too short.

    Parameters
    ----------
    windows : speeds (m/s) of the windows, each of shape (rows,).
    """
    block = -(-max((len(values) for values in windows), default=1) // MAX_BLOCKS)
    means = [_block_means(values, block) for values in windows]
    memory = _common_memory([values for values in means if len(values) >= MIN_ROWS])
    return [
        _noise_of(values, blocks, memory) if len(blocks) >= MIN_ROWS else None
        for values, blocks in zip(windows, means, strict=True)
    ]


def _noise_of(values: FloatArray, blocks: FloatArray, memory: float) -> WindowNoise:
    n = len(blocks)
    first, second, _ = _traces(n, memory)
    rest = _without_line(blocks)
    slow = float(np.sqrt(rest @ rest / first))
    mean = slow * float(np.sqrt(_correlation(n, memory).sum())) / n
    freedom = first**2 / second
    if n == len(values):
        return WindowNoise(slow, memory, freedom, mean, float(np.sqrt(rest @ rest / (n - 2))))
    # In a window of many rows the line takes nothing to speak of from a row's own noise.
    rows = np.arange(len(values))
    own = values - np.polyval(np.polyfit(rows, values, 1), rows)
    size = float(own @ own)
    neighbours = float(own[1:] @ own[:-1]) / size if size else 0.0
    sigma = float(np.sqrt(size / (len(own) - 2)))
    return WindowNoise(sigma, neighbours, freedom, mean, sigma)


def _block_means(values: FloatArray, block: int) -> FloatArray:
    """Means over `block` rows; what is left over at the beginning, nearest to the step, is dropped."""
    count = len(values) // block
    return np.asarray(values[len(values) - count * block :].reshape(count, block).mean(axis=1))


def _common_memory(windows: Sequence[FloatArray]) -> float:
    """The memory at which lag-one products of all windows are what they are expected to be.

    Windows that stand still say nothing. What so few rows can tell is uncertain by about one over the root
    of their number; the memory is taken that much higher, since too short a memory makes intervals too
    narrow, and too long a one merely wide.
    """
    moving = [rest for rest in map(_without_line, windows) if np.any(rest)]
    if not moving:
        return 0.0
    products = sum(float(rest[1:] @ rest[:-1]) for rest in moving)
    squares = sum(float(rest @ rest) for rest in moving)
    lengths = [len(rest) for rest in moving]
    expected = [
        sum(_traces(n, m)[2] for n in lengths) / sum(_traces(n, m)[0] for n in lengths) for m in MEMORIES
    ]
    return float(np.interp(products / squares + 1.0 / np.sqrt(sum(lengths)), expected, MEMORIES))


def _without_line(values: FloatArray) -> FloatArray:
    return np.asarray(_projection(len(values)) @ values)


@lru_cache(maxsize=64)
def _projection(n: int) -> FloatArray:
    """What removes the best line, shape (n, n)."""
    q, _ = np.linalg.qr(np.column_stack((np.ones(n), np.arange(n) - 0.5 * (n - 1))))
    return np.asarray(np.eye(n) - q @ q.T)


def _correlation(n: int, memory: float) -> FloatArray:
    rows = np.arange(n)
    distance = np.abs(rows[:, None] - rows)
    if memory == 0.0:
        return np.eye(n)
    return np.asarray(np.sign(memory) ** distance * np.abs(memory) ** distance)


@lru_cache(maxsize=4096)
def _traces(n: int, memory: float) -> tuple[float, float, float]:
    """tr(MR), tr(MRMR) and the sum of the first off-diagonal of MRM."""
    projection = _projection(n)
    seen = projection @ _correlation(n, memory) @ projection
    return float(np.trace(seen)), float(np.sum(seen * seen)), float(np.trace(seen, offset=1))
