"""Measured wheel travel to the body's motion over the ground, and that to displacements over windows.

The assembler compiles this file with `stage` standing for the functions that it builds from the effects.
"""

from __future__ import annotations

import math

from truing.diagnose.data.set_data import FloatArray, IntArray
from truing.diagnose.simulation import stubs as stage
from truing.diagnose.simulation.jit import cached


@cached
def ground_motion(
    p: FloatArray,
    active: int,
    travel: FloatArray,
    lost: FloatArray,
    dt: FloatArray,
    first: FloatArray,
    angles: FloatArray,
    origins: FloatArray,
    radius: float,
    top: FloatArray,
    wheelbase: float,
    out: FloatArray,
) -> None:
    """Body increments of every row from measured wheel travel.

    Parameters
    ----------
    travel : shape (n, 2), m, measured travel in the row's interval.
    lost : shape (n, 2), m, what slid or hid in the gap, from the simulation.
    origins : shape (n, 2), rad, angle at which the row's run began.
    first : shape (n,), 1 at a segment's first row: no motion is known there.
    out : shape (n, 3): forward m, turn rad, lateral 0 (written).
    """
    for row in range(travel.shape[0]):
        out[row, 2] = 0.0
        if first[row] != 0.0:
            out[row, 0] = 0.0
            out[row, 1] = 0.0
            continue
        forward, turn = 0.0, 0.0
        for w in range(2):
            wheel = stage.ground(
                p, active, w, travel[row, w], dt[row], angles[row, w], angles[row - 1, w], origins[row, w],
                radius, top[w],
            )  # fmt: skip
            wheel -= lost[row, w]
            forward += 0.5 * wheel
            turn += (2.0 * w - 1.0) * wheel / wheelbase
        out[row, 1] = stage.turning(p, active, turn, forward)
        out[row, 0] = stage.distance(p, active, forward)


@cached
def windowed_motion(motion: FloatArray, first: IntArray, last: IntArray, out: FloatArray) -> None:
    """Displacement over windows in the body frame at each window's start.

    Parameters
    ----------
    motion : shape (n, 3): forward m, turn rad, lateral m in the interval that ends at the row.
    first, last : shape (m,): a window spans the intervals of rows first + 1 to last.
    out : shape (m, 3): forward m, lateral m, turn rad (written).
    """
    for window in range(first.shape[0]):
        ahead, aside, turn = 0.0, 0.0, 0.0
        for row in range(first[window] + 1, last[window] + 1):
            facing = turn + 0.5 * motion[row, 1]
            cosine, sine = math.cos(facing), math.sin(facing)
            ahead += motion[row, 0] * cosine - motion[row, 2] * sine
            aside += motion[row, 0] * sine + motion[row, 2] * cosine
            turn += motion[row, 1]
        out[window, 0] = ahead
        out[window, 1] = aside
        out[window, 2] = turn
