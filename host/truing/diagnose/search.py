"""Model structure search: fits of the baseline, of single effects and of pairs, each made once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.compare import Comparison, compare_fits
from truing.diagnose.fit import Fit, fit
from truing.diagnose.problem import Problem
from truing.diagnose.screen import Candidate, Probes, rank_candidates, simulate_probes

# Iterations from each starting value before the best one is continued.
PRELIMINARY_STEPS = 5
# Predicted gain of the score test above which an effect is fitted, nats.
MIN_CANDIDATE_GAIN = 2.0
# Beside several other effects the scale of the counts is one with the gain, and counts lost at speed are one
# with a gain that falls: what the others leave is no evidence for either.
ONE_WITH_THE_GAIN = ("encoder_scale", "encoder_dropout")
# Effects whose simulation needs short substeps are tried beside others if their gain is so many times larger.
SHORT_STEPS_GAIN = 1.5
# So many of the best candidates are always fitted; of the others those whose predicted gain is this share of
# the best fit's gain.
ALWAYS_FITTED, MIN_SHARE_OF_BEST = 4, 0.2


@dataclass
class Search:
    """Fits under one noise model.

    Attributes
    ----------
    probes : simulated changes by each effect that may be named.
    jobs : threads (the simulator releases the interpreter lock).
    fits : by their effects, sorted.
    predicted_gains : of the score tests, nats, by effects, sorted.
    """

    problem: Problem
    probes: Probes
    jobs: int = 2
    fits: dict[tuple[str, ...], Fit] = field(default_factory=dict)
    predicted_gains: dict[tuple[str, ...], float] = field(default_factory=dict)

    @classmethod
    def from_baseline(cls, problem: Problem, base: Fit, names: Sequence[str], jobs: int) -> Search:
        """A search among these effects that starts at the refitted baseline."""
        return cls(problem, simulate_probes(problem, base, names), jobs, {(): base})

    def extend(self, anchor: Fit, max_count: int) -> list[Fit]:
        """Fit `anchor` with each of the best candidates added; existing fits are reused."""
        candidates = rank_candidates(self.problem, anchor, self.probes)
        for candidate in candidates:
            self.predicted_gains[effect_set(*anchor.effects, candidate.name)] = candidate.gain
        promising = [p for p in candidates if p.gain > MIN_CANDIDATE_GAIN][:max_count]
        found = self._fit_all(anchor, promising[:ALWAYS_FITTED])
        best = max((self.compare(one, anchor).gain for one in found), default=0.0)
        return found + self._fit_all(
            anchor, [p for p in promising[ALWAYS_FITTED:] if p.gain > MIN_SHARE_OF_BEST * best]
        )

    def _fit_all(self, anchor: Fit, candidates: Sequence[Candidate]) -> list[Fit]:
        missing = [p for p in candidates if effect_set(*anchor.effects, p.name) not in self.fits]
        with ThreadPoolExecutor(self.jobs) as pool:
            for one in pool.map(lambda p: self._fit(anchor, p), missing):
                self.fits[effect_set(*one.effects)] = one
        return [self.fits[effect_set(*anchor.effects, p.name)] for p in candidates]

    def _fit(self, anchor: Fit, candidate: Candidate) -> Fit:
        effects = (*anchor.effects, candidate.name)
        problem = self.problem.for_thread()
        starts = candidate.starts
        columns = problem.columns_of(effects)
        # Far from the minimum a nuisance parameter leads a fit away from where the effect shows.
        nuisances = {f"{candidate.name}.{p.name}" for p in CATALOGUE[candidate.name].parameters if p.nuisance}
        first = tuple(column for column in columns if column.name not in nuisances)
        if len(starts) == 1 and first == columns:
            return self._not_worse_than(
                anchor, fit(problem, effects, starts[0], iterations=PRELIMINARY_STEPS + 15)
            )
        preliminary = [
            fit(problem, effects, start, columns=first, iterations=PRELIMINARY_STEPS, tolerance=1e-3)
            for start in starts
        ]
        best = min(preliminary, key=lambda one: one.cost)
        return self._not_worse_than(anchor, fit(problem, effects, best.theta, iterations=15))

    def _not_worse_than(self, anchor: Fit, done: Fit) -> Fit:
        """The fit, or the anchor with the effect at zero where the optimisation ended worse."""
        if done.cost <= anchor.cost:
            return done
        return Fit(done.effects, anchor.theta, done.columns, anchor.residual)

    def compare(self, one: Fit, other: Fit) -> Comparison:
        """Compare `one` with `other`; positive gains favour `one`."""
        return compare_fits(self.problem, one, other)

    def quick_fits(self, anchor: Fit, max_count: int) -> list[Fit]:
        """`anchor` with each of the best candidates added, after few iterations, largest gain first."""
        excluded = {*anchor.effects, *ONE_WITH_THE_GAIN, *_related(anchor.effects)}
        names = [name for name in self.probes if name not in excluded]
        probes = simulate_probes(self.problem, anchor, names)
        candidates = _affordable(rank_candidates(self.problem, anchor, probes))[:max_count]
        with ThreadPoolExecutor(self.jobs) as pool:
            found = list(
                pool.map(
                    lambda c: fit(
                        self.problem.for_thread(),
                        (*anchor.effects, c.name),
                        c.starts[0],
                        iterations=PRELIMINARY_STEPS,
                        tolerance=1e-3,
                    ),
                    [c for c in candidates if c.gain > MIN_CANDIDATE_GAIN],
                )
            )
        return sorted(found, key=lambda one: -self.compare(one, anchor).gain)

    def with_effect(self, anchor: Fit, name: str) -> Fit:
        """`anchor` with this effect added, fitted from the starting values of its score test."""
        probes = simulate_probes(self.problem, anchor, [name])
        return self._fit(anchor, rank_candidates(self.problem, anchor, probes)[0])

    def refined(self, one: Fit, anchor: Fit) -> Fit:
        """A quick fit continued to its end, and kept."""
        done = self._not_worse_than(anchor, fit(self.problem, one.effects, one.theta, iterations=15))
        self.fits[effect_set(*one.effects)] = done
        return done

    def single(self, name: str, pair: Fit) -> Fit:
        """The fit of one effect of a pair by itself, made now if it was not fitted before."""
        if (name,) not in self.fits:
            done = fit(self.problem, (name,), pair.theta, iterations=15)
            self.fits[name,] = self._not_worse_than(self.fits[()], done)
        return self.fits[name,]

    def ranked(self, count: int) -> list[Fit]:
        """Fits with this many effects, largest penalised gain first."""
        base = self.fits[()]
        of_size = [one for names, one in self.fits.items() if len(names) == count]
        return sorted(of_size, key=lambda one: -self.compare(one, base).gain)

    def refitted_under(self, problem: Problem, keep: Sequence[Fit]) -> Search:
        """A search under another noise model, with these fits refined."""
        other = Search(problem, self.probes, self.jobs, predicted_gains=dict(self.predicted_gains))
        with ThreadPoolExecutor(self.jobs) as pool:
            done = pool.map(lambda one: fit(problem.for_thread(), one.effects, one.theta, iterations=6), keep)
            other.fits = {effect_set(*one.effects): one for one in done}
        return other


def _related(effects: Sequence[str]) -> set[str]:
    """Effects that generalise one of these, or are a special case of it: one model holds one of the two."""
    general = {name for name, effect in CATALOGUE.items() if effect.extends in effects}
    return general | {CATALOGUE[name].extends for name in effects}


def _affordable(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Without effects that need short substeps, unless they promise clearly more than those that do not."""
    exact = max((c.gain for c in candidates if math.isinf(CATALOGUE[c.name].step_share)), default=0.0)
    return [
        c for c in candidates if math.isinf(CATALOGUE[c.name].step_share) or c.gain > SHORT_STEPS_GAIN * exact
    ]


def effect_set(*names: str) -> tuple[str, ...]:
    """Key of a set of effects, independent of their order."""
    return tuple(sorted(names))
