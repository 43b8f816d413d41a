"""Decision rules from fits to a verdict: effects named, ambiguity, unexplained residual structure.

Every limit is an effect size or a significance level; none belongs to one effect. A false positive costs
more than an ambiguous verdict, so an effect is named when it is significant (log-likelihood penalised for
every parameter, robust to the largest block) *and* large enough to matter beside the noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from truing.arrays import BoolArray
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.compare import SIGNIFICANT_GAIN
from truing.diagnose.disturbance import is_disturbance
from truing.diagnose.fit import Fit
from truing.diagnose.intermittent import comes_and_goes
from truing.diagnose.oscillation import find_oscillation
from truing.diagnose.pairs import both_significant, needs_both_effects, second_effect_alternatives
from truing.diagnose.problem import CLIP, MIN_NOISE_COUNTS, Problem
from truing.diagnose.residual_tests import Structure, find_bursts, residual_structure
from truing.diagnose.result import Verdict
from truing.diagnose.search import Search
from truing.diagnose.unseen_runs import NEGLIGIBLE, SIMILAR_BENEFIT, UnseenRuns

# A gain this large is significant even if a single block of time holds most of it, nats. Smallest RMS change
# of a signal, over its noise, for an effect to be named.
LARGE_GAIN = 150.0
MIN_DIFFERENCE = 0.25
# Another explanation is a rival if its gain is lower by less than this, nats, or its simulation differs by
# less than this multiple of the noise.
RIVAL_GAIN, RIVAL_TIMES = 6.0, 0.15
# Most effects listed under an ambiguous verdict, or so many more than the model has; pairs compared.
MAX_NAMED, MAX_MORE_NAMED, MAX_PAIRS_COMPARED = 3, 2, 5
# Predictable residual structure is unexplained beyond these: RMS over noise; standard errors of its share of
# the energy (or share of the runs in which anything is predicted: a few outlying runs inflate the standard
# error); and share of what was explained (in RMS, per effect).
STRUCTURE_RUNS = 0.75
STRUCTURE_TIMES_NOISE, STRUCTURE_ERRORS, STRUCTURE_SHARE = 0.33, 2.5, 0.3
# Predictable structure and bursts are unexplained also where they hold these shares of a wheel's residual
# energy and more than this share of the energy that the named effects explain.
MIN_PREDICTED_SHARE, MIN_BURST_SHARE, UNEXPLAINED_OF_EXPLAINED = 0.06, 0.12, 0.4
# Bursts in more than this share of the rows are taken for larger noise, unless their RMS is this multiple of
# the other rows'. Rows of a smaller weight are left out of the burst test.
MAX_BURST_ROWS, BURST_OVER_REST, MIN_ROW_WEIGHT = 0.1, 5.0, 0.5
# Residual RMS over quantisation RMS below which a residual is quantisation alone.
OVER_QUANTISATION = 1.2
# A model that leaves more than this many times the noise's floor leaves something real. Another effect is
# looked for above the lower limit: the floor includes an allowance for slow disturbances.
EXCESS_OF_FLOOR, SUSPECT_OF_FLOOR = 3.0, 0.5
# Beside something unexplained, effects are named if they remove this share of the energy above the noise; or
# these shares of the RMS error on runs left out (one effect; several), and add to runs that they make worse
# at most the last share of what they remove from others: an effect that imitates an unknown one does not hold
# in every run, and several small ones together imitate more.
MIN_EXPLAINED = 0.5
MIN_UNSEEN_BENEFIT, MIN_UNSEEN_BENEFIT_OF_SEVERAL, MAX_UNSEEN_LOSS = 0.15, 0.25, 0.02
# More effects are looked for beside two that take away at least this share.
MIN_EXPLAINED_BY_TWO = 0.4
# Confidence in an explanation that is as good with one effect fewer.
TIED_CONFIDENCE = 0.5
# RMS change of a signal, over its noise, beyond which the baseline's parameters are wrong.
MIN_PARAMETER_CHANGE = 0.15


@dataclass(frozen=True)
class Reasoning:
    """Everything that a verdict rests on.

    Attributes
    ----------
    given : the baseline with its own parameters.
    base : the baseline refitted.
    best : the selected model: the refitted baseline, or with effects.
    rivals : other fits that explain the recordings as well, best first.
    remaining : predictable structure in the residual of `best`.
    confidence : in `best`, 0 to 1.
    accepted : `best` is the user's choice, not the verdict's.
    plainly : the reported models are fitted by plain least squares, because they leave more than noise.
    """

    search: Search
    verdict: Verdict
    given: Fit
    base: Fit
    best: Fit
    rivals: tuple[Fit, ...]
    remaining: Structure
    confidence: float
    accepted: bool = False
    plainly: bool = False

    @property
    def problem(self) -> Problem:
        """Recordings and noise."""
        return self.search.problem

    @property
    def fitted_under(self) -> Problem:
        """The problem that the reported models solve."""
        problem = self.problem
        return problem.plain(problem.free_run_rmse(self.best.residual.speeds)) if self.plainly else problem


def decide(search: Search, best: Fit) -> Reasoning:
    """Verdict on the selected model of a search."""
    problem, base = search.problem, search.fits[()]
    start = problem.simulator.start()
    given = Fit((), start, (), problem.residual(start, ()))
    remaining = above_quantisation(problem, best, residual_structure(problem, best))
    rivals = rivals_of(search, best) if best.effects else ()
    if is_contradicted(search, best):
        verdict: Verdict = "unexplained"
    elif _leaves_something(search, best, remaining, EXCESS_OF_FLOOR):
        verdict = "partly_explained" if _is_named_beside_more(search, best) else "unexplained"
    elif best.effects:
        verdict = "ambiguous" if rivals else "missing_physics"
    else:
        change = search.compare(base, given)
        parameters_differ = change.gain > SIGNIFICANT_GAIN and change.times_noise > MIN_PARAMETER_CHANGE
        # Numbers that were fitted to these runs are nobody's claim.
        is_claimed = not problem.data.baseline.is_fitted
        verdict = "parameters_only" if parameters_differ and is_claimed else "consistent"
    sure = confidence(search, best)
    if any(len(rival.effects) < len(best.effects) for rival in rivals):
        sure = min(sure, TIED_CONFIDENCE)  # one effect fewer explains the recordings as well
    return Reasoning(search, verdict, given, base, best, rivals, remaining, sure)


def is_contradicted(search: Search, best: Fit) -> bool:
    """Whether the likelihood prefers another effect to the named one by far, and runs left out refuse it.

    The right equation leaves noise alone, and is both the most likely and the best on runs left out. Where
    none is both, the catalogue does not hold it. Several effects are chosen by runs left out alone.
    """
    if len(best.effects) != 1 or search.problem.exceeds_noise(best.residual.speeds):
        return False
    base = search.fits[()]
    return any(
        search.compare(other, best).gain > SIGNIFICANT_GAIN
        and is_named(search, other, base)
        and not _only_extends(search, best, other)
        for other in search.ranked(1)
        if other.effects != best.effects
    )


def _is_named_beside_more(search: Search, best: Fit) -> bool:
    """Whether the effects of `best` are named although something remains."""
    base = search.fits[()]
    if share_explained(search.problem, best, base) > MIN_EXPLAINED:
        return True
    if not best.effects:
        return False
    unseen = UnseenRuns.of(search)
    needed = MIN_UNSEEN_BENEFIT if len(best.effects) == 1 else MIN_UNSEEN_BENEFIT_OF_SEVERAL
    return unseen.benefit(best, base) > needed and unseen.loss_share(best, base) < MAX_UNSEEN_LOSS


def leaves_something(search: Search, best: Fit, times_floor: float = EXCESS_OF_FLOOR) -> bool:
    """Whether a model leaves more than so many floors of noise, and more than slow disturbances."""
    remaining = above_quantisation(search.problem, best, residual_structure(search.problem, best))
    return _leaves_something(search, best, remaining, times_floor)


def is_incomplete(search: Search, best: Fit) -> bool:
    """Whether another effect should be looked for beside those of `best`.

    Where two effects explain little, a third is a guess at physics that the catalogue lacks. Of an error that
    is all within the noise no share can be said.
    """
    problem, base = search.problem, search.fits[()]
    has_share = len(best.effects) > 1 and problem.exceeds_noise(base.residual.speeds)
    if has_share and share_explained(problem, best, base) < MIN_EXPLAINED_BY_TWO:
        return False
    return problem.exceeds_noise(best.residual.speeds) or leaves_something(search, best, SUSPECT_OF_FLOOR)


def _leaves_something(search: Search, best: Fit, remaining: Structure, times_floor: float) -> bool:
    problem, base = search.problem, search.fits[()]
    above = _is_above_quantisation(problem, best)
    return (
        has_residual_structure(remaining, best, base)
        or unexplained_exceeds_explained(search, remaining, best, base)
        or _exceeds_noise(problem, best, remaining, times_floor)
        or bool(np.any(comes_and_goes(problem, best) & above))
        or find_oscillation(problem, best) is not None
    )


def _exceeds_noise(problem: Problem, best: Fit, remaining: Structure, times_floor: float) -> bool:
    """Whether either wheel leaves more than so many floors, and not as a slow disturbance."""
    more = problem.rms_by_wheel(best.residual.speeds) > times_floor * problem.floor.rms
    return bool(more.any() and np.any(more & ~is_disturbance(problem, best, remaining)))


def select_model(search: Search, base: Fit) -> Fit:
    """The baseline, the best single effect to be named, or the best pair of which each is needed.

    None of them raises the error on runs left out, and no effect is taken whose special case does as well.
    """
    unseen = UnseenRuns.of(search)
    singles = [one for one in search.ranked(1)[:MAX_PAIRS_COMPARED] if is_named(search, one, base)]
    best = _best_on_unseen_runs(unseen, singles, base)
    best = next((one for one in singles if _only_extends(search, one, best)), best)
    pairs = [one for one in search.ranked(2)[:MAX_PAIRS_COMPARED] if needs_both_effects(search, one)]
    return _best_on_unseen_runs(unseen, pairs, best)


def _best_on_unseen_runs(unseen: UnseenRuns, fits: list[Fit], other: Fit) -> Fit:
    """The most likely of `fits` that does not raise the error of `other` on runs left out, or `other`.

    Where it leaves more than noise, likelihoods mislead: there another one with a clearly smaller error on
    runs left out is preferred.
    """
    good = (one for one in fits if unseen.benefit(one, other) > -NEGLIGIBLE)
    first = next(good, None)
    if first is None:
        return other
    if not unseen.problem.exceeds_noise(first.residual.speeds):
        return first
    rest = [first, *good]
    largest = max(unseen.benefit(one, other) for one in rest)
    return next(one for one in rest if unseen.benefit(one, other) >= largest - SIMILAR_BENEFIT)


def is_named(search: Search, one: Fit, other: Fit) -> bool:
    """Whether `one` is significantly better, and by a relevant size or with direct evidence."""
    more = search.compare(one, other)
    significant = more.robust_gain > SIGNIFICANT_GAIN or more.gain > LARGE_GAIN
    return significant and (more.times_noise > MIN_DIFFERENCE or has_more_direct_evidence(search, one, other))


def has_more_direct_evidence(search: Search, one: Fit, other: Fit) -> bool:
    """Whether the evidence that needs no robot model is significant, whatever the size in the speeds."""
    evidence = search.problem.evidence
    return evidence(one.effects) - evidence(other.effects) > SIGNIFICANT_GAIN


def rivals_of(search: Search, best: Fit) -> tuple[Fit, ...]:
    """Fits with as many effects that these recordings cannot distinguish from the best, best first.

    A rival must itself qualify to be named: an effect that hardly changes the signals explains nothing.
    """
    out = []
    base, unseen = search.fits[()], UnseenRuns.of(search)
    # Effects found step by step are judged on runs left out; a rival is not held to more than the best is.
    needs_both = len(best.effects) == 2 and needs_both_effects(search, best)
    for other in search.ranked(len(best.effects)):
        if set(other.effects) == set(best.effects):
            continue
        ahead = search.compare(best, other)
        similar = ahead.times_noise < RIVAL_TIMES and not has_more_direct_evidence(search, best, other)
        close = ahead.robust_gain < RIVAL_GAIN or similar
        named = is_named(search, other, base)
        named = named and (not needs_both or needs_both_effects(search, other))
        if close and named and not _only_extends(search, best, other) and unseen.benefit(other, base) > 0.0:
            out.append(other)
    if len(best.effects) == 2 and not both_significant(search, best):
        out += [
            one for one in second_effect_alternatives(search, best) if all(one is not each for each in out)
        ]
    return _limit_names(best, out)


def _limit_names(best: Fit, rivals: list[Fit]) -> tuple[Fit, ...]:
    """The first rival, and of the others those that keep the number of names within the limit."""
    names: set[str] = set(best.effects)
    max_named = max(MAX_NAMED, len(names) + MAX_MORE_NAMED)
    kept: list[Fit] = []
    for rival in rivals:
        if not kept or len(names.union(rival.effects)) <= max_named:
            kept.append(rival)
            names.update(rival.effects)
    return tuple(kept)


def _only_extends(search: Search, best: Fit, other: Fit) -> bool:
    """Whether `other` only generalises the best fit's effect with parameters that are not significant."""
    new = [name for name in other.effects if name not in best.effects]
    old = [name for name in best.effects if name not in other.effects]
    if len(new) != 1 or len(old) != 1 or CATALOGUE[new[0]].extends != old[0]:
        return False
    return search.compare(best, other).gain > -SIGNIFICANT_GAIN


