"""Plain least squares on the free-run error: a second opinion on a verdict, on runs that no fit saw.

The diagnosis weighs residuals by the noise that it reads from them. Whether an effect lowers the error of
the simulation as it stands is a simpler question, and this answers it: every run weighs the same, no
sample is whitened or clipped, and each run is simulated by the numbers that the others gave.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.data import BoolArray, FloatArray, IntArray, SetData
from truing.diagnose.effect import Effect
from truing.diagnose.simulation.simulator import SetSimulator
from truing.identify.levenberg import minimise

# Errors closer together than this are drawn together by the bootstrap: they are no independent samples.
BLOCK_S = 2.0
DRAWS = 2000
# A single run is judged in this many parts.
PARTS = 4
SCOUT_STEPS = 6
STEPS = 30


@dataclass(frozen=True, slots=True)
class Unseen:
    """One structure, each part of the recordings simulated by the fit to the others.

    Attributes
    ----------
    effects : beside the baseline's own.
    theta : shape (p,), the fit to everything.
    error : shape (n, 2), m/s, measured minus simulated, unseen.
    fitted : shape (n, 2), m/s, the same of the fit to everything.
    """

    effects: tuple[str, ...]
    theta: FloatArray
    error: FloatArray
    fitted: FloatArray


class PlainJudge:
    """Fits structures to a set and judges them on what they have not seen; each structure once."""

    def __init__(self, data: SetData) -> None:
        self.data = data
        self.simulator = SetSimulator(data)
        self.parts = _parts(data)
        self._known: dict[tuple[str, ...], Unseen] = {}

    def unseen(self, effects: Sequence[str]) -> Unseen:
        """The structure of the baseline with these effects; the order says which is added to which."""
        key = tuple(effects)
        if key not in self._known:
            everything = np.ones(len(self.data), dtype=np.bool_)
            theta = self._fit(key, everything)
            error = np.zeros((len(self.data), 2))
            for part in np.unique(self.parts):
                rows = self.parts == part
                refit = self._fit(key, ~rows, theta)
                error[rows] = (self.data.speed_mps - self._speeds(refit, key))[rows]
            fitted = self.data.speed_mps - self._speeds(theta, key)
            self._known[key] = Unseen(key, theta, error, fitted)
        return self._known[key]

    def rms(self, error: FloatArray, wheels: Iterable[int] = (0, 1)) -> float:
        """RMS of an error (n, 2) over these wheels, every run with the same weight, m/s."""
        return float(np.sqrt(np.mean(self.squares(error)[:, list(wheels)])))

    def squares(self, error: FloatArray) -> FloatArray:
        """Mean square of an error (n, 2) by run and wheel, shape (runs, 2)."""
        judged = self.data.judged
        return np.stack(
            [np.mean(error[judged & self.data.rows_of(run)] ** 2, axis=0) for run in range(self.data.runs)]
        )

    def interval(
        self, before: FloatArray, after: FloatArray, wheels: Iterable[int] = (0, 1), seed: int = 1
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """95 % intervals of the RMS error `after` and of its drop below `before`, m/s.

        Blocks of two seconds are drawn with replacement within each run (a moving state makes errors
        follow one another), the same blocks for both errors.
        """
        columns = list(wheels)
        draw = np.random.default_rng(seed)
        totals = np.zeros((2, DRAWS))
        for run in range(self.data.runs):
            rows = self.data.judged & self.data.rows_of(run)
            block = _blocks(self.data.t_s[rows])
            size = np.bincount(block)
            sums = np.stack(
                [np.bincount(block, (e[rows][:, columns] ** 2).mean(axis=1)) for e in (before, after)]
            )
            chosen = draw.integers(0, len(size), (DRAWS, len(size)))
            totals += sums[:, chosen].sum(axis=2) / size[chosen].sum(axis=1)
        first, second = np.sqrt(totals / self.data.runs)
        low, high = np.percentile(second, (2.5, 97.5))
        least, most = np.percentile(first - second, (2.5, 97.5))
        return (float(low), float(high)), (float(least), float(most))

    def _speeds(self, theta: FloatArray, effects: tuple[str, ...]) -> FloatArray:
        return self.simulator.speeds(theta, self.simulator.enabled(effects))

    def _fit(self, effects: tuple[str, ...], rows: BoolArray, also: FloatArray | None = None) -> FloatArray:
        """The best numbers for some rows: from the structure without its last effect, and from `also`."""
        if effects:
            base = self._fit(effects[:-1], rows) if len(effects) > 1 else self._baseline(rows)
            starts = [_placed(self.simulator, base, effects[-1], values) for values in grid_of(effects[-1])]
        else:
            starts = [self.simulator.start()]
        if also is not None:
            starts.append(also)
        scouts = [self._search(effects, rows, start, SCOUT_STEPS) for start in starts]
        best = min(scouts, key=lambda end: end[1])
        return self._search(effects, rows, best[0], STEPS)[0]

    def _baseline(self, rows: BoolArray) -> FloatArray:
        return self._search((), rows, self.simulator.start(), STEPS)[0]

    def _search(
        self, effects: tuple[str, ...], rows: BoolArray, start: FloatArray, steps: int
    ) -> tuple[FloatArray, float]:
        on = self.simulator.enabled(effects)
        layout = self.simulator.layout
        free = free_entries(self.simulator, effects)
        weight = self._weights(rows)

        def place(x: FloatArray) -> FloatArray:
            theta = start.copy()
            theta[free] = x
            return theta

        def residual(x: FloatArray) -> FloatArray:
            error = self.simulator.speeds(place(x), on) - self.data.speed_mps
            return np.asarray((error * weight[:, None]).ravel())

        def jacobian(x: FloatArray, at: FloatArray) -> FloatArray:
            del at
            columns = self.simulator.jacobian(place(x), on, free)
            return np.asarray((columns * weight[:, None, None]).reshape(-1, len(free)))

        end = minimise(
            residual, jacobian, start[free], layout.lower[free], layout.upper[free],
            iterations=steps, tolerance=1e-5,
        )  # fmt: skip
        return place(end.theta), end.cost

    def _weights(self, rows: BoolArray) -> FloatArray:
        """Square roots of weights that let every run count the same, shape (n,)."""
        weight = np.zeros(len(self.data))
        for run in range(self.data.runs):
            chosen = rows & self.data.judged & self.data.rows_of(run)
            if chosen.any():
                weight[chosen] = 1.0 / np.sqrt(chosen.sum())
        return weight


def free_entries(simulator: SetSimulator, effects: Sequence[str]) -> list[int]:
    """Places of the numbers that a fit may change: the baseline's, and the effects' but for grid values."""
    free = list(range(4))
    for name in (*simulator.baseline_effects, *effects):
        free += [
            simulator.layout.index(f"{name}.{item.name}")
            for item in CATALOGUE[name].parameters
            if not item.fixed and not (item.scan and item.nuisance)
        ]
    return free


def grid_of(name: str) -> list[dict[str, float]]:
    """Where to start an effect: all values of what is scanned, by weak and strong amplitudes."""
    effect: Effect = CATALOGUE[name]
    scanned = [item for item in effect.parameters if item.scan or item.nuisance]
    sizes = [item for item in effect.parameters if not (item.scan or item.nuisance)]
    depth = max((len(item.starts) for item in sizes), default=1)
    grid = []
    for combination in itertools.product(*(item.starts for item in scanned)):
        for level in range(depth):
            values = {item.name: value for item, value in zip(scanned, combination, strict=True)}
            values |= {item.name: item.starts[min(level, len(item.starts) - 1)] for item in sizes}
            grid.append(values)
    return grid


def _placed(simulator: SetSimulator, theta: FloatArray, effect: str, values: dict[str, float]) -> FloatArray:
    placed = theta.copy()
    for name, value in values.items():
        placed[simulator.layout.index(f"{effect}.{name}")] = value
    return placed


def _parts(data: SetData) -> IntArray:
    """Which part each row is judged in, shape (n,): its run, or a quarter of a single one."""
    if data.runs > 1:
        return data.run_of_row
    return np.asarray(np.minimum(np.arange(len(data)) * PARTS // len(data), PARTS - 1), dtype=np.int64)


def _blocks(t_s: FloatArray) -> IntArray:
    """Block numbers of rows at these times, shape (n,), without holes."""
    _, number = np.unique(((t_s - t_s[0]) / BLOCK_S).astype(np.int64), return_inverse=True)
    return np.asarray(number, dtype=np.int64)
