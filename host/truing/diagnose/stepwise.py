"""Forward and backward steps over the catalogue, judged on runs left out.

A robot has several effects at once, and a model that lacks some of them hides the others in its error.
From the best model so far every other effect is tried; of the most likely the one with the smallest error on
runs left out is kept, if it is significant and lowers that error. At the end every earlier effect is taken
out again to see whether it is still needed (stepwise regression: Efroymson 1960; cross-validation: Stone
1974).
"""

from __future__ import annotations

from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.compare import SIGNIFICANT_GAIN
from truing.diagnose.fit import Fit, fit
from truing.diagnose.intervals import covariance, not_different_from_absent
from truing.diagnose.noise_updates import under_noise_of
from truing.diagnose.problem import Problem
from truing.diagnose.search import Search, effect_set
from truing.diagnose.unseen_runs import NEGLIGIBLE, SIMILAR_BENEFIT, UnseenRuns
from truing.diagnose.verdict import (
    MIN_DIFFERENCE,
    SUSPECT_OF_FLOOR,
    has_more_direct_evidence,
    is_incomplete,
    leaves_something,
)

# Effects in one model, candidates that are fitted in one step, and of these tried on runs left out, at most.
MAX_EFFECTS, MAX_CANDIDATES, MAX_TRIED = 6, 4, 3
# A parameter closer to a bound than this share of its range is at it.
AT_A_LIMIT = 1e-3
# An effect whose likelihood is not significant lowers the error on runs left out by at least this share, and
# adds to runs that it makes worse at most this share of what it removes from others.
MIN_BENEFIT, MAX_LOSS_SHARE = 0.03, 0.25
# The same of a model that leaves no more than noise, where the likelihood is about as good.
MIN_BENEFIT_WITHIN_NOISE = 0.1


def extend_model(search: Search, best: Fit) -> tuple[Search, Fit]:
    """Add effects to `best` while something is unexplained and each is worth it.

    Returns
    -------
    The search under the noise model of the last fit, and the model.
    """
    first = len(best.effects)
    while len(best.effects) < MAX_EFFECTS and is_incomplete(search, best):
        found = next_effect(search, best)
        if found is None:
            break
        search = under_noise_of(search, found)
        best = search.fits[effect_set(*found.effects)]
    if len(best.effects) > first:
        best = _pruned(search, UnseenRuns.beside(search, best), best)
    return search, best


def without_uncertain_effects(search: Search, best: Fit) -> Fit:
    """`best` without effects whose intervals contain that they are absent, the least likely first."""
    while best.effects:
        spread = covariance(search.problem, best)
        uncertain = not_different_from_absent(search.problem, best, spread)
        if not uncertain:
            break
        fewer = [_without(search, best, name) for name in uncertain]
        best = min(fewer, key=lambda one: one.cost)
    return best


def _without(search: Search, best: Fit, name: str) -> Fit:
    rest = effect_set(*(other for other in best.effects if other != name))
    if rest not in search.fits:
        search.fits[rest] = fit(search.problem, rest, best.theta, iterations=10)
    return search.fits[rest]


def next_effect(search: Search, best: Fit) -> Fit | None:
    """The best model with one effect more, or None where none is worth it."""
    unseen = UnseenRuns.beside(search, best)
    tried = [search.refined(one, best) for one in search.quick_fits(best, MAX_CANDIDATES)[:MAX_TRIED]]
    worth = [one for one in tried if is_worth_it(search, unseen, one, best)]
    largest = max((unseen.benefit(one, best) for one in worth), default=0.0)
    # Where benefits are alike the likelihood decides; `tried` is in its order.
    return next((one for one in worth if unseen.benefit(one, best) > largest - SIMILAR_BENEFIT), None)


def is_worth_it(search: Search, unseen: UnseenRuns, one: Fit, other: Fit) -> bool:
    """Whether `one` is significantly better than `other`, a smaller model, and better on runs left out.

    Where a model leaves more than noise, no noise model is right and the likelihood is only a lower bound:
    there a benefit on runs left out, at the cost of no other run, is evidence as well, and a large one is
    wherever the likelihood does not object.
    """
    if any(ends_at_a_limit(search.problem, one, name) for name in one.effects if name not in other.effects):
        return False
    more = search.compare(one, other)
    exceeds_noise = search.problem.exceeds_noise(other.residual.speeds)
    matters = (
        exceeds_noise or more.times_noise > MIN_DIFFERENCE or has_more_direct_evidence(search, one, other)
    )
    if more.robust_gain > SIGNIFICANT_GAIN and matters:
        benefit = unseen.benefit(one, other)
        # Beside a slow disturbance an effect may imitate it, in part.
        return benefit > MIN_BENEFIT or (
            benefit > NEGLIGIBLE and leaves_something(search, other, SUSPECT_OF_FLOOR)
        )
    likely = exceeds_noise or more.gain > 0.0
    if not likely or _free_run_error(search, one) > _free_run_error(search, other):
        return False
    needed = MIN_BENEFIT if exceeds_noise else MIN_BENEFIT_WITHIN_NOISE
    return unseen.benefit(one, other) > needed and unseen.loss_share(one, other) < MAX_LOSS_SHARE


def ends_at_a_limit(problem: Problem, done: Fit, name: str) -> bool:
    """Whether the fit asks for more of an effect than the catalogue holds possible."""
    absent = problem.simulator.start()
    shaping = {f"{name}.{p.name}" for p in CATALOGUE[name].parameters if p.nuisance or p.scan}
    for column in done.columns:
        entry = column.entries[0]
        if column.effect == name and column.name not in shaping:
            value, reach = float(done.theta[entry]), AT_A_LIMIT * (column.upper - column.lower)
            at_a_limit = not column.lower + reach < value < column.upper - reach
            if at_a_limit and abs(value - absent[entry]) > reach:
                return True
    return False


def _free_run_error(search: Search, one: Fit) -> float:
    return search.problem.free_run_rmse(one.residual.speeds)


def _pruned(search: Search, unseen: UnseenRuns, best: Fit) -> Fit:
    """`best` without the effects that it no longer needs."""
    for name in best.effects[:-1]:
        less = _without(search, best, name)
        if not is_worth_it(search, unseen, best, less):
            return _pruned(search, unseen, less)
    return best
