"""The truth of a simulated robot, written down at even intervals: `struct plant_sample` of record.h."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from hil_sim.plant import STEP_S

SAMPLE = np.dtype(
    [
        ("steps", "<u8"),
        ("asked", "<f8", 2),
        ("measured_rad", "<f8", 2),
        ("counts", "<i8", 2),
        ("x_m", "<f8"),
        ("y_m", "<f8"),
        ("theta_rad", "<f8"),
        ("battery_v", "<f8"),
    ]
)
"""Steps since the plant's creation; effort asked of the bridges; angle the encoders turn by, before it is
counted (rad); counts; pose; terminal voltage with the sense line's noise. Pairs are left, right."""

Samples: TypeAlias = npt.NDArray[np.void]


def steps_of(interval_s: float) -> int:
    """Plant steps in an interval."""
    return round(interval_s / STEP_S)
