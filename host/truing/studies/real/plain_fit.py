"""Plain least squares on the free-run error: a second opinion on a verdict, on runs that no fit saw.

The diagnosis weighs residuals by the noise that it reads from them. Whether an effect lowers the error of
the simulation as it stands is a simpler question, and this answers it: every run weighs the same, no
sample is whitened or clipped, and each run is simulated by the numbers that the others gave.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect
from truing.diagnose.problem import effect_columns, is_identifiable
from truing.diagnose.simulation.simulator import SetSimulator
from truing.levenberg import minimise
from truing.studies.real.signals import Signals

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
    error : shape (k, c), measured minus simulated, unseen; zero where nothing is judged.
    fitted : shape (k, c), the same of the fit to everything.
    refits : shape (parts, p), the fits that each left a part out.
    """

    effects: tuple[str, ...]
    theta: FloatArray
    error: FloatArray
    fitted: FloatArray
    refits: FloatArray


@dataclass(frozen=True, slots=True)
class Drop:
    """What an effect does to an error on unseen runs.

    Attributes
    ----------
    before, after : RMS.
    after_ci95 : of the error after.
    ci95 : of before minus after; the effect lowers the error where both ends lie above zero.
    """

    before: float
    after: float
    after_ci95: tuple[float, float]
    ci95: tuple[float, float]

    @property
    def lowers(self) -> bool:
        """Whether the error falls by more than chance makes it."""
        return self.ci95[0] > 0.0


class PlainJudge:
    """Fits structures to a set and judges them on what they have not seen; each structure once."""

    def __init__(self, data: SetData) -> None:
        self.data = data
        self.simulator = SetSimulator(data, commanded=data.commanded)
        self.signals = Signals(data, self.simulator)
        self.parts = _parts(self.signals)
        self._known: dict[tuple[str, ...], Unseen] = {}
        self._fits: dict[tuple[tuple[str, ...], bytes], FloatArray] = {}

    def unseen(self, effects: Sequence[str]) -> Unseen:
        """The structure of the baseline with these effects, each added to those before it."""
        key = tuple(effects)
        if key not in self._known:
            theta = self._fit(key, np.ones(len(self.parts), dtype=np.bool_))
            error = np.zeros_like(self.signals.counted, dtype=np.float64)
            refits = []
            for part in np.unique(self.parts):
                rows = self.parts == part
                refits.append(self._fit(key, ~rows, theta))
                error[rows] = self._errors(refits[-1], key)[rows]
            self._known[key] = Unseen(key, theta, error, self._errors(theta, key), np.array(refits))
        return self._known[key]

    def rms(self, error: FloatArray, columns: Sequence[int]) -> float:
        """RMS of an error (k, c) over these columns, every run with the same weight."""
        squares = [np.mean(self._squares(error, run, columns)) for run in self._runs(columns)]
        return float(np.sqrt(np.mean(squares)))

    def drop(self, before: Unseen, after: Unseen, columns: Sequence[int]) -> Drop:
        """How the unseen error changes, with intervals.

        Blocks of two seconds are drawn with replacement within each run (a moving state makes errors
        follow one another), the same blocks for both errors.
        """
        draw = np.random.default_rng(1)
        totals = np.zeros((2, DRAWS))
        runs = self._runs(columns)
        for run in runs:
            block = _blocks(self.signals.t_s[self._rows(run, columns)])
            size = np.bincount(block)
            sums = np.stack(
                [np.bincount(block, self._squares(one.error, run, columns)) for one in (before, after)]
            )
            chosen = draw.integers(0, len(size), (DRAWS, len(size)))
            totals += sums[:, chosen].sum(axis=2) / size[chosen].sum(axis=1)
        first, second = np.sqrt(totals / len(runs))
        low, high = np.percentile(second, (2.5, 97.5))
        drop_low, drop_high = np.percentile(first - second, (2.5, 97.5))
        return Drop(
            self.rms(before.error, columns),
            self.rms(after.error, columns),
            (float(low), float(high)),
            (float(drop_low), float(drop_high)),
        )

    def _rows(self, run: int, columns: Sequence[int]) -> BoolArray:
        judged = self.signals.counted[:, list(columns)].all(axis=1)
        return np.asarray(judged & (self.signals.run_of_row == run))

    def _runs(self, columns: Sequence[int]) -> list[int]:
        return [run for run in range(self.data.runs) if self._rows(run, columns).any()]

    def _squares(self, error: FloatArray, run: int, columns: Sequence[int]) -> FloatArray:
        """Mean square over the columns in each judged row of a run."""
        return np.asarray(np.mean(error[self._rows(run, columns)][:, list(columns)] ** 2, axis=1))

    def _errors(self, theta: FloatArray, effects: tuple[str, ...]) -> FloatArray:
        return self.signals.errors(theta, self.simulator.enabled(effects))

    def _fit(self, effects: tuple[str, ...], rows: BoolArray, also: FloatArray | None = None) -> FloatArray:
        """The best numbers for some rows: from the structure without its last effect, and from `also`."""
        key = (effects, rows.tobytes())
        if key in self._fits:
            return self._fits[key]
        if effects:
            base = self._fit(effects[:-1], rows)
            starts = [_placed(self.simulator, base, effects[-1], values) for values in grid_of(effects[-1])]
        else:
            starts = [self.simulator.start()]
        if also is not None:
            starts.append(also)
        scouts = [self._search(effects, rows, start, SCOUT_STEPS) for start in starts]
        best = min(scouts, key=lambda end: end[1])
        self._fits[key] = self._search(effects, rows, best[0], STEPS)[0]
        return self._fits[key]

    def _search(
        self, effects: tuple[str, ...], rows: BoolArray, start: FloatArray, steps: int
    ) -> tuple[FloatArray, float]:
        on = self.simulator.enabled(effects)
        layout = self.simulator.layout
        free = free_entries(self.simulator, effects)
        weight = self._weights(rows)
        pulls, centre = _pulls(self.simulator, effects, free)
        pulls = pulls * math.sqrt(float(np.sum(weight**2)) / weight.shape[1])

        def place(x: FloatArray) -> FloatArray:
            theta = start.copy()
            for entries, value in zip(free, x, strict=True):
                theta[list(entries)] = value
            return theta

        def residual(x: FloatArray) -> FloatArray:
            errors = (self.signals.errors(place(x), on) * weight).ravel()
            return np.concatenate((errors, pulls * (x - centre)))

        def jacobian(x: FloatArray, at: FloatArray) -> FloatArray:
            del at
            columns = self.signals.derivatives(place(x), on, free)
            return np.concatenate(((columns * weight[:, :, None]).reshape(-1, len(free)), np.diag(pulls)))

        first = [entries[0] for entries in free]
        end = minimise(
            residual, jacobian, start[first], layout.lower[first], layout.upper[first],
            iterations=steps, tolerance=1e-5,
        )  # fmt: skip
        return place(end.theta), end.cost

    def _weights(self, rows: BoolArray) -> FloatArray:
        """Square roots of weights that let every run count the same, shape (k, c)."""
        weight = np.zeros(self.signals.counted.shape)
        for run in range(self.data.runs):
            chosen = self.signals.counted & (rows & (self.signals.run_of_row == run))[:, None]
            weight[chosen] = 1.0 / np.sqrt(max(int(chosen.sum()), 1))
        return weight


