"""What any method says about a recording set, with the names that a diagnosis uses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from truing.arrays import FloatArray
from truing.diagnose.data.set_data import SetData


@dataclass(frozen=True)
class Opinion:
    """A method's verdict.

    Attributes
    ----------
    names : effects that it says are missing; none: the numbers at most.
    numbers : simulator entries by name (`gain_left`, `coulomb_friction.left`, ...) where it has a model.
    """

    names: tuple[str, ...]
    numbers: dict[str, float]


@dataclass(frozen=True)
class Slopes:
    """Differenced speed and what it may depend on, in rows that have both neighbours, one wheel.

    Attributes
    ----------
    row : shape (k,), the row's number in the set.
    acceleration : shape (k,), m/s^2, from this row's mean speed to the next's.
    speed : shape (k,), m/s, at the moment between.
    effort : shape (k,), mean over that time.
    before : shape (k,), effort one row earlier.
    """

    row: npt.NDArray[np.intp]
    acceleration: FloatArray
    speed: FloatArray
    effort: FloatArray
    before: FloatArray


def slopes(data: SetData, wheel: int) -> Slopes:
    """Return what regression of acceleration works on; 1 where differences cross no gap."""
    usable = data.judged.copy()
    usable[:-1] &= data.judged[1:]
    usable[-1] = False
    row = np.flatnonzero(usable)
    speed, effort = data.speed_mps[:, wheel], data.effort[:, wheel]
    mean_dt = 0.5 * (data.dt_s[row] + data.dt_s[row + 1])
    return Slopes(
        row=row,
        acceleration=(speed[row + 1] - speed[row]) / mean_dt,
        speed=0.5 * (speed[row] + speed[row + 1]),
        effort=0.5 * (effort[row] + effort[row + 1]),
        before=0.5 * (effort[row - 1] + effort[row]),
    )
