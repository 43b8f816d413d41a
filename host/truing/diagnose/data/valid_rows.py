"""Which rows are valid measurements of a wheel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from truing.arrays import BoolArray, FloatArray
from truing.recording.baseline import Baseline
from truing.recording.run import WHEELS, Run

Pair = tuple[FloatArray, FloatArray]

# Multiple of the baseline's top speed beyond which a speed is a jump.
JUMP_FACTOR = 4.0
# Motion against the effort within this time of a run's start, above this share of full speed, at more than
# this effort, was inherited from before the run.
CARRY_S, CARRY_SHARE, CARRY_EFFORT = 0.15, 0.03, 0.02


def wheel_speeds(run: Run, baseline: Baseline) -> Pair:
    """Measured speeds of left and right wheel, each (n,), m/s."""
    left, right = (run.speed(wheel, baseline).values for wheel in WHEELS)
    return left, right


def valid_rows(runs: Sequence[Run], baseline: Baseline, speeds: Sequence[Pair]) -> list[BoolArray]:
    """Valid rows per run, (n, 2): no jumps, no dead wheel, no motion inherited from before the run."""
    masks = [
        np.stack([~jumps(run, baseline, pair[column], column) for column in (0, 1)], axis=1)
        for run, pair in zip(runs, speeds, strict=True)
    ]
    for column, wheel in enumerate(WHEELS):
        gain = (baseline.right if column else baseline.left).gain_mps
        for run, pair, mask in zip(runs, speeds, masks, strict=True):
            row = carried_over(run.t_s, run.effort(wheel), pair[column], gain)
            if row is not None:
                mask[: row + 1, column] = False
        if not moves(speeds, column):
            for mask in masks:
                mask[:, column] = False
    return masks


def carried_over(t_s: FloatArray, effort: FloatArray, speed: FloatArray, gain_mps: float) -> int | None:
    """The row that shows best the motion a wheel inherits from before the run, or None.

    A wheel that turns against its effort at first did not start at rest; a recorder's filter shows that
    motion late, so that the fastest such row is the best estimate.

    Parameters
    ----------
    t_s, effort, speed : shape (n,), of one wheel from the run's first row on.
    """
    early = t_s - t_s[0] < CARRY_S
    against = early & (speed * effort < 0.0)
    against &= (np.abs(speed) > CARRY_SHARE * gain_mps) & (np.abs(effort) > CARRY_EFFORT)
    return int(np.argmax(np.abs(speed) * against)) if against.any() else None


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
