"""The noise of the measured speeds from the recordings alone: no model of the robot can raise it.

A second difference cancels any motion that is straight over three rows, so that its size is that of the
measurement's noise (von Neumann 1941, "Distribution of the ratio of the mean square successive difference to
the variance", for first differences). The median over time makes it the typical level: a stretch that stands
out, stands out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.data.set_data import SetData

# Slow torque disturbances reach a wheel's speed through its own lag; second differences do not show them. On
# robots whose noise is known, all noise together is 1.6 to 2.2 times what second differences show.
SLOW_FACTOR = 2.0
# Rounding to whole counts gives a differenced speed an RMS of sqrt(1/6) of a count per row.
ROUNDING = 0.41
# No speed is known better than to this share of the robot's fastest.
MIN_SHARE_OF_TOP = 1e-5


@dataclass(frozen=True, slots=True)
class NoiseFloor:
    """Noise of each wheel's speed, m/s, shape (2,) each.

    Attributes
    ----------
    fast : what second differences show, or rounding where that is more.
    rms : with the slow disturbances that no difference sees.
    """

    fast: FloatArray
    rms: FloatArray


def noise_floor(data: SetData) -> NoiseFloor:
    """The typical local level of both wheels' noise."""
    fast = np.zeros(2)
    for wheel in range(2):
        level = _typical(data, wheel)
        fast[wheel] = max(level, ROUNDING * data.resolution_mps, MIN_SHARE_OF_TOP * data.top_mps)
    return NoiseFloor(fast, SLOW_FACTOR * fast)


def _typical(data: SetData, wheel: int) -> float:
    """Median over runs of the robust size of second differences of measured rows, m/s."""
    levels: list[float] = []
    for run in range(data.runs):
        found: list[FloatArray] = []
        for segment in np.flatnonzero(data.run_of_segment == run):
            rows = np.arange(data.starts[segment], data.starts[segment + 1])
            rows = rows[data.valid[rows, wheel]]
            found.append(_second_differences(data.t_s[rows], data.speed_mps[rows, wheel]))
        size = np.concatenate(found) if found else np.zeros(0)
        if len(size) >= 10:
            levels.append(1.4826 * float(np.median(np.abs(size))))
    return float(np.median(levels)) if levels else 0.0


def _second_differences(t: FloatArray, v: FloatArray) -> FloatArray:
    """Each row less the line through its neighbours, scaled to the noise of one row; rest left out."""
    if len(v) < 3:
        return np.zeros(0)
    width = np.maximum(t[2:] - t[:-2], 1e-9)
    before, after = (t[2:] - t[1:-1]) / width, (t[1:-1] - t[:-2]) / width
    deviation = v[1:-1] - before * v[:-2] - after * v[2:]
    moving = (v[:-2] != 0.0) | (v[1:-1] != 0.0) | (v[2:] != 0.0)
    return np.asarray((deviation / np.sqrt(1.0 + before**2 + after**2))[moving])
