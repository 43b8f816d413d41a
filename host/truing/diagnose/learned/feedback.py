"""Whether the efforts answer to the measured speeds: a controller's own reactions look like physics.

Where a wheel is slowed down by chance, a speed controller raises its effort; the model, which knows the
effort alone, then runs too fast. What it leaves is a function of the effort although no physics is missing,
in runs that were left out as well, since the same controller drove them (Ljung 1999, System Identification,
section 13.4). Such a function lowers the error there and raises it under any other driving.
"""

from __future__ import annotations

import numpy as np

from truing.diagnose.data.set_data import SetData
from truing.diagnose.learned.variables import Candidate

# Share of the rows that a controller of the speed drives, beyond which the set is one of feedback.
MIN_SHARE = 0.5
# Second difference of an effort beyond which it is neither a step's level nor a ramp.
MIN_BEND = 2e-3
# Variables in which a controller's reaction stands out from what it was asked for.
FED_BACK = (
    "net_effort",
    "other_net_effort",
    "recent_effort",
    "ringing",
    "ringing_rate",
)


def answers_to_speeds(data: SetData) -> bool:
    """Whether a controller of the speeds gave most efforts: by the mode, or by efforts never steady."""
    modes = [mode for run in data.modes if run is not None for mode in run]
    if modes:
        return modes.count("velocity") > MIN_SHARE * len(modes)
    bend = np.abs(np.diff(data.effort, n=2, axis=0)).max(axis=1)
    driven = np.abs(data.effort[1:-1]).max(axis=1) > 0.0
    return bool(driven.any()) and float(np.mean(bend[driven] > MIN_BEND)) > MIN_SHARE


def stands_feedback(one: Candidate) -> bool:
    """Whether a candidate means physics also where efforts answer to speeds."""
    return one.variable not in FED_BACK
