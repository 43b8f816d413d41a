"""The fits of a diagnosis, each made once: the baseline, effects one at a time, and in pairs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from truing.diagnose.compare import Advantage, advantage
from truing.diagnose.fit import Fit, fit
from truing.diagnose.problem import Problem
from truing.diagnose.screen import Prospect, screen
from truing.model.kernel import FloatArray

Progress = Callable[[float], None]
# A start is scouted this many steps before the best goes on.
SCOUT_STEPS = 5
# Log-likelihood that the screen must promise before an effect is worth a fit, nats.
WORTH_A_FIT = 2.0


@dataclass
class Search:
    """Fits under one idea of the noise; `jobs` threads share them (the simulator releases the lock)."""

    problem: Problem
    jobs: int = 2
    fits: dict[tuple[str, ...], Fit] = field(default_factory=dict)
    promised: dict[tuple[str, ...], float] = field(default_factory=dict)

    def base(self, start: FloatArray) -> Fit:
        """The refitted baseline."""
        self.fits[()] = fit(self.problem, (), start, iterations=25)
        return self.fits[()]

    def beside(self, anchor: Fit, names: Sequence[str], most: int) -> list[Fit]:
        """`anchor` with each of the most promising of `names` added; what is known is not fitted again."""
        fresh = [name for name in names if name not in anchor.effects]
        prospects = screen(self.problem, anchor, fresh)
        for prospect in prospects:
            self.promised[key(*anchor.effects, prospect.name)] = prospect.gain
        worth = [p for p in prospects if p.gain > WORTH_A_FIT][:most]
        missing = [p for p in worth if key(*anchor.effects, p.name) not in self.fits]
        with ThreadPoolExecutor(self.jobs) as pool:
            done = list(pool.map(lambda p: self._fit(anchor, p), missing))
        for one in done:
            self.fits[key(*one.effects)] = one
        return [self.fits[key(*anchor.effects, p.name)] for p in worth]

    def _fit(self, anchor: Fit, prospect: Prospect) -> Fit:
        effects = (*anchor.effects, prospect.name)
        problem = self.problem.for_thread()
        scouts = [
            fit(problem, effects, start, iterations=SCOUT_STEPS, tolerance=1e-3) for start in prospect.starts
        ]
        best = min(scouts, key=lambda one: one.cost)
        return fit(problem, effects, best.theta, iterations=15, tolerance=1e-4)

    def better(self, one: Fit, other: Fit) -> Advantage:
        """How much better `one` is than `other`."""
        return advantage(self.problem, one, other)

    def ranked(self, count: int) -> list[Fit]:
        """Fits with this many effects, best first, each number paid for."""
        base = self.fits[()]
        of_size = [one for names, one in self.fits.items() if len(names) == count]
        return sorted(of_size, key=lambda one: -self.better(one, base).gain)

    def under(self, problem: Problem, keep: Sequence[Fit]) -> Search:
        """A search under another idea of the noise, with these fits refined."""
        other = Search(problem, self.jobs, promised=dict(self.promised))
        with ThreadPoolExecutor(self.jobs) as pool:
            done = pool.map(lambda one: fit(problem.for_thread(), one.effects, one.theta, iterations=6), keep)
            other.fits = {key(*one.effects): one for one in done}
        return other


def key(*names: str) -> tuple[str, ...]:
    """A set of effects, whatever the order in which they were added."""
    return tuple(sorted(names))
