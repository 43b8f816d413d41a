"""Learns a correction beside a fitted model, and judges it on runs left out of everything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from truing.arrays import BoolArray, FloatArray
from truing.diagnose.fit import Fit, fit
from truing.diagnose.held_out import folds_of
from truing.diagnose.learned.describe import resemblances, sentence, variable_text
from truing.diagnose.learned.feedback import answers_to_speeds, stands_feedback
from truing.diagnose.learned.periods import periodic_candidates
from truing.diagnose.learned.refine import Structure, linear_start, refine, rows_of, structure_of
from truing.diagnose.learned.regression import Left, Sums, groups_of, sums_of
from truing.diagnose.learned.result import LearnedCorrection, LearnedTerm
from truing.diagnose.learned.selection import at_best_constants, select
from truing.diagnose.learned.variables import Candidate, candidates, smoothed_speeds
from truing.diagnose.problem import Problem, weighted_rms
from truing.diagnose.residual_tests import wheel_taus
from truing.model.correction import Correction, corrected_speeds

# Gauss-Newton steps of the whole fit, of each one without a part of the runs, and of one that only gives the
# state for the next choice.
STEPS, FOLD_STEPS, STATE_STEPS = 6, 3, 2
# A correction is shown if it lowers the error on runs left out by this share at least.
MIN_BENEFIT = 0.02
# A correction stands in the place of named effects if it leaves at most this share of the error beside them.
MUCH_BETTER = 0.95


@dataclass(frozen=True)
class Learned:
    """A correction, or that there is none.

    Attributes
    ----------
    correction : None where what is left is noise, as far as the variables show.
    heldout_before, heldout_after : m/s, free-run errors on runs left out of the physical fit, and of the
        choice and the values of the terms as well.
    """

    correction: Correction | None
    heldout_before: float
    heldout_after: float


@dataclass(frozen=True)
class _Model:
    """A structure with its coefficients (2, width) and their half widths."""

    structure: Structure
    theta: FloatArray
    bands: FloatArray

    @property
    def correction(self) -> Correction:
        return self.structure.correction(self.theta, self.bands)


def learn(problem: Problem, done: Fit) -> Learned:
    """Learn what the fit `done` leaves."""
    whole = left_by(problem, done)
    tried = (*candidates(whole.data, whole.state, whole.gain), *periodic_candidates(whole))
    if answers_to_speeds(whole.data):
        tried = tuple(filter(stands_feedback, tried))
    found = _learned(whole, tried, range(whole.groups), STEPS, bands=True)
    if found is None:
        before = _judged(problem, done, whole, ())[0]
        return Learned(None, before, before)
    before, after = _judged(problem, done, whole, tried)
    kept = found.correction if after <= (1.0 - MIN_BENEFIT) * before else None
    return Learned(kept, before, after if kept is not None else before)


def left_by(problem: Problem, done: Fit) -> Left:
    """What a fit leaves."""
    data = problem.data
    layout = problem.simulator.layout
    gain = np.array([done.theta[layout.index(f"gain_{side}")] for side in ("left", "right")])
    return Left(
        data=data,
        speeds=done.residual.speeds,
        state=smoothed_speeds(data),
        weight=problem.measured,
        group=groups_of(data),
        gain=gain,
        tau=wheel_taus(problem, done.theta),
    )


def applied(correction: Correction, left: Left) -> FloatArray:
    """Corrected speeds of all rows of a set, in free run, shape (n, 2), m/s."""
    return corrected_speeds(correction, rows_of(left, correction.terms), left.speeds)


def _learned(
    left: Left, tried: Sequence[Candidate], groups: Sequence[int], steps: int, *, bands: bool = False
) -> _Model | None:
    """The correction that is chosen and fitted on these groups of runs alone.

    Terms are chosen twice: with the measured speeds for the state, whose noise favours terms of the speed;
    and again with the state that the first correction simulates.
    """
    seen = np.isin(left.group, list(groups))
    weight = left.weight * seen[:, None]
    first = _fitted(left, sums_of(left, tried), groups, weight, STATE_STEPS)
    if first is None:
        return None
    settled = replace(left, state=applied(first.correction, left))
    return _fitted(settled, sums_of(settled, tried), groups, weight, steps, bands=bands, tuned=True)


def _fitted(
    left: Left,
    sums: Sums,
    groups: Sequence[int],
    weight: FloatArray,
    steps: int,
    *,
    bands: bool = False,
    tuned: bool = False,
) -> _Model | None:
    chosen = select(sums, groups)
    if not chosen.terms:
        return None
    if tuned:
        sums, chosen = at_best_constants(left, sums, chosen, groups)
    structure = structure_of(left, sums, chosen.terms, chosen.penalty, groups)
    start = linear_start(sums, chosen.terms, chosen.penalty, groups)
    found = refine(left, structure, start, weight, steps, bands=bands)
    return _Model(structure, found.theta, found.bands)


def _judged(problem: Problem, done: Fit, whole: Left, tried: Sequence[Candidate]) -> tuple[float, float]:
    """Errors on runs left out, of the physical model alone and with a correction chosen without them."""
    part_of_row = folds_of(whole.data)
    before, after = np.zeros_like(whole.speeds), np.zeros_like(whole.speeds)
    for part in np.unique(part_of_row):
        rows: BoolArray = np.asarray(part_of_row == part)
        seen = problem.restricted(problem.counted * ~rows[:, None], problem.pose_counted)
        refit = fit(seen, done.effects, done.theta, iterations=6, tolerance=1e-3, secant=True)
        left = replace(whole, speeds=refit.residual.speeds)
        before[rows] = after[rows] = left.error[rows]
        # A single run's quarters and eighths may share a row at their edges.
        groups = (
            np.setdiff1d(whole.group[~rows], whole.group[rows])
            if whole.data.runs > 1
            else (np.array([g for g in range(whole.groups) if g // 2 != part]))
        )
        found = _learned(left, tried, [int(group) for group in groups], FOLD_STEPS) if tried else None
        if found is not None:
            error = left.data.speed_mps - applied(found.correction, left)
            after[rows] = np.where(left.weight > 0.0, error, 0.0)[rows]
    return weighted_rms(before, whole.weight), weighted_rms(after, whole.weight)


def learned_correction(problem: Problem, models: Sequence[Fit]) -> LearnedCorrection:
    """Learn what the first of these models leaves, and say it; or what a later, simpler one leaves.

    An effect of the catalogue that only imitates what is missing hides its shape. Beside the refitted
    baseline alone a correction may then lower the error on runs left out further than beside that effect.
    """
    found = [_said(problem, one) for one in models]
    first, best = found[0], min(found, key=lambda one: one.heldout_after)
    if best.heldout_after > MUCH_BETTER * first.heldout_after:
        return first
    # The first model's own error is what the correction is held against.
    return replace(best, heldout_before=first.heldout_before, error_before=first.error_before)


def _said(problem: Problem, done: Fit) -> LearnedCorrection:
    found = learn(problem, done)
    before = problem.free_run_rmse(done.residual.speeds)
    after = before
    terms: tuple[LearnedTerm, ...] = ()
    if found.correction is not None:
        after = problem.free_run_rmse(applied(found.correction, left_by(problem, done)))
        terms = tuple(
            LearnedTerm(term, variable_text(term), sentence(term), resemblances(term))
            for term in found.correction.terms
        )
    return LearnedCorrection(
        found.correction,
        terms,
        found.heldout_before,
        found.heldout_after,
        before,
        after,
        done.effects,
        done.theta,
    )
