"""Which interval a row's effort acts in: the one that ends at the row, or the one that begins there.

docs/DATA_FORMAT.md has it act in the interval that ends at its row. A program that writes what it is about to
apply means the interval after it, and one that reads its drive back late means one before. Either way the
motion is offset from the effort by a whole row. The offset is estimated by a fit of gain, time constant,
friction and delay to efforts that are moved ahead by a row, so that an offset below zero can be found too.

A delay of one row and efforts of the interval after their row are the same record: an offset of one row is
said to be either. Motion ahead of its effort is no physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from truing.errors import IdentifyError
from truing.identify.identifiable import has_constant_efforts
from truing.identify.output_error import PhysicsFit, fit_physics
from truing.identify.signals import WheelSignal, wheel_signal
from truing.identify.structures import DELAY
from truing.recording.effort_convention import SETTING
from truing.recording.run import Geometry, RecordingSet, Run, Wheel

# Rows that are looked at: an offset shows in a few steps.
MAX_ROWS = 3000
# Offsets of a row, with the small delay that a robot has besides, in rows; motion this many rows ahead of its
# effort is no physics.
ONE_ROW, AHEAD = (0.85, 1.5), -0.5
# The fit with the offset must leave at most this share of the squared error of the one without.
CLEAR_SHARE = 0.95
# Edges inside intervals (a mean between two levels) that show efforts to be means over them: at least so
# many, and this share of the steps; a few are chance.
MIN_MEANS, MEANS_SHARE = 3, 0.3
# Changes of effort (of the largest) that show an offset, in all runs together.
MIN_STEPS, STEP_SHARE = 6, 0.1
ITERATIONS = 40


@dataclass(frozen=True, slots=True)
class EffortRow:
    """The offset of motion from effort.

    Attributes
    ----------
    offset_rows : in rows of the log; 1: the effort acts a row later than recorded; below 0: earlier.
    interval_s : a row, s.
    error_share : squared error with this offset over that with none.
    """

    wheel: Wheel
    offset_rows: float
    interval_s: float
    error_share: float

    @property
    def is_early(self) -> bool:
        """Whether the motion comes before its effort: the efforts stand a row too late."""
        return self.offset_rows < AHEAD and self.error_share < CLEAR_SHARE

    @property
    def is_one_row(self) -> bool:
        """Whether the motion follows its effort by just one row."""
        return ONE_ROW[0] < self.offset_rows < ONE_ROW[1] and self.error_share < CLEAR_SHARE

    def sentence(self) -> str:
        """What a user should know, or nothing."""
        rows = f"{self.offset_rows:.2f} rows ({1000.0 * self.offset_rows * self.interval_s:.3g} ms)"
        if self.is_early:
            return f"it moves {rows[1:]} before its effort: the efforts belong a row further up"
        if self.is_one_row:
            return (
                f"it follows its effort by {rows}: a delay, or efforts that act in the interval after a row"
            )
        return ""

    def advice(self) -> str:
        """What to do about it."""
        if self.is_early:
            return f'Leave effort = "after" out of {SETTING} or the mapping; else move the efforts a row up'
        return f'If the program writes what it is about to apply, say effort = "after" in {SETTING}'


def effort_row(recordings: RecordingSet) -> EffortRow | None:
    """The offset of motion from effort, at the wheel that shows it best; None where nothing shows it.

    Nor is it looked for where it is known: in the board's own log, and where steps of effort leave means
    between two levels, which only an interval that lies behind its row can hold.
    """
    robot = recordings.robot
    if any(run.metadata is not None and run.metadata.firmware for run in recordings):
        return None
    for wheel in _most_moved_first(recordings):
        runs = first_rows(recordings.runs)
        steps = _steps(runs, wheel)
        if steps < MIN_STEPS:
            continue
        try:
            ahead = wheel_signal([_a_row_ahead(run, wheel) for run in runs], wheel, robot)
            as_recorded = wheel_signal(runs, wheel, robot)
            driven = as_recorded.excitation
            if len(driven.pieces.effort) - len(driven.effort) >= max(MIN_MEANS, MEANS_SHARE * steps):
                return None
            if has_constant_efforts(as_recorded):
                continue
            fit = fit_physics(ahead, DELAY, iterations=ITERATIONS)
            return _compare(wheel, as_recorded, ahead, fit)
        except IdentifyError:
            continue
    return None


def _compare(wheel: Wheel, as_recorded: WheelSignal, ahead: WheelSignal, fit: PhysicsFit) -> EffortRow:
    interval = float(ahead.excitation.interval_s[0])
    offset = fit.physics.delay_s / interval - 1.0
    none = replace(fit.physics, delay_s=0.0)
    structure = replace(DELAY, free=tuple(name for name in DELAY.free if name != "delay_s"))
    without = fit_physics(
        as_recorded,
        structure,
        base=none,
        start=none,
        initial_mps=fit.initial_mps,
        iterations=ITERATIONS,
    )
    share = fit.minimum.cost / max(without.minimum.cost, 1e-300)
    return EffortRow(wheel, offset, interval, share)


def _a_row_ahead(run: Run, wheel: Wheel) -> Run:
    name = f"effort_{wheel}"
    effort = run.columns[name]
    return replace(run, columns=run.columns | {name: np.append(effort[1:], effort[-1])})


def first_rows(runs: Sequence[Run], count: int = MAX_ROWS) -> list[Run]:
    """The first runs, as many as make enough rows; the last of them cut."""
    chosen: list[Run] = []
    left = count
    for run in runs:
        if left < 20:
            break
        columns = {name: values[:left] for name, values in run.columns.items()}
        chosen.append(replace(run, columns=columns, mode=None, text_columns={}))
        left -= len(run)
    return chosen


def _steps(runs: Sequence[Run], wheel: Wheel) -> int:
    """Rows at which the effort steps."""
    largest = max(float(np.abs(run.effort(wheel)).max()) for run in runs)
    if largest <= 0.0:
        return 0
    return sum(int(np.sum(np.abs(np.diff(run.effort(wheel))) > STEP_SHARE * largest)) for run in runs)


def _most_moved_first(recordings: RecordingSet) -> list[Wheel]:
    def moved(wheel: Wheel) -> float:
        return max(_travelled(run, wheel, recordings.robot) for run in recordings)

    return sorted(recordings.wheels, key=moved, reverse=True)


def _travelled(run: Run, wheel: Wheel, baseline: Geometry | None) -> float:
    return float(np.abs(run.speed(wheel, baseline).values).mean())
