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
# Motion against the effort within this time of a run's start, faster than this share of full speed, under
# more than this effort, is older than the run.
CARRY_S, CARRY_SHARE, CARRY_EFFORT = 0.15, 0.03, 0.02


def wheel_speeds(run: Run, baseline: Baseline) -> Pair:
    """Measured speeds of left and right wheel, each (n,), m/s."""
    left, right = (run.speed(wheel, baseline).values for wheel in WHEELS)
    return left, right


def usable_rows(runs: Sequence[Run], baseline: Baseline, speeds: Sequence[Pair]) -> list[BoolArray]:
    """Per run (n, 2): False where a speed is none that the wheel can have, and for a wheel that is dead.

    Also until the motion that a run inherits has come through the recorder.
    """
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
    """The row of a run at which its wheel is seen to move on from before the run, or None.

    A wheel that turns against its effort in the first moments did not start at rest; a recorder's filter
    shows that motion late, so that the fastest such row tells more of it than the first.

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
