"""Whether what a model leaves comes and goes: stretches that stand out, or errors that resist the motion.

Noise and slow disturbances have about the same level in every stretch of a run, and push as often along the
motion as against it. What acts for some time only has neither property: knocks and pushes stand out of the
typical level, and a strip of carpet or a bearing that binds brakes the wheel now and then, so that the mean
errors of the stretches, taken along the motion, are skewed. Both are asked of the plain residual: a noise
model that has taken part of it for memory whitens it away.
"""

from __future__ import annotations

import math

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.diagnose.compare import row_blocks
from truing.diagnose.disturbance import STRETCH_S, moving_rows
from truing.diagnose.fit import Fit
from truing.diagnose.problem import Problem

# Stretches of at least so many rows count; and so many stretches are needed for a level or a skewness.
MIN_ROWS, MIN_STRETCHES = 5, 40
# RMS over all rows as a multiple of the median stretch's: noise has 1.2, a slow disturbance up to 1.5.
MAX_OVER_TYPICAL = 2.0
# Skewness of the stretches' means: its size, and over its standard error for independent stretches,
# sqrt(6 / count) (Fisher 1930).
MIN_SKEWNESS, SKEWNESS_ERRORS = 0.7, 4.0


def comes_and_goes(problem: Problem, done: Fit) -> BoolArray:
    """Whether the residual of each wheel, shape (2,), has stretches that noise does not have.

    It holds without the run of the largest error too: one event is no missing physics.
    """
    data = problem.data
    residual = data.speed_mps - done.residual.speeds
    moving = moving_rows(problem)
    block, run = row_blocks(problem, STRETCH_S), data.run_of_row
    found = np.zeros(2, dtype=bool)
    for wheel in range(2):
        rows = moving[:, wheel]
        if not rows.any():
            continue
        along = residual[rows, wheel] * np.sign(data.speed_mps[rows, wheel])
        others = run[rows] != np.bincount(run[rows], along**2).argmax()
        found[wheel] = _is_uneven(along, block[rows]) and _is_uneven(along[others], block[rows][others])
    return found


def _is_uneven(along: FloatArray, block: IntArray) -> bool:
    """Whether stretches stand out, or their mean errors along the motion are skewed."""
    count = np.bincount(block)
    enough = count >= MIN_ROWS
    if enough.sum() < MIN_STRETCHES:
        return False
    mean = np.bincount(block, along)[enough] / count[enough]
    rms = np.sqrt(np.bincount(block, along**2)[enough] / count[enough])
    stands_out = math.sqrt(float(np.mean(along**2))) > MAX_OVER_TYPICAL * float(np.median(rms))
    away = mean - mean.mean()
    skewness = float(np.mean(away**3)) / max(float(np.mean(away**2)) ** 1.5, 1e-300)
    return stands_out or abs(skewness) > max(MIN_SKEWNESS, SKEWNESS_ERRORS * math.sqrt(6.0 / len(mean)))
