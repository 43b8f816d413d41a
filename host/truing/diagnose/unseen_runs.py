"""Benefit of one model over another on runs left out.

What only the hardest run shows, such as a limit that no other run reaches, cannot be estimated without it:
where one run alone distinguishes a model from the other or from the baseline, it is left out in quarters.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.diagnose.data.set_data import SetData
from truing.diagnose.fit import Fit
from truing.diagnose.held_out import FOLDS, folds_of, held_out, quarters
from truing.diagnose.pose_windows import pose_folds, pose_rmse
from truing.diagnose.problem import Problem
from truing.diagnose.search import Search, effect_set

# A change of an error by less than this share is none.
NEGLIGIBLE = 0.01
# Benefits that differ by less than this are alike.
SIMILAR_BENEFIT = 0.06
# What is taken from one signal's error is outweighed by the other's benefit up to this share of it.
MAX_TAKEN = 0.25
# A run, or a part of a single run, with more than this share of the squared difference of two models is the
# only one that distinguishes them.
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
    """Errors on runs left out, each model's computed once; `base` is the baseline refitted."""

    problem: Problem
    base: Fit
    _known: dict[tuple[tuple[str, ...], frozenset[int]], UnseenErrors] = field(default_factory=dict)

    @classmethod
    def of(cls, search: Search) -> UnseenRuns:
        """For the models of a search, under its noise."""
        return cls(search.problem, search.fits[()])

    @classmethod
    def beside(cls, search: Search, best: Fit) -> UnseenRuns:
        """For models compared with `best`: by plain least squares where it leaves more than noise."""
        return cls(search.problem.judging(best.residual.speeds), search.fits[()])

    def errors(self, one: Fit, split_runs: frozenset[int] = frozenset()) -> UnseenErrors:
        """Errors of the structure of `one`, fitted without each part of the runs in turn.

        Parameters
        ----------
        split_runs : runs that are left out in quarters.
        """
        key = effect_set(*one.effects), split_runs
        if key not in self._known:
            data = self.problem.data
            folds = _folds(data, split_runs)
            found = held_out(self.problem, one, folds, pose_folds(self.problem, folds))
            pose = pose_rmse(self.problem, found.pose) if len(found.pose) else 0.0
            square = (found.error**2 * self.problem.measured).sum(axis=1)
            by_run: FloatArray = np.bincount(data.run_of_row, square, data.runs).astype(np.float64)
            by_part: FloatArray = np.bincount(folds, square).astype(np.float64)
            self._known[key] = UnseenErrors(found.rmse(self.problem.measured), pose, by_run, by_part)
        return self._known[key]

    def _errors_of_both(self, one: Fit, other: Fit) -> tuple[UnseenErrors, UnseenErrors]:
        """Errors of two models, each fitted without the same parts."""
        split_runs = self._only_runs(one, other)
        return self.errors(one, split_runs), self.errors(other, split_runs)

    def _only_runs(self, one: Fit, other: Fit) -> frozenset[int]:
        """Runs, of several, that alone distinguish two models or one of them from the baseline."""
        data = self.problem.data
        if data.runs == 1:
            return frozenset()
        pairs = ((one, other), (one, self.base), (other, self.base))
        only = (self._only(a, b, data.run_of_row) for a, b in pairs)
        return frozenset(run for run in only if run is not None)

    def benefit(self, one: Fit, other: Fit) -> float:
        """Share by which `one` lowers the error of wheels or pose; negative where it clearly raises either.

        An equation that approximates the physics can bring much to one and take a little from the other.
        """
        a, b = self._errors_of_both(one, other)
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
        a, b = self._errors_of_both(one, other)
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
        return self._only(one, other, folds_of(data)) if data.runs == 1 else None

    def _only(self, one: Fit, other: Fit, group: IntArray) -> int | None:
        """The group of rows that alone distinguishes two models, or None."""
        difference = self.problem.measured * (one.residual.speeds - other.residual.speeds) ** 2
        energy = np.bincount(group, difference.sum(axis=1))
        largest = int(np.argmax(energy))
        return largest if float(energy[largest]) > ONLY_PART * float(energy.sum()) else None

    def loss_share(self, one: Fit, other: Fit) -> float:
        """Squared error that `one` adds to the runs that it makes worse, over what it removes in others."""
        a, b = self._errors_of_both(one, other)
        change = a.by_run - b.by_run
        removed = -float(change[change < 0.0].sum())
        return float(change[change > 0.0].sum()) / max(removed, 1e-12)


def _folds(data: SetData, split_runs: frozenset[int]) -> IntArray:
    """Fold of each row, shape (n,), with the quarters of these runs as folds of their own."""
    folds = folds_of(data)
    for number, run in enumerate(sorted(split_runs), start=1):
        rows = data.run_of_row == run
        folds[rows] = FOLDS * number + quarters(int(rows.sum()))
    return folds
