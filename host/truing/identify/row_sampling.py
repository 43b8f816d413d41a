"""Whether speeds were read at the rows' times, or averaged over the rows, as docs/DATA_FORMAT.md has it.

A simulator and many a controller write the speed at a row's time, which is half a row ahead of the mean over
the row. No physics makes a robot answer sooner: the reading under which a plain model fits better is right.
Where counts or positions are recorded there is nothing to find out: those are means.
"""

from __future__ import annotations

import math
from dataclasses import replace

from truing.errors import IdentifyError
from truing.identify.effort_row import first_rows
from truing.identify.output_error import fit_physics
from truing.identify.signals import WheelSignal, wheel_signal
from truing.identify.structures import STRUCTURES
from truing.recording.run import RecordingSet

# Speeds are read at the rows' times if this share of the error of a plain model remains then, or less.
MAX_INSTANT_ERROR = 0.97
# More rows than this decide no better.
MAX_ROWS = 8000
# Gain, time constant and dry friction, which else hides half a row.
PLAIN = STRUCTURES["friction"]

SAID = "speeds are read at the rows' times, not averaged over them: a plain model fits them clearly better so"


def with_row_sampling(recordings: RecordingSet) -> RecordingSet:
    """The recordings with runs that say of their speeds how they were read."""
    if any(run.instant for run in recordings) or not _may_be_instant(recordings):
        return recordings
    at_rows = replace(recordings, runs=tuple(replace(run, instant=True) for run in recordings.runs))
    averaged, read = _plain_error(recordings), _plain_error(at_rows)
    return at_rows if read < MAX_INSTANT_ERROR * averaged else recordings


def _may_be_instant(recordings: RecordingSet) -> bool:
    """Whether a speed is all that is known of the motion."""
    has_counts = recordings.robot is not None and recordings.robot.metres_per_count is not None
    return bool(recordings.runs) and all(
        run.has_pair("vel") and not run.has_pair("pos") and not (has_counts and run.has_pair("ticks"))
        for run in recordings
    )


def _plain_error(recordings: RecordingSet) -> float:
    """Free-run error of the plain model over the wheels that can be fitted, m/s; 0 where none can."""
    squares, runs = [], first_rows(recordings.runs, MAX_ROWS)
    for wheel in recordings.wheels:
        try:
            squares.append(_cost(wheel_signal(runs, wheel, recordings.robot)))
        except IdentifyError:
            continue
    return math.sqrt(sum(squares) / len(squares)) if squares else 0.0


def _cost(signal: WheelSignal) -> float:
    """Mean squared error of a plain fit, every run with the same weight, m^2/s^2."""
    residual = fit_physics(signal, PLAIN).minimum.residual
    return float(residual @ residual)
