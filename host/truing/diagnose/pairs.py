"""Whether the second effect of a pair is significant, uncertain, or only compensates errors of the first.

The equations are approximations of a robot. A second effect can absorb part of the first one's remaining
model error: in some runs, at the cost of others, and by less than the noise. An effect that is present
improves every run in which it acts.
"""

from __future__ import annotations

from truing.diagnose.compare import SIGNIFICANT_GAIN, block_gains, differences, run_gains
from truing.diagnose.fit import Fit
from truing.diagnose.search import Search

# A second effect must change some signal by this multiple of the noise and by this share of the first
# effect's change, and bring this share of the log-likelihood gain; or the last one, where one of the two
# explains little by itself.
MIN_SECOND_DIFFERENCE, MIN_SECOND_OF_FIRST, MIN_SECOND_GAIN, MIN_GAIN_BESIDE_WEAK = 0.3, 0.15, 0.03, 0.3
# An effect that is present explains by itself about as much as it adds to the other one; one that only
# compensates the other's model error does not. Minimum ratio of the two gains.
MIN_ALONE_SHARE = 0.2
# A second effect is significant if it changes some signal by as much as the noise, and if the loss in runs
# that it makes worse is at most this share of its total gain.
SIGNIFICANT_SECOND, MAX_LOSS_SHARE = 1.0, 0.03
# Another second effect with this share of the best one's gain is an alternative to it.
COMPARABLE_GAIN = 0.5


def needs_both_effects(search: Search, pair: Fit) -> bool:
    """Whether the pair improves on each of its effects alone and on the best single effect."""
    base = search.fits[()]
    alone = [_significant_alone(search, pair, name) for name in pair.effects]
    if not any(alone):
        return False  # gains that only the combination has are attributed to chance
    min_share = MIN_SECOND_GAIN if all(alone) else MIN_GAIN_BESIDE_WEAK
    parts = (*_parts(search, pair), search.ranked(1)[0])
    return all(_improves_on(search, pair, part, base, min_share) for part in parts)


def both_significant(search: Search, pair: Fit) -> bool:
    """Whether the weaker effect of a pair is significant beside the stronger one."""
    first = stronger_part(search, pair)
    gains = run_gains(search.problem, pair, first)
    loss = -float(gains[gains < 0.0].sum())
    return search.compare(pair, first).times_noise > SIGNIFICANT_SECOND and loss < MAX_LOSS_SHARE * float(
        gains.sum()
    )


def second_effect_alternatives(search: Search, pair: Fit) -> list[Fit]:
    """Alternatives to an uncertain second effect, best first: none, or another effect."""
    first = stronger_part(search, pair)
    min_gain = COMPARABLE_GAIN * search.compare(pair, first).gain
    others = [
        other
        for other in search.ranked(2)
        if set(other.effects) != set(pair.effects)
        and first.effects[0] in other.effects
        and search.compare(other, first).gain > min_gain
    ]
    return [first, *others]


def stronger_part(search: Search, pair: Fit) -> Fit:
    """The effect of a pair that explains more by itself."""
    return max(_parts(search, pair), key=lambda one: search.compare(one, search.fits[()]).gain)


def _parts(search: Search, pair: Fit) -> list[Fit]:
    return [search.single(name, pair) for name in pair.effects]


def _significant_alone(search: Search, pair: Fit, name: str) -> bool:
    """Whether an effect of a pair is significant by itself, compared with what it adds to the other one."""
    one = search.single(name, pair)
    other = search.single(next(each for each in pair.effects if each != name), pair)
    added = search.compare(pair, other).gain
    return search.compare(one, search.fits[()]).robust_gain > max(SIGNIFICANT_GAIN, MIN_ALONE_SHARE * added)


def _improves_on(search: Search, pair: Fit, part: Fit, base: Fit, min_share: float) -> bool:
    problem = search.problem
    if search.compare(pair, part).robust_gain <= SIGNIFICANT_GAIN:
        return False
    more, first = differences(problem, pair, part), differences(problem, part, base)
    changes_signal = any(
        a > max(MIN_SECOND_DIFFERENCE, MIN_SECOND_OF_FIRST * b) for a, b in zip(more, first, strict=True)
    )
    gains, total = block_gains(problem, pair, part), block_gains(problem, pair, base)
    more_likely = any(
        float(a.sum()) > max(SIGNIFICANT_GAIN, min_share * float(b.sum()))
        for a, b in zip(gains, total, strict=True)
    )
    return changes_signal and more_likely
