"""How runs are left out: which runs a discrete model is fitted to, and which it is judged on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.identify.even import EvenSignal, EvenStretch

# Of a single run, this share is fitted, and the rest judges.
FITTED_SHARE = 0.6
MAXIMUM_FOLDS = 6
# Among orders whose held-out error lies within this factor of the best, the simplest is taken.
PARSIMONY = 1.02


@dataclass(frozen=True, slots=True)
class Fold:
    """One division of the data: fit on `fitted`, judge on `judged`."""

    fitted: tuple[EvenStretch, ...]
    judged: tuple[EvenStretch, ...]


def folds(signal: EvenSignal, max_folds: int = MAXIMUM_FOLDS) -> list[Fold]:
    """Every run left out once; with one run, its end judged by a model of its beginning.

    Up to `max_folds` runs are left out one by one, more of them in that many groups (with six groups:
    every sixth run together).
    """
    runs = sorted({stretch.run for stretch in signal.stretches})
    if len(runs) > 1:
        groups = [runs[k::max_folds] for k in range(min(len(runs), max_folds))]
        return [
            Fold(signal.select([run for run in runs if run not in group]), signal.select(group))
            for group in groups
        ]
    fitted, judged = [], []
    for stretch in signal.stretches:
        cut = int(FITTED_SHARE * len(stretch.speed))
        fitted.append(EvenStretch(stretch.run, stretch.effort[:cut], stretch.speed[:cut]))
        judged.append(EvenStretch(stretch.run, stretch.effort[cut:], stretch.speed[cut:]))
    return [Fold(tuple(fitted), tuple(judged))]


def rms_by_run(
    stretches: Sequence[EvenStretch], residuals: Sequence[FloatArray], runs: Sequence[int]
) -> FloatArray:
    """Root mean square of the residuals of each run, shape (len(runs),), in the order of `runs`."""
    squares = dict.fromkeys(runs, 0.0)
    counts = dict.fromkeys(runs, 0)
    for stretch, residual in zip(stretches, residuals, strict=True):
        squares[stretch.run] += float(residual @ residual)
        counts[stretch.run] += len(residual)
    return np.array([np.sqrt(squares[run] / max(counts[run], 1)) for run in runs])


def simplest_good(scores: Sequence[tuple[float, int]]) -> int:
    """Index of the choice with the fewest parameters whose error is within 2 % of the smallest.

    Parameters
    ----------
    scores : (error, number of parameters) of every choice.
    """
    # A model whose free run leaves what can be computed is no choice, unless all of them do.
    best = min((error for error, _ in scores if math.isfinite(error)), default=math.nan)
    if math.isnan(best):
        return 0
    good = [k for k, (error, _) in enumerate(scores) if error <= PARSIMONY * best]
    return min(good, key=lambda k: (scores[k][1], scores[k][0]))
