"""Whether what a model leaves looks like a slow disturbance: a torque that no run repeats.

The noise floor comes from second differences and shows no disturbance that is slower than a row. A robot that
is shaken slowly leaves more than the floor, and nothing is missing from its model. Such a residual has four
properties, and the error of a wrong model lacks at least one of them: no part of it is predictable from
efforts, speeds or place; other runs do not have it at the same time after their start; no stretch stands out;
and its mean over a run is small.
"""

from __future__ import annotations

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.diagnose.compare import row_blocks
from truing.diagnose.data.set_data import SetData
from truing.diagnose.fit import Fit
from truing.diagnose.problem import Problem
from truing.diagnose.residual_tests import Structure

# Length of the stretches whose typical level is compared with the whole, s; shorter than any passage over
# another floor, longer than the correlation of most disturbances.
STRETCH_S = 0.5
# Rows at more than this share of the top speed count: at rest friction hides a disturbance.
MOVING_SHARE = 0.05
# A disturbance is predictable by at most this share of its energy, its RMS at most this multiple of the
# typical stretch's, and the RMS of its means over runs at most this share of its own.
MAX_PREDICTED, MAX_OVER_TYPICAL, MAX_RUN_MEAN = 0.1, 1.8, 0.55


def is_disturbance(problem: Problem, done: Fit, remaining: Structure) -> BoolArray:
    """Whether the residual of each wheel, shape (2,), looks like a slow disturbance.

    Parameters
    ----------
    remaining : predictable structure in the residual of `done`.
    """
    data = problem.data
    residual = data.speed_mps - done.residual.speeds
    moving = moving_rows(problem)
    # A share that the runs do not agree on shows that their errors differ, not that they are unpredictable.
    predicted = np.maximum(remaining.share, 0.0) + remaining.error
    found = np.zeros(2, dtype=bool)
    for wheel in range(2):
        rows = moving[:, wheel]
        if not rows.any():
            continue
        error = residual[rows, wheel]
        rms = float(np.sqrt(np.mean(error**2)))
        stretches = _levels(error, row_blocks(problem, STRETCH_S)[rows])
        found[wheel] = (
            predicted[wheel] < MAX_PREDICTED
            and rms < MAX_OVER_TYPICAL * float(np.median(stretches))
            and _rms_of_means(error, data.run_of_row[rows]) < MAX_RUN_MEAN * rms
            and _repeated_share(error * np.sign(data.speed_mps[rows, wheel]), *_times(data, rows))
            < MAX_PREDICTED
        )
    return found


def moving_rows(problem: Problem) -> BoolArray:
    """Counted rows in which each wheel moves, shape (n, 2)."""
    data = problem.data
    return np.asarray((problem.counted > 0.0) & (np.abs(data.speed_mps) > MOVING_SHARE * data.top_mps))


def _times(data: SetData, rows: BoolArray) -> tuple[IntArray, IntArray]:
    """Stretch after the start of its run, and run, of these rows."""
    run = data.run_of_row[rows]
    first = np.array([data.t_s[data.rows_of(k)][0] for k in range(data.runs)])
    return np.asarray((data.t_s[rows] - first[run]) / STRETCH_S, dtype=np.int64), run


def _repeated_share(error: FloatArray, stretch: IntArray, run: IntArray) -> float:
    """Share of the energy that the mean of the other runs' errors in the same stretch predicts."""
    total, count = np.bincount(stretch, error), np.bincount(stretch)
    predicted = np.zeros_like(error)
    for k in np.unique(run):
        own = run == k
        others = total - np.bincount(stretch[own], error[own], len(total))
        mean = others / np.maximum(count - np.bincount(stretch[own], minlength=len(total)), 1)
        predicted[own] = mean[stretch[own]]
    return 1.0 - float(np.sum((error - predicted) ** 2) / np.sum(error**2))


def _levels(error: FloatArray, group: IntArray) -> FloatArray:
    """RMS within each group."""
    count = np.bincount(group)
    return np.asarray(np.sqrt(np.bincount(group, error**2)[count > 0] / count[count > 0]))


def _rms_of_means(error: FloatArray, group: IntArray) -> float:
    """RMS of the groups' means."""
    count = np.bincount(group)
    means = np.bincount(group, error)[count > 0] / count[count > 0]
    return float(np.sqrt(np.mean(means**2)))
