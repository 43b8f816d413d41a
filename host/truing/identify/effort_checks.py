"""Efforts that are none: volts or per cent in place of a fraction of the supply, or a mode taken for them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from truing.arrays import FloatArray
from truing.errors import RecordingError
from truing.recording.run import Geometry, RecordingSet, Run, Wheel

# A fraction of supply may overshoot 1 by rounding; volts and per cent do not stop there.
MAX_EFFORT = 1.05
# Beyond this no robot's supply is meant, V.
LARGEST_SUPPLY_V = 30.0
# A mode has a few values, whole multiples of one (which a mapping may have scaled).
MOST_VALUES, LARGEST_MULTIPLE = 4, 5
# Share of the fastest speed by which a wheel speeds up, and slows down again, under one value; share of the
# driven time that such stretches take; time over which the speed is smoothed first, s.
WANDER_SHARE, WANDERING_TIME, SMOOTHED_S = 0.75, 0.5, 0.25


def refuse_efforts(recordings: RecordingSet) -> None:
    """Stop at efforts that are no fractions of the supply.

    Raises
    ------
    RecordingError : names the file, the column and the row, and says how to scale.
    """
    for run in recordings:
        for wheel in recordings.wheels:
            check_effort(run, wheel, recordings.robot)


def check_effort(run: Run, wheel: Wheel, baseline: Geometry | None) -> None:
    """Raise for volts, per cent or a mode in the place of one wheel's effort."""
    effort = run.effort(wheel)
    if looks_like_a_mode(run.t_s, effort, run.speed(wheel, baseline).values):
        values = ", ".join(f"{value:g}" for value in np.unique(effort))
        raise RecordingError(
            run.path or run.name,
            f"it holds nothing but {values}, and the wheel speeds up, slows down or turns the other way "
            "under one and the same value: is this a mode or an enable flag?",
            column=f"effort_{wheel}",
            next_step="Take the column with the duty cycle or the motor's voltage over the supply's, -1 to 1",
        )
    sizes = np.abs(effort)
    if np.percentile(sizes, 98.0) <= MAX_EFFORT:
        return
    row = int(sizes.argmax())
    largest = float(sizes[row])
    unit = "per cent" if largest > LARGEST_SUPPLY_V else "volts"
    raise RecordingError(
        run.path or run.name,
        f"effort reaches {largest:.4g}, which is {100.0 * largest:.4g} %; it is a fraction of the supply, -1 "
        f"to 1: are these {unit}?",
        column=f"effort_{wheel}",
        row=row + 1,
        next_step="Divide volts by the supply voltage (6 V of a 12 V battery are 0.5), per cent by 100; in a "
        "mapping of `truing import`: scale = 0.0833 or 0.01",
    )


def looks_like_a_mode(t_s: FloatArray, effort: FloatArray, speed_mps: FloatArray) -> bool:
    """Whether an effort column, shape (n,), is a mode: a few even values, and speeds that contradict them.

    Under a constant effort a wheel goes one way to its steady speed. Under a constant mode it speeds up and
    slows down again, or goes forward from rest in one stretch and backward in the next.
    """
    sizes = np.unique(np.abs(effort[effort != 0.0]))
    if not len(sizes) or len(np.unique(effort)) > MOST_VALUES:
        return False
    multiples = sizes / sizes[0]
    if np.any(np.abs(multiples - np.rint(multiples)) > 1e-3) or multiples[-1] > LARGEST_MULTIPLE:
        return False
    smooth = _smoothed(t_s, speed_mps)
    limit = WANDER_SHARE * float(np.percentile(np.abs(smooth), 98.0))
    if limit <= 0.0:
        return False
    starts = [0, *(np.flatnonzero(np.diff(effort) != 0.0) + 1).tolist(), len(effort)]
    wandering = driven = 0
    ways: dict[float, set[bool]] = {}
    for a, b in pairwise(starts):
        if effort[a] == 0.0 or b - a < 2:
            continue
        driven += b - a
        steps = np.diff(smooth[a:b])
        up, down = float(steps[steps > 0.0].sum()), float(-steps[steps < 0.0].sum())
        wandering += b - a if min(up, down) > limit else 0
        if abs(smooth[a]) < 0.2 * limit and abs(smooth[b - 1]) > 0.5 * limit:
            ways.setdefault(float(effort[a]), set()).add(bool(smooth[b - 1] > 0.0))
    return wandering > WANDERING_TIME * driven or any(len(both) == 2 for both in ways.values())


def _smoothed(t_s: FloatArray, values: FloatArray) -> FloatArray:
    """Moving mean over SMOOTHED_S, shape (n,): counts' rounding is no change of speed."""
    from scipy.ndimage import uniform_filter1d

    rows = max(1, round(SMOOTHED_S / max(float(np.median(np.diff(t_s))), 1e-6)))
    return np.asarray(uniform_filter1d(values, rows, mode="nearest"))
