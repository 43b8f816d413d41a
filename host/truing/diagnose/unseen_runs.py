"""Benefit of one model over another on runs left out."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.fit import Fit
from truing.diagnose.held_out import folds_of, held_out
from truing.diagnose.pose_windows import pose_folds, pose_rmse
from truing.diagnose.problem import Problem
from truing.diagnose.search import effect_set

# A change of an error by less than this share is none.
NEGLIGIBLE = 0.01
# Benefits that differ by less than this are alike.
SIMILAR_BENEFIT = 0.06
# What is taken from one signal's error is outweighed by the other's benefit up to this share of it.
MAX_TAKEN = 0.25
# A part of a single run with more than this share of the squared difference of two models is the only one
# that distinguishes them.
ONLY_PART = 0.8


@dataclass(frozen=True, slots=True)
class UnseenErrors:
    """Free-run errors of one model on runs left out.

    Attributes
    ----------
    wheels : RMS over both wheels, m/s.
    pose : RMS over the pose's windows, m; 0 without a pose.
    by_run : shape (runs,), sum of squared wheel errors of each run, m^2/s^2.
    by_part : shape (parts,), of each part that is left out together.
    """

    wheels: float
    pose: float
    by_run: FloatArray
    by_part: FloatArray


@dataclass
class UnseenRuns:
    """Errors on runs left out, each model's computed once."""

    problem: Problem
    _known: dict[tuple[str, ...], UnseenErrors] = field(default_factory=dict)

    @classmethod
    def beside(cls, problem: Problem, best: Fit) -> UnseenRuns:
        """For models compared with `best`: by plain least squares where it leaves more than noise."""
        return cls(problem.judging(best.residual.speeds))

    def errors(self, one: Fit) -> UnseenErrors:
        """Errors of the structure of `one`, fitted without each part of the runs in turn."""
        name = effect_set(*one.effects)
        if name not in self._known:
            data = self.problem.data
            folds = folds_of(data)
            found = held_out(self.problem, one, folds, pose_folds(self.problem, folds))
            pose = pose_rmse(self.problem, found.pose) if len(found.pose) else 0.0
            square = (found.error**2 * self.problem.measured).sum(axis=1)
            by_run: FloatArray = np.bincount(data.run_of_row, square, data.runs).astype(np.float64)
            by_part: FloatArray = np.bincount(folds, square).astype(np.float64)
            self._known[name] = UnseenErrors(found.rmse(self.problem.measured), pose, by_run, by_part)
        return self._known[name]

    def benefit(self, one: Fit, other: Fit) -> float:
        """Share by which `one` lowers the error of wheels or pose; negative where it clearly raises either.

        An equation that approximates the physics can bring much to one and take a little from the other.
        """
        a, b = self.errors(one), self.errors(other)
        shares = [1.0 - self._wheels_ratio(one, other)]
        if b.pose > 0.0:
            shares.append(1.0 - a.pose / b.pose)
        allowed = max(NEGLIGIBLE, MAX_TAKEN * max(shares))
        return min(shares) if min(shares) < -allowed else max(shares)

    def _wheels_ratio(self, one: Fit, other: Fit) -> float:
        """Error of the wheels by `one` over that by `other`.

        A part of a single run that alone distinguishes them, such as the one step of a step test, leaves
        nothing to the other parts to estimate the difference from. That part counts as it was fitted.
        """
        a, b = self.errors(one), self.errors(other)
        part = self._only_part(one, other)
        if part is None:
            return a.wheels / max(b.wheels, 1e-12)
        squares = []
        for errors, each in ((a, one), (b, other)):
            error = self.problem.data.speed_mps - each.residual.speeds
            here = self.problem.measured * (folds_of(self.problem.data) == part)[:, None]
            fitted = float(np.sum(np.where(here > 0.0, here * error**2, 0.0)))
            squares.append(float(np.delete(errors.by_part, part).sum()) + fitted)
        return float(np.sqrt(squares[0] / max(squares[1], 1e-24)))

    def _only_part(self, one: Fit, other: Fit) -> int | None:
        """The part of a single run that alone distinguishes two models, or None."""
        data = self.problem.data
        if data.runs > 1:
            return None
        difference = self.problem.measured * (one.residual.speeds - other.residual.speeds) ** 2
        energy = np.bincount(folds_of(data), difference.sum(axis=1))
        part = int(np.argmax(energy))
        return part if energy[part] > ONLY_PART * float(energy.sum()) else None

    def loss_share(self, one: Fit, other: Fit) -> float:
        """Squared error that `one` adds to the runs that it makes worse, over what it removes in others."""
        change = self.errors(one).by_run - self.errors(other).by_run
        removed = -float(change[change < 0.0].sum())
        return float(change[change > 0.0].sum()) / max(removed, 1e-12)
