"""Windows of time over which a predicted displacement is held against a measured one.

An error of odometry grows with time, so that single-shot errors say little about where it arose. Short
windows, each starting from the measured pose, let every stretch of driving be judged for itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.diagnose.data.set_data import SetData


@dataclass(frozen=True, slots=True)
class Windows:
    """Windows that follow one another in each segment, without overlap.

    Attributes
    ----------
    first, last : shape (m,), rows at which a window begins and ends.
    run : shape (m,).
    measured : shape (m, 3): forward m, lateral m, in the body frame at the window's start, and turn rad;
        NaN where nothing measured it.
    """

    first: IntArray
    last: IntArray
    run: IntArray
    measured: FloatArray

    def __len__(self) -> int:
        return len(self.first)

    def blocks(self, size: int) -> IntArray:
        """Numbers of blocks of this many windows in a row, none across two runs, shape (m,)."""
        numbers = np.zeros(len(self), dtype=np.int64)
        block = -1
        count = 0
        for k in range(len(self)):
            fresh = k == 0 or self.run[k] != self.run[k - 1]
            if fresh or count == size:
                block += 1
                count = 0
            numbers[k] = block
            count += 1
        return numbers


def pose_windows(data: SetData, horizon_s: float) -> Windows:
    """Windows of at least the horizon between rows whose pose is known; from the gyro where none is.

    With few rows of truth (end points alone, say) a window reaches from one to the next.
    """
    known = np.asarray(np.isfinite(data.truth).all(axis=1))
    whole = np.asarray(np.isfinite(data.gyro_radps))
    firsts: list[int] = []
    lasts: list[int] = []
    runs: list[int] = []
    measured: list[tuple[float, float, float]] = []
    for segment in range(data.segments):
        a, b = int(data.starts[segment]), int(data.starts[segment + 1])
        truth = known[a:b].sum() >= 2
        if not truth and not whole[a:b].all():
            continue
        rows = (np.flatnonzero(known[a:b]) if truth else np.arange(b - a)) + a
        begin = int(rows[0])
        for row in rows[1:].tolist():
            if data.t_s[row] - data.t_s[begin] < horizon_s - 1e-6:
                continue
            firsts.append(begin)
            lasts.append(row)
            runs.append(int(data.run_of_segment[segment]))
            measured.append(_from_truth(data, begin, row) if truth else _from_gyro(data, begin, row))
            begin = row
    return Windows(
        np.array(firsts, dtype=np.int64),
        np.array(lasts, dtype=np.int64),
        np.array(runs, dtype=np.int64),
        np.array(measured, dtype=np.float64).reshape(-1, 3),
    )


def _from_truth(data: SetData, first: int, last: int) -> tuple[float, float, float]:
    x, y, heading = data.truth[last] - data.truth[first]
    facing = float(data.truth[first, 2])
    cosine, sine = math.cos(facing), math.sin(facing)
    return float(x * cosine + y * sine), float(y * cosine - x * sine), float(heading)


def _from_gyro(data: SetData, first: int, last: int) -> tuple[float, float, float]:
    inside = slice(first + 1, last + 1)
    return math.nan, math.nan, float(np.sum(data.gyro_radps[inside] * data.dt_s[inside]))
