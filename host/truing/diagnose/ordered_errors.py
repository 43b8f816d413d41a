"""Free-run errors in their order: refitted at most as given, with effects at most refitted.

A fit weights residuals by its noise model, so that its plain free-run error can be larger than that of the
start. The reported models are judged by the plain error too. Where the order does not hold, or where no noise
model is right, they are refitted by plain least squares: where the model leaves more than noise, or where the
plain fit is better on runs left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from truing.diagnose.fit import Fit, fit, reevaluate
from truing.diagnose.held_out import folds_of, held_out
from truing.diagnose.pose_windows import pose_folds
from truing.diagnose.problem import Problem
from truing.diagnose.unseen_runs import NEGLIGIBLE
from truing.diagnose.verdict import Reasoning

# Iterations of a plain least-squares fit from a weighted one.
PLAIN_STEPS = 12


def with_ordered_errors(reasoning: Reasoning) -> Reasoning:
    """The reasoning with its reported fits in order of their free-run errors."""
    problem = reasoning.problem
    if problem.data.commanded:
        return reasoning
    best = reasoning.best
    plainly = problem.exceeds_noise(best.residual.speeds) or _is_better_plainly(problem, best)
    base = _at_most(problem, reasoning.base, reasoning.given, plainly)
    best = base if not best.effects else _at_most(problem, best, base, plainly)
    rivals = tuple(_at_most(problem, one, base, plainly) if one.effects else base for one in reasoning.rivals)
    return replace(reasoning, base=base, best=best, rivals=rivals, plainly=plainly)


def _is_better_plainly(problem: Problem, one: Fit) -> bool:
    """Whether plain least squares fits the structure of `one` clearly better, on runs left out too."""
    plain = plain_fit(problem, one, one)
    limit = (1.0 - NEGLIGIBLE) * problem.free_run_rmse(one.residual.speeds)
    if problem.free_run_rmse(plain.residual.speeds) > limit:
        return False
    return _left_out_rmse(problem.plain(limit), plain) < (1.0 - NEGLIGIBLE) * _left_out_rmse(problem, one)


def _left_out_rmse(problem: Problem, one: Fit) -> float:
    """Free-run error of a structure on runs left out of its fit, m/s."""
    folds = folds_of(problem.data)
    return held_out(problem, one, folds, pose_folds(problem, folds)).rmse(problem.measured)


def _at_most(problem: Problem, one: Fit, other: Fit, plainly: bool) -> Fit:
    """`one`, or a refit of its structure whose error is at most that of `other`, which it contains."""
    limit = problem.free_run_rmse(other.residual.speeds)
    if not plainly and problem.free_run_rmse(one.residual.speeds) <= limit:
        return one
    refits = [plain_fit(problem, one, start) for start in (one, other)]
    return _smallest(problem, [one, *refits, _at_parameters_of(problem, one, other)])


def plain_fit(problem: Problem, one: Fit, start: Fit) -> Fit:
    """The structure of `one` fitted by plain least squares from the parameters of `start`."""
    plain = problem.plain(problem.free_run_rmse(one.residual.speeds))
    done = fit(plain, one.effects, start.theta, iterations=PLAIN_STEPS)
    return reevaluate(problem, done)


def _at_parameters_of(problem: Problem, one: Fit, other: Fit) -> Fit:
    """The structure of `one` at the parameters of `other`."""
    return Fit(one.effects, other.theta, one.columns, problem.residual(other.theta, one.effects))


def _smallest(problem: Problem, fits: Sequence[Fit]) -> Fit:
    return min(fits, key=lambda each: problem.free_run_rmse(each.residual.speeds))
