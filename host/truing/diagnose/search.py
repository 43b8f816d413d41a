"""The fits of a diagnosis, each made once: the baseline, effects one at a time, and in pairs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from truing.diagnose.compare import Advantage, advantage
from truing.diagnose.fit import Fit, fit
from truing.diagnose.problem import Problem
from truing.diagnose.screen import Looks, Prospect, looks_of, screen

Progress = Callable[[float], None]
# A start is scouted this many steps before the best goes on.
SCOUT_STEPS = 5
# Log-likelihood that the screen must promise before an effect is worth a fit, nats.
WORTH_A_FIT = 2.0
# The most promising are always fitted; of the others those that promise this share of the best fit's gain.
ALWAYS, WORTH_OF_BEST = 4, 0.2


@dataclass
class Search:
    """Fits under one idea of the noise; `jobs` threads share them (the simulator releases the lock)."""

    problem: Problem
    looks: Looks
    jobs: int = 2
    fits: dict[tuple[str, ...], Fit] = field(default_factory=dict)
    promised: dict[tuple[str, ...], float] = field(default_factory=dict)

    @classmethod
    def around(cls, problem: Problem, base: Fit, names: Sequence[str], jobs: int) -> Search:
        """A search from the refitted baseline, which may name these effects."""
        return cls(problem, looks_of(problem, base, names), jobs, {(): base})

    def beside(self, anchor: Fit, most: int) -> list[Fit]:
        """`anchor` with each of the most promising effects added; what is known is not fitted again."""
        prospects = screen(self.problem, anchor, self.looks)
        for prospect in prospects:
            self.promised[key(*anchor.effects, prospect.name)] = prospect.gain
        worth = [p for p in prospects if p.gain > WORTH_A_FIT][:most]
        found = self._fit_all(anchor, worth[:ALWAYS])
        best = max((self.better(one, anchor).gain for one in found), default=0.0)
        return found + self._fit_all(anchor, [p for p in worth[ALWAYS:] if p.gain > WORTH_OF_BEST * best])

    def _fit_all(self, anchor: Fit, prospects: Sequence[Prospect]) -> list[Fit]:
        missing = [p for p in prospects if key(*anchor.effects, p.name) not in self.fits]
        with ThreadPoolExecutor(self.jobs) as pool:
            for one in pool.map(lambda p: self._fit(anchor, p), missing):
                self.fits[key(*one.effects)] = one
        return [self.fits[key(*anchor.effects, p.name)] for p in prospects]

    def _fit(self, anchor: Fit, prospect: Prospect) -> Fit:
        effects = (*anchor.effects, prospect.name)
        problem = self.problem.for_thread()
        starts = prospect.starts
        if len(starts) == 1:
            return self._no_worse(anchor, fit(problem, effects, starts[0], iterations=SCOUT_STEPS + 15))
        scouts = [fit(problem, effects, start, iterations=SCOUT_STEPS, tolerance=1e-3) for start in starts]
        best = min(scouts, key=lambda one: one.cost)
        return self._no_worse(anchor, fit(problem, effects, best.theta, iterations=15))

    def _no_worse(self, anchor: Fit, done: Fit) -> Fit:
        """The fit, or the anchor with the effect at nothing where the search for its numbers went astray."""
        if done.cost <= anchor.cost:
            return done
        return Fit(done.effects, anchor.theta, done.columns, anchor.residual)

    def better(self, one: Fit, other: Fit) -> Advantage:
        """How much better `one` is than `other`."""
        return advantage(self.problem, one, other)

    def alone(self, name: str, pair: Fit) -> Fit:
        """The fit of one part of a pair, made now if it never looked promising."""
        if (name,) not in self.fits:
            done = fit(self.problem, (name,), pair.theta, iterations=15)
            self.fits[name,] = self._no_worse(self.fits[()], done)
        return self.fits[name,]

    def ranked(self, count: int) -> list[Fit]:
        """Fits with this many effects, best first, each number paid for."""
        base = self.fits[()]
        of_size = [one for names, one in self.fits.items() if len(names) == count]
        return sorted(of_size, key=lambda one: -self.better(one, base).gain)

    def under(self, problem: Problem, keep: Sequence[Fit]) -> Search:
        """A search under another idea of the noise, with these fits refined."""
        other = Search(problem, self.looks, self.jobs, promised=dict(self.promised))
        with ThreadPoolExecutor(self.jobs) as pool:
            done = pool.map(lambda one: fit(problem.for_thread(), one.effects, one.theta, iterations=6), keep)
            other.fits = {key(*one.effects): one for one in done}
        return other


def key(*names: str) -> tuple[str, ...]:
    """A set of effects, whatever the order in which they were added."""
    return tuple(sorted(names))
