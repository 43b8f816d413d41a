"""Models in which one effect of the selected model is exchanged for another that may be as good.

A model of several effects is found step by step, so that at each step the explanation that came second is
dropped. Beside the other effects it may explain the recordings as well: a dead band of the driver and dry
friction, a filter and a delay. Those models are fitted here, so that the verdict can compare them.
"""

from __future__ import annotations

from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.compare import largest_difference
from truing.diagnose.fit import Fit, fit
from truing.diagnose.intervals import covariance, not_different_from_absent
from truing.diagnose.noise_updates import under_noise_of
from truing.diagnose.ordered_errors import plain_fit
from truing.diagnose.search import Search, effect_set
from truing.diagnose.stepwise import ends_at_a_limit, extend_model, is_worth_it, next_effect
from truing.diagnose.unseen_runs import NEGLIGIBLE, SIMILAR_BENEFIT, UnseenRuns
from truing.diagnose.verdict import is_incomplete, is_named

# An effect is exchanged for others, so many at most, whose simulation by themselves differs from its own by
# at most this share of what it changes.
MAX_DIFFERENCE, MAX_OTHERS = 0.5, 2
ITERATIONS = 10


def with_exchanges(search: Search, best: Fit, single_fits: Search) -> Search:
    """The search with the fits of `best` in which one effect is exchanged.

    Parameters
    ----------
    single_fits : an earlier search that still has the fits of single effects.
    """
    if len(best.effects) > 1:
        for name in best.effects:
            for other in _alternatives(single_fits, name, best):
                _fit_exchanged(search, best, name, other)
    return search


def best_exchange(search: Search, best: Fit) -> Fit:
    """`best`, or the model with one effect exchanged that has a clearly smaller error on runs left out.

    Where a model leaves more than noise no noise model is right, and of models that are about as likely the
    one with the smaller free-run error is better for what it is used for.
    """
    problem = search.problem
    if not best.effects or not problem.exceeds_noise(best.residual.speeds):
        return best
    unseen = UnseenRuns.beside(search, best)
    limit = (1.0 - NEGLIGIBLE) * _plain_error(search, best)
    better = [one for one in _exchanged(search, best) if _plain_error(search, one) < limit]
    benefits = [(unseen.benefit(one, best), one) for one in better if _is_sound(search, one)]
    benefit, one = max(benefits, key=lambda item: item[0], default=(0.0, best))
    return one if benefit > NEGLIGIBLE else best


def extended_exchange(search: Search, best: Fit) -> tuple[Search, Fit]:
    """The search and `best`, or a model as good with one effect exchanged, extended by what it alone takes.

    A dead band and dry friction are alike until the friction differs between directions.
    """
    if not best.effects or not is_incomplete(search, best):
        return search, best
    unseen = UnseenRuns.beside(search, best)
    others = [one for one in _exchanged(search, best) if not _generalises(one, best)]
    sound = [one for one in others[:MAX_OTHERS] if _is_sound(search, one)]
    one = max(sound, key=lambda each: unseen.benefit(each, best), default=None)
    if one is None or unseen.benefit(one, best) < -SIMILAR_BENEFIT:
        return search, best
    found = next_effect(search, one)
    if found is None or not is_worth_it(search, unseen, found, best):
        return search, best
    search = under_noise_of(search, found)
    return extend_model(search, search.fits[effect_set(*found.effects)])


def _exchanged(search: Search, best: Fit) -> list[Fit]:
    """Fits that share all but one effect with `best`."""
    own = set(best.effects)
    return [one for one in search.ranked(len(own)) if len(own & set(one.effects)) == len(own) - 1]


def _generalises(one: Fit, best: Fit) -> bool:
    """Whether the effect that `one` has instead holds the one of `best` as a special case."""
    return any(CATALOGUE[name].extends in best.effects for name in set(one.effects) - set(best.effects))


def _plain_error(search: Search, one: Fit) -> float:
    """Free-run error of a structure fitted by plain least squares, m/s."""
    problem = search.problem
    return problem.free_run_rmse(plain_fit(problem, one, one).residual.speeds)


def _is_sound(search: Search, one: Fit) -> bool:
    """Whether every effect is significant, differs from its absence, and ends within its range."""
    problem = search.problem
    return (
        is_named(search, one, search.fits[()])
        and not any(ends_at_a_limit(problem, one, name) for name in one.effects)
        and not not_different_from_absent(problem, one, covariance(problem, one))
    )


def _alternatives(single_fits: Search, name: str, best: Fit) -> list[Fit]:
    """Single effects that change the signals as this one does, most similar first."""
    alone = single_fits.fits.get((name,))
    if alone is None:
        return []
    problem = single_fits.problem
    others = [one for one in single_fits.ranked(1) if one.effects[0] not in best.effects]
    apart = [largest_difference(problem, alone, one) for one in others]
    limit = MAX_DIFFERENCE * largest_difference(problem, alone, single_fits.fits[()])
    similar = sorted((size, k) for k, size in enumerate(apart) if size < limit)
    return [others[k] for _, k in similar[:MAX_OTHERS]]


def _fit_exchanged(search: Search, best: Fit, name: str, other: Fit) -> None:
    effects = tuple(other.effects[0] if each == name else each for each in best.effects)
    if effect_set(*effects) in search.fits:
        return
    start = best.theta.copy()
    for column in other.columns:
        if column.effect == other.effects[0]:
            entries = list(column.entries)
            start[entries] = other.theta[entries]
    search.fits[effect_set(*effects)] = fit(search.problem, effects, start, iterations=ITERATIONS)
