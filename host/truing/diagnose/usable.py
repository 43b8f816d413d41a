"""Which rows are measurements of a wheel at all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from truing.baseline import Baseline
from truing.recording import WHEELS, FloatArray, Run

BoolArray = NDArray[np.bool_]
Pair = tuple[FloatArray, FloatArray]

# A wheel speed no wheel of this robot reaches: the baseline's own top speed, this many times.
JUMP_FACTOR = 4.0


def wheel_speeds(run: Run, baseline: Baseline) -> Pair:
    """Measured speeds of left and right wheel, each (n,), m/s."""
    left, right = (run.speed(wheel, baseline).values for wheel in WHEELS)
    return left, right


def usable_rows(runs: Sequence[Run], baseline: Baseline, speeds: Sequence[Pair]) -> list[BoolArray]:
    """Per run (n, 2): False where a speed is none that the wheel can have, and for a wheel that is dead."""
    masks = [
        np.stack([~jumps(run, baseline, pair[column], column) for column in (0, 1)], axis=1)
        for run, pair in zip(runs, speeds, strict=True)
    ]
    for column in (0, 1):
        if not moves(speeds, column):
            for mask in masks:
                mask[:, column] = False
    return masks


def moves(speeds: Sequence[Pair], column: int) -> bool:
    """Whether a wheel moves in any run."""
    return any(bool((pair[column] != 0.0).any()) for pair in speeds)


def jumps(run: Run, baseline: Baseline, values: FloatArray, column: int) -> BoolArray:
    """Rows whose speed no wheel of this robot can have, shape (n,): a reset, a wrap, a lost digit."""
    model = baseline.right if column else baseline.left
    usual = float(np.percentile(np.abs(values), 95.0))
    if usual == 0.0:
        return np.zeros(len(run), dtype=np.bool_)
    largest = float(np.abs(run.effort(WHEELS[column])).max())
    return np.asarray(~(np.abs(values) <= JUMP_FACTOR * max(usual, model.gain_mps * largest)))