def free_entries(simulator: SetSimulator, effects: Sequence[str]) -> list[tuple[int, ...]]:
    """Places of the numbers that a fit may change, those of tied wheels together.

    The baseline's four (two where its wheels are equal), and the effects' but for what is searched on a
    grid alone.
    """
    gains = ("gain_left", "gain_right"), ("tau_left", "tau_right")
    index = simulator.layout.index
    free: list[tuple[int, ...]] = []
    for pair in gains:
        places = tuple(index(name) for name in pair)
        free += [places] if simulator.tied else [(place,) for place in places]
    for name in (*simulator.baseline_effects, *effects):
        free += [
            (index(f"{name}.{item.name}"),)
            for item in CATALOGUE[name].parameters
            if not item.fixed
            and not (item.scan and item.nuisance)
            and is_identifiable(item, simulator.data, (*simulator.baseline_effects, *effects))
        ]
    return free


def _pulls(
    simulator: SetSimulator, effects: Sequence[str], free: Sequence[tuple[int, ...]]
) -> tuple[FloatArray, FloatArray]:
    """How strongly each number is pulled, m/s in every row for a change by 1, and towards what; shape (p,).

    A part of what an effect is, as its equation is: without it runs left out may leave numbers undetermined.
    """
    every = (*simulator.baseline_effects, *effects)
    columns = [one for name in every for one in effect_columns(simulator, name, every, plain=True)]
    known = {one.entries[0]: one for one in columns}
    pulls = [known[entries[0]].pull_mps if entries[0] in known else 0.0 for entries in free]
    return np.array(pulls), simulator.start()[[entries[0] for entries in free]]


def grid_of(name: str) -> list[dict[str, float]]:
    """Where to start an effect: all values of what is scanned, by weak and strong amplitudes."""
    effect: Effect = CATALOGUE[name]
    scanned = [item for item in effect.parameters if item.scan or item.nuisance]
    sizes = [item for item in effect.parameters if not (item.scan or item.nuisance or item.plain)]
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


def _parts(signals: Signals) -> IntArray:
    """Which part each row is judged in, shape (k,): its run, or a quarter of a single one."""
    run = signals.run_of_row
    if len(np.unique(run)) > 1:
        return run
    return np.asarray(np.minimum(np.arange(len(run)) * PARTS // len(run), PARTS - 1), dtype=np.int64)


def _blocks(t_s: FloatArray) -> IntArray:
    """Block numbers of rows at these times, shape (k,), without holes."""
    _, number = np.unique(((t_s - t_s[0]) / BLOCK_S).astype(np.int64), return_inverse=True)
    return np.asarray(number, dtype=np.int64)
