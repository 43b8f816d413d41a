"""Whether two effects are there together: surely, perhaps, or the second only mends the first one's equation.

No equation is exactly a robot's. What a first effect's leaves over, another effect's can follow a little: in
some runs, at the cost of others, and by less than the noise. An effect that is there helps wherever it acts.
"""

from __future__ import annotations

from truing.diagnose.compare import SURE_GAIN, differences, moment_gains, run_gains
from truing.diagnose.fit import Fit
from truing.diagnose.search import Search

# A second effect must be worth more than a first: in some signal it bends the model by this much of the noise
# and of what the first bends, and brings this share of the log-likelihood; or that one, where either part
# explains little by itself.
LEAST_SECOND, SECOND_SHARE, SECOND_GAIN, LONE_GAIN = 0.3, 0.15, 0.03, 0.3
# Two effects that are both there each explain by themselves about what they add to the other; one that mends
# the other's equation does not. Share of the first that the second is.
ALONE = 0.2
# A second effect is sure where it bends some signal by as much as the noise, and where the runs that it
# makes worse lose no more than this share of what it brings to all.
SURE_SECOND, MOST_HARM = 1.0, 0.03
# Another second effect that brings this share of what the best one does may as well be the one.
AS_WELL = 0.5


def needs_both(search: Search, pair: Fit) -> bool:
    """Whether neither part of a pair, nor any other single effect, does what the pair does."""
    base = search.fits[()]
    stands = [_stands(search, pair, name) for name in pair.effects]
    if not any(stands):
        return False  # two that explain nothing but together are an odd chance
    least = SECOND_GAIN if all(stands) else LONE_GAIN
    parts = (*_parts(search, pair), search.ranked(1)[0])
    return all(_adds(search, pair, part, base, least) for part in parts)


def surely_both(search: Search, pair: Fit) -> bool:
    """Whether the weaker part of a pair is more than a mend of the stronger one's equation."""
    first = stronger_part(search, pair)
    brought = run_gains(search.problem, pair, first)
    harm = -float(brought[brought < 0.0].sum())
    return search.better(pair, first).times_noise > SURE_SECOND and harm < MOST_HARM * float(brought.sum())


def doubted_second(search: Search, pair: Fit) -> list[Fit]:
    """What else a pair's doubtful second effect may be, the best first: nothing, or another effect."""
    first = stronger_part(search, pair)
    enough = AS_WELL * search.better(pair, first).gain
    others = [
        other
        for other in search.ranked(2)
        if set(other.effects) != set(pair.effects)
        and first.effects[0] in other.effects
        and search.better(other, first).gain > enough
    ]
    return [first, *others]


def stronger_part(search: Search, pair: Fit) -> Fit:
    """The part of a pair that explains more by itself."""
    return max(_parts(search, pair), key=lambda one: search.better(one, search.fits[()]).gain)


def _parts(search: Search, pair: Fit) -> list[Fit]:
    return [search.alone(name, pair) for name in pair.effects]


def _stands(search: Search, pair: Fit, name: str) -> bool:
    """Whether a part of a pair explains by itself what it adds to the other part, more or less."""
    one = search.alone(name, pair)
    other = search.alone(next(each for each in pair.effects if each != name), pair)
    added = search.better(pair, other).gain
    return search.better(one, search.fits[()]).spread > max(SURE_GAIN, ALONE * added)


def _adds(search: Search, pair: Fit, part: Fit, base: Fit, least: float) -> bool:
    problem = search.problem
    if search.better(pair, part).spread <= SURE_GAIN:
        return False
    more, first = differences(problem, pair, part), differences(problem, part, base)
    bends = any(a > max(LEAST_SECOND, SECOND_SHARE * b) for a, b in zip(more, first, strict=True))
    brought, total = moment_gains(problem, pair, part), moment_gains(problem, pair, base)
    brings = any(
        float(a.sum()) > max(SURE_GAIN, least * float(b.sum())) for a, b in zip(brought, total, strict=True)
    )
    return bends and brings