def above_quantisation(problem: Problem, best: Fit, remaining: Structure) -> Structure:
    """The structure, without that of a wheel whose residual is quantisation alone.

    Repeated runs repeat their quantisation errors, which makes these predictable.
    """
    return replace(remaining, share=np.where(_is_above_quantisation(problem, best), remaining.share, 0.0))


def _is_above_quantisation(problem: Problem, best: Fit) -> BoolArray:
    """Whether each wheel's residual, shape (2,), is more than quantisation."""
    limit = OVER_QUANTISATION * MIN_NOISE_COUNTS * problem.data.resolution_mps
    return np.asarray(problem.rms_by_wheel(best.residual.speeds) > limit)


def has_residual_structure(remaining: Structure, best: Fit, base: Fit) -> bool:
    """Whether predictable structure is large relative to the noise and to what was explained."""
    after = (best.residual.wheels**2).mean(axis=0)
    explained = float(np.max((base.residual.wheels**2).mean(axis=0) - after))
    finer = STRUCTURE_SHARE**2 * max(len(best.effects), 1) * explained
    matters = (remaining.times_noise > STRUCTURE_TIMES_NOISE) & (remaining.share * after > finer)
    return bool(np.any(has_structure(remaining) & matters))


def has_structure(found: Structure) -> BoolArray:
    """Whether the predictable structure is significant, per wheel, shape (2,)."""
    return np.asarray(
        (found.share > STRUCTURE_ERRORS * found.error) | (found.predicted_runs >= STRUCTURE_RUNS)
    )


