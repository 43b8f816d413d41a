"""Models in which one effect of the selected model is exchanged for another that may be as good.

A model of several effects is found step by step, so that at each step the explanation that came second is
dropped. Beside the other effects it may explain the recordings as well: a dead band of the driver and dry
friction, a filter and a delay. Those models are fitted here, so that the verdict can compare them.
"""

from __future__ import annotations

from truing.diagnose.compare import largest_difference
from truing.diagnose.fit import Fit, fit
from truing.diagnose.search import Search, effect_set

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
