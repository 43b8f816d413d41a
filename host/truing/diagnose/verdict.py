"""From fits to a verdict: what is accused, what is left in doubt, and when to say that nothing fits.

Every limit here is a size or a certainty that a reader can state; none belongs to one effect. A wrong
accusation costs more than an honest doubt, so an effect is named when it is sure (log-likelihood paid for
every number, and standard errors over blocks of time) *and* large enough to matter beside the noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from truing.diagnose.adequacy import Structure, find_bursts
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.compare import SURE_GAIN
from truing.diagnose.data import BoolArray
from truing.diagnose.fit import Fit, judge
from truing.diagnose.pairs import doubted_second, needs_both, surely_both
from truing.diagnose.problem import CLIP, LEAST_COUNTS, Problem
from truing.diagnose.result import Verdict
from truing.diagnose.search import Search

# A moment is evidence where it says this much: no knock is told so well by numbers that say nothing
# everywhere else. What the numbers leave of it is weighed as any other rest.
LOUD_GAIN = 150.0
LEAST_FIRST = 0.25
# Another explanation is a rival unless it is worse by this much.
RIVAL_GAIN, RIVAL_TIMES = 6.0, 0.15
# A doubt between more names than this helps nobody: of many rivals the best are told.
MOST_NAMED, MOST_PAIRS_WEIGHED = 3, 5
# What a flexible model still foretells is unexplained beyond these: RMS over noise, standard errors of the
# share (or so many of the runs in which it foretells at all: a few loud ones make the error large), share
# (in RMS, of one effect; the remainders of two add up) of what was explained.
LEFT_RUNS = 0.75
LEFT_TIMES, LEFT_ERRORS, LEFT_SHARE = 0.33, 2.5, 0.3
# What is left, foretold or in moments that no noise makes, is unexplained also where it holds this share
# of a wheel's residual energy and the accused effects took away less than a few times as much.
LEAST_FORETOLD, LEAST_BURSTS, LEFT_OF_EXPLAINED = 0.06, 0.12, 0.4
# Bursts in more than this share of the rows are no events, the noise itself is larger there, unless they
# stand this many times above the rest in RMS. A row that counts for less than this says nothing of events.
MOST_BURST_ROWS, ABOVE_REST, LEAST_WEIGHT = 0.1, 5.0, 0.5
# A residual is more than rounding above this many times rounding's own RMS.
ABOVE_ROUNDING = 1.2
# Confidence in an explanation that is as good with an effect less.
EVEN = 0.5
# The baseline's numbers are off beyond this RMS over noise.
OFF_TIMES = 0.15


@dataclass(frozen=True)
class Reasoning:
    """Everything that a verdict rests on.

    Attributes
    ----------
    best : the model to show: the baseline refitted, or with effects.
    rivals : other fits that explain as well, best first.
    left : what a flexible model foretells of what `best` leaves over.
    """

    search: Search
    verdict: Verdict
    given: Fit
    base: Fit
    best: Fit
    rivals: tuple[Fit, ...]
    left: Structure
    tried: tuple[str, ...]
    confidence: float
    notes: tuple[str, ...] = field(default=())

    @property
    def problem(self) -> Problem:
        """Recordings and noise."""
        return self.search.problem


def reason(search: Search, tried: list[str], structure_of: Callable[[Problem, Fit], Structure]) -> Reasoning:
    """Weigh the fits of a search."""
    problem, base = search.problem, search.fits[()]
    start = problem.simulator.start()
    given = Fit((), start, (), problem.residual(start, ()))
    best = choose(search, base)
    left = beyond_resolution(problem, best, structure_of(problem, best))
    rivals = rivals_of(search, best) if best.effects else ()
    if remains(left, best, base) or outweighs(search, left, best, base):
        verdict: Verdict = "unexplained"
    elif best.effects:
        verdict = "ambiguous" if rivals else "missing_physics"
    else:
        off = search.better(base, given)
        moved = off.gain > SURE_GAIN and off.times_noise > OFF_TIMES
        verdict = "parameters_only" if moved else "consistent"
    sure = confidence(search, best)
    if any(len(rival.effects) < len(best.effects) for rival in rivals):
        sure = min(sure, EVEN)  # whether all of its effects are there is open
    return Reasoning(search, verdict, given, base, best, rivals, left, tuple(tried), sure)


def choose(search: Search, base: Fit) -> Fit:
    """The baseline, the best single effect that matters, or the best two that each are needed."""
    matter = (one for one in search.ranked(1) if accused(search, one, base))
    best = next(matter, base)
    for pair in search.ranked(2)[:MOST_PAIRS_WEIGHED]:
        if needs_both(search, pair):
            return pair
    return best


def accused(search: Search, one: Fit, other: Fit) -> bool:
    """Whether `one` is surely and materially better; what two signals tell by themselves is material."""
    more = search.better(one, other)
    sure = more.spread > SURE_GAIN or more.gain > LOUD_GAIN
    return sure and (more.times_noise > LEAST_FIRST or _told_more(search, one, other))


def _told_more(search: Search, one: Fit, other: Fit) -> bool:
    """Whether recorded signals say it without any model of the robot, in whose noise its size would drown."""
    told = search.problem.evidence
    return told(one.effects) - told(other.effects) > SURE_GAIN


def rivals_of(search: Search, best: Fit) -> tuple[Fit, ...]:
    """Fits with as many effects that the recordings cannot tell from the best, best first.

    A rival would be accused if the best were not there: what hardly bends the signals explains nothing.
    """
    out = []
    base = search.fits[()]
    for other in search.ranked(len(best.effects)):
        if set(other.effects) == set(best.effects):
            continue
        ahead = search.better(best, other)
        alike = ahead.times_noise < RIVAL_TIMES and not _told_more(search, best, other)
        close = ahead.spread < RIVAL_GAIN or alike
        named = accused(search, other, base)
        named = named and (len(other.effects) < 2 or needs_both(search, other))
        if close and named and not _only_richer(search, best, other):
            out.append(other)
    if len(best.effects) > 1 and not surely_both(search, best):
        out += [one for one in doubted_second(search, best) if all(one is not each for each in out)]
    return _told(best, out)


def _told(best: Fit, rivals: list[Fit]) -> tuple[Fit, ...]:
    """The first rival, and of the others those that bring no more names than a doubt may have."""
    names: set[str] = set(best.effects)
    told: list[Fit] = []
    for rival in rivals:
        if not told or len(names.union(rival.effects)) <= MOST_NAMED:
            told.append(rival)
            names.update(rival.effects)
    return tuple(told)


def _only_richer(search: Search, best: Fit, other: Fit) -> bool:
    """Whether the other says the same with more numbers that it does not need."""
    new = [name for name in other.effects if name not in best.effects]
    old = [name for name in best.effects if name not in other.effects]
    if len(new) != 1 or len(old) != 1 or CATALOGUE[new[0]].extends != old[0]:
        return False
    return search.better(best, other).gain > -SURE_GAIN


def beyond_resolution(problem: Problem, best: Fit, left: Structure) -> Structure:
    """The structure, without that of a wheel whose whole residual is what rounding to counts makes.

    Runs that repeat each other repeat their rounding too, so that it can be foretold; it says nothing.
    """
    residual = problem.data.speed_mps - best.residual.speeds
    weight = problem.counted
    rms = np.sqrt((weight * residual**2).sum(axis=0) / np.maximum(weight.sum(axis=0), 1.0))
    seen = rms > ABOVE_ROUNDING * LEAST_COUNTS * problem.data.resolution_mps
    return replace(left, share=np.where(seen, left.share, 0.0))


def remains(left: Structure, best: Fit, base: Fit) -> bool:
    """Whether structure is left that matters, beside the noise and beside what was explained."""
    after = (best.residual.wheels**2).mean(axis=0)
    explained = float(np.max((base.residual.wheels**2).mean(axis=0) - after))
    finer = LEFT_SHARE**2 * max(len(best.effects), 1) * explained
    matters = (left.times_noise > LEFT_TIMES) & (left.share * after > finer)
    return bool(np.any(foretells(left) & matters))


def foretells(found: Structure) -> BoolArray:
    """Whether there is structure for sure, shape (2,)."""
    return np.asarray((found.share > LEFT_ERRORS * found.error) | (found.helped >= LEFT_RUNS))


def outweighs(search: Search, left: Structure, best: Fit, base: Fit) -> bool:
    """Whether what is left weighs much beside what was explained: then the name is not the right one."""
    problem = search.problem
    white = np.clip(best.residual.wheels, -CLIP, CLIP)  # as what was explained is counted
    energy = (white**2).sum(axis=0)
    sure = (left.share > LEFT_ERRORS * left.error) & (left.share > LEAST_FORETOLD)
    known = np.where(problem.counted > LEAST_WEIGHT, white, 0.0)
    bursts = find_bursts(problem.data, known)
    foretold = float(np.where(sure, left.share, 0.0) @ energy)
    rows = bursts.rows.mean(axis=0)
    above = bursts.share * (1.0 - rows) > ABOVE_REST**2 * rows * (1.0 - bursts.share)
    few = (rows < MOST_BURST_ROWS) | above
    sudden = float(np.where((bursts.share > LEAST_BURSTS) & few, bursts.share, 0.0) @ energy)
    explained = 2.0 * search.better(best, base).gain if best.effects else 0.0
    return max(foretold, sudden) > LEFT_OF_EXPLAINED * max(explained, 0.0)


def confidence(search: Search, best: Fit) -> float:
    """Share of the likelihood, tempered: the models are no exact truths."""
    if not best.effects:
        return 0.98
    worse = [
        max(search.better(best, other).gain, 0.0)
        for other in search.ranked(len(best.effects))
        if set(other.effects) != set(best.effects)
    ]
    weights = np.exp(-0.5 * np.minimum(np.array([0.0, *worse]), 60.0))
    return float(min(0.99, weights[0] / weights.sum()))


__all__ = ["Reasoning", "judge", "reason"]
