"""A baseline for recordings that have none: the first-order model that fits all of their runs best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from truing.identify.grey_box import fit_wheel
from truing.recording.baseline import Baseline, RobotGeometry, WheelModel
from truing.recording.run import WHEELS, RecordingSet, Run, Wheel

# Where runs give no gain: the time constant to start from, s; least speed and effort of a quotient.
START_S = 0.5
MIN_SPEED, MIN_EFFORT = 1e-3, 0.02

SAID = "no baseline: compared with the first-order model that fits these runs best"


def with_first_baseline(recordings: RecordingSet) -> RecordingSet:
    """The recordings with the baseline that their own runs give, if they have none.

    Its numbers need not be well determined, unlike those that `truing identify` writes: a diagnosis refits
    them before it names anything.

    Raises
    ------
    TruingError : nothing says how far one count is.
    """
    if recordings.baseline is not None:
        return recordings
    # Both sides of an axis hold the same numbers.
    wheels: tuple[Wheel, ...] = WHEELS if recordings.axis is None else ("left",)
    robot = recordings.robot or RobotGeometry(name=recordings.name)
    fitted = replace(linear_baseline(recordings.runs, robot, wheels), is_fitted=True)
    return replace(recordings, baseline=fitted)


def linear_baseline(runs: Sequence[Run], robot: RobotGeometry, wheels: Sequence[Wheel] = WHEELS) -> Baseline:
    """Gain and time constant of each wheel, identified under a model that has nothing else.

    Parameters
    ----------
    wheels : those that are there; one that is not gets the numbers of the first that is.
    """
    geometry = Baseline(Path("baseline.toml"), WheelModel(1.0, 1.0), WheelModel(1.0, 1.0), robot)
    found = {wheel: _linear(runs, wheel, geometry) for wheel in wheels}
    left, right = (found.get(wheel, found[wheels[0]]) for wheel in WHEELS)
    return replace(geometry, left=left, right=right)


def _linear(runs: Sequence[Run], wheel: Wheel, geometry: Baseline) -> WheelModel:
    found = fit_wheel(runs, wheel, "linear", geometry, hold_out=False, intervals=False).physics
    if found.gain_mps > 0.0:
        return WheelModel(found.gain_mps, found.time_constant_s)
    # No wheel turns against its effort: a line through these runs is none of its model. What they reach with
    # the effort that they take is where a fit can start.
    speed, effort = (
        float(np.percentile(np.abs(np.concatenate(values)), 98.0))
        for values in (
            [run.speed(wheel, geometry).values for run in runs],
            [run.effort(wheel) for run in runs],
        )
    )
    return WheelModel(max(speed, MIN_SPEED) / max(effort, MIN_EFFORT), START_S)
