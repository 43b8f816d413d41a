"""Cross-validation: errors on runs left out of the fit; the folds are fixed before anything is fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.diagnose.data.set_data import SetData
from truing.diagnose.fit import Fit, fit
from truing.diagnose.problem import Problem, weighted_rms

FOLDS = 4


@dataclass(frozen=True, slots=True)
class HeldOut:
    """Residuals of one structure on rows left out of its fit.

    Attributes
    ----------
    error : shape (n, 2), m/s, measured minus simulated, by the fit without the row's fold.
    pose : shape (m, 3), standard deviations, likewise.
    """

    error: FloatArray
    pose: FloatArray

    def rmse(self, weight: FloatArray, wheels: tuple[int, ...] = (0, 1)) -> float:
        """Root mean square of these wheels' errors by row weights (n, 2), m/s."""
        return weighted_rms(self.error[:, list(wheels)], weight[:, list(wheels)])


def folds_of(data: SetData) -> IntArray:
    """Fold of each row, shape (n,): runs in turn; a single run in quarters."""
    if data.runs == 1:
        return quarters(len(data))
    return np.asarray(data.run_of_row % min(FOLDS, data.runs), dtype=np.int64)


def quarters(rows: int) -> IntArray:
    """Which quarter of a run each of its rows lies in, shape (rows,)."""
    return np.asarray(np.minimum(np.arange(rows) * FOLDS // rows, FOLDS - 1), dtype=np.int64)


def held_out(problem: Problem, full: Fit, folds: IntArray, pose_folds: IntArray) -> HeldOut:
    """Refit without each fold in turn, starting from the fit to everything, and evaluate on that fold."""
    error = np.zeros_like(full.residual.speeds)
    pose = np.zeros_like(full.residual.pose)
    for part in np.unique(folds):
        seen = problem.restricted(
            problem.counted * (folds != part)[:, None], problem.pose_counted * (pose_folds != part)
        )
        refit = fit(seen, full.effects, full.theta, iterations=6, tolerance=1e-3, secant=True)
        rows = folds == part
        error[rows] = (problem.data.speed_mps - refit.residual.speeds)[rows]
        if len(pose):
            windows = pose_folds == part
            pose[windows] = problem.residual(refit.theta, refit.effects).pose[windows]
    return HeldOut(error, pose)
