"""The true state of a simulated robot, recorded at even intervals: `struct plant_sample`."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from hil_sim import native
from hil_sim.plant import STEP_S

SAMPLE = np.dtype(native.HEADERS.structs["plant_sample"])
"""Steps since the plant's creation; commanded effort of the bridges; angle of the encoders before
quantisation (rad); counts; pose; terminal voltage with the sense line's noise. Pairs are left, right."""

Samples: TypeAlias = npt.NDArray[np.void]


def steps_of(interval_s: float) -> int:
    """Plant steps in an interval."""
    return round(interval_s / STEP_S)
