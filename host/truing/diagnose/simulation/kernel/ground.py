"""From measured wheel travel to motion over the ground, and to displacement over windows of time."""

from __future__ import annotations

import math

from truing.arrays import FloatArray, IntArray
from truing.diagnose.simulation.state import Inputs
from truing.model.compiled import cached

from . import stage


@cached
def ground_motion(
    p: FloatArray, active: int, inputs: Inputs, travel: FloatArray, lost: FloatArray, out: FloatArray
) -> None:
    """Body increments of every row from wheel travel.

    Parameters
    ----------
    travel : shape (n, 2), m, travel in the row's interval.
    lost : shape (n, 2), m, what slid or hid in the gap, from the simulation.
    out : shape (n, 3): forward m, turn rad, lateral 0; none at a segment's first row (written).
    """
    for segment in range(inputs.start.shape[0] - 1):
        first = inputs.start[segment]
        for i in range(3):
            out[first, i] = 0.0
        for row in range(first + 1, inputs.start[segment + 1]):
            forward, turn = 0.0, 0.0
            for w in range(2):
                wheel = stage.ground(
                    p, active, w, travel[row, w], inputs.dt[row], inputs.angles[row, w],
                    inputs.angles[row - 1, w], inputs.origins[segment, w], inputs.radius, inputs.top[w],
                )  # fmt: skip
                wheel -= lost[row, w]
                forward += 0.5 * wheel
                turn += (2.0 * w - 1.0) * wheel / inputs.wheelbase
            out[row, 0] = stage.distance(p, active, forward)
            out[row, 1] = stage.turning(p, active, turn, forward)
            out[row, 2] = 0.0


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