def unexplained_exceeds_explained(search: Search, remaining: Structure, best: Fit, base: Fit) -> bool:
    """Whether unexplained energy is large relative to what the effects explain."""
    problem = search.problem
    white = np.clip(best.residual.wheels, -CLIP, CLIP)  # weighted as the explained energy is
    energy = (white**2).sum(axis=0)
    significant = (remaining.share > STRUCTURE_ERRORS * remaining.error) & (
        remaining.share > MIN_PREDICTED_SHARE
    )
    weighted = np.where(problem.counted > MIN_ROW_WEIGHT, white, 0.0)
    bursts = find_bursts(problem.data, weighted)
    predicted = float(np.where(significant, remaining.share, 0.0) @ energy)
    rows = bursts.rows.mean(axis=0)
    above = bursts.share * (1.0 - rows) > BURST_OVER_REST**2 * rows * (1.0 - bursts.share)
    few = (rows < MAX_BURST_ROWS) | above
    in_bursts = float(np.where((bursts.share > MIN_BURST_SHARE) & few, bursts.share, 0.0) @ energy)
    explained = 2.0 * search.compare(best, base).gain if best.effects else 0.0
    return max(predicted, in_bursts) > UNEXPLAINED_OF_EXPLAINED * max(explained, 0.0)


def share_explained(problem: Problem, best: Fit, base: Fit) -> float:
    """Share of the refitted baseline's error energy above the noise that the effects take away, 0 to 1."""
    rows = (problem.counted > 0.0).sum(axis=0)
    noise = problem.floor.rms**2
    before, after = (
        float(rows @ np.maximum(problem.rms_by_wheel(one.residual.speeds) ** 2 - noise, 0.0))
        for one in (base, best)
    )
    return 1.0 - after / before if before > 0.0 else 0.0


def confidence(search: Search, best: Fit) -> float:
    """Share of the likelihood among models of the same size, tempered: the models are approximations."""
    if not best.effects:
        return 0.98
    worse = [
        max(search.compare(best, other).gain, 0.0)
        for other in search.ranked(len(best.effects))
        if set(other.effects) != set(best.effects)
    ]
    weights = np.exp(-0.5 * np.minimum(np.array([0.0, *worse]), 60.0))
    return float(min(0.99, weights[0] / weights.sum()))
