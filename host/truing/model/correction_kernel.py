"""The compiled free run of a learned correction beside a physical model.

A correction adds a speed `d` to the speed `b` of the physical model. It obeys the wheel's own first-order
equation, driven by an effort `f` that lookups give:

    T dd/dt = g (f - s F) - d,     v = b + d,  s = sign v;  v stays exactly 0 while F can hold it

`f` is the sum of the rows' own effort (what depends on the input, time and place), lookups of the wheel's
speed relative to the other's, of its net effort `u - v / g` and of the other wheel's, and a linear part
`drag v`; `F` is the rows' dry friction and a lookup of |v| for each direction; `inertia` scales `u - v / g`.

Free runs stay bounded, whatever the numbers, because of four limits that `correction.limited` keeps:

- Lookups are clipped to their outermost values: what depends on input, time and place is bounded, and so is
  `d`, which is a bounded effort behind a stable first-order lag.
- The friction of |v| falls by at most `MAX_FALL` of the wheel's own damping 1/g, so that total damping stays
  positive; `drag` takes away at most as much.
- A lookup of the wheels' difference falls by at most half of 1/g less that: the two wheels' matrix stays
  diagonally dominant with negative diagonal, which is stable (Gershgorin). A lookup of net effort is held to
  slopes within +-`MAX_FALL` likewise.
- `inertia` stays above -`MAX_FALL`: an inertia that varies in time but stays positive.
"""

from __future__ import annotations

import math

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.model.compiled import compiled

# The lookups of the state, in the order of their tables.
FORWARD, REVERSE, TURN, NET, OTHER_NET, INERTIA_FORWARD, INERTIA_REVERSE = range(7)
STATE_TABLES = 7
# Share of a wheel's own damping, inertia or coupling that a correction may take away.
MAX_FALL = 0.9
# Substeps are this share of the shorter time constant.
STEP_SHARE = 0.08
# Below this share of full speed a wheel is at rest for the direction of its friction.
REST_SHARE = 1e-6


@compiled
def lookup(table: FloatArray, low: float, high: float, z: float) -> float:
    """Piecewise linear over an even grid from low to high, constant beyond."""
    last = len(table) - 1
    place = (z - low) / (high - low) * last
    if not place > 0.0:
        return float(table[0])
    if place >= last:
        return float(table[last])
    k = int(place)
    return float(table[k] + (place - k) * (table[k + 1] - table[k]))


@compiled
def free_run(
    starts: IntArray,
    dt: FloatArray,
    instant: bool,
    effort: FloatArray,
    base: FloatArray,
    gain: FloatArray,
    tau: FloatArray,
    force: FloatArray,
    against: FloatArray,
    inertia: FloatArray,
    scale: FloatArray,
    drag: FloatArray,
    tables: FloatArray,
    spans: FloatArray,
    used: FloatArray,
    out: FloatArray,
) -> None:
    """Write the corrected speeds of all rows.

    Parameters
    ----------
    starts : (segments + 1,), first rows; each segment starts without correction.
    dt, effort, base : (n,) s; (n, 2); (n, 2) m/s, speeds of the physical model in the rows.
    instant : rows hold the speed at their time, not the mean over the interval that ends there.
    gain, tau, drag : (2,) m/s per unit effort, s, effort per m/s.
    force, against, inertia, scale : (n, 2), of the rows: effort, dry friction, share of the net effort, share
        by which the reported speed differs.
    tables : (7, 2, k), effort or shares; spans : (7, 2), their ends; used : (7,), 0 where there is none.
    out : (n, 2), written.
    """
    d = np.zeros(2)
    v = np.zeros(2)
    net = np.zeros(2)
    mean = np.zeros(2)
    moves = np.zeros(2)
    shortest = min(tau[0], tau[1])
    rest = REST_SHARE * max(gain[0], gain[1])
    for segment in range(len(starts) - 1):
        first, end = starts[segment], starts[segment + 1]
        d[:] = 0.0
        for w in range(2):
            v[w] = base[first, w]
            out[first, w] = base[first, w]
        for i in range(first + 1, end):
            count = max(1, math.ceil(dt[i] / (STEP_SHARE * shortest)))
            h = dt[i] / count
            mean[:] = 0.0
            moves[:] = 0.0
            after = i if instant or i + 1 == end else i + 1
            for n in range(count):
                share = (n + 1.0) / count
                for w in range(2):
                    net[w] = effort[i, w] - v[w] / gain[w]
                for w in range(2):
                    start = 0.5 * (base[i - 1, w] + base[i, w])
                    if instant or i - 1 == first:
                        start = base[i - 1, w]
                    stop = base[i, w] if instant else 0.5 * (base[i, w] + base[after, w])
                    b = start + share * (stop - start)
                    keep = math.exp(-h / tau[w])
                    more = inertia[i, w]
                    if used[INERTIA_FORWARD] > 0.0:
                        side = INERTIA_FORWARD if v[w] >= 0.0 else INERTIA_REVERSE
                        more += lookup(tables[side, w], spans[side, 0], spans[side, 1], abs(v[w]))
                    f = force[i, w] + drag[w] * v[w] + max(more, -MAX_FALL) * net[w]
                    if used[TURN] > 0.0:
                        f += lookup(tables[TURN, w], spans[TURN, 0], spans[TURN, 1], v[w] - v[1 - w])
                    if used[NET] > 0.0:
                        f += lookup(tables[NET, w], spans[NET, 0], spans[NET, 1], net[w])
                    if used[OTHER_NET] > 0.0:
                        f += lookup(
                            tables[OTHER_NET, w], spans[OTHER_NET, 0], spans[OTHER_NET, 1], net[1 - w]
                        )
                    moved = b + d[w] * keep + (1.0 - keep) * gain[w] * f
                    way = v[w] if abs(v[w]) > rest else moved
                    friction = against[i, w]
                    if used[FORWARD] > 0.0:
                        side = FORWARD if way >= 0.0 else REVERSE
                        friction += lookup(tables[side, w], spans[side, 0], spans[side, 1], abs(v[w]))
                    pull = (1.0 - keep) * gain[w] * friction
                    before = d[w]
                    # Dry friction stops a wheel within the step and holds it there, exactly.
                    if friction > 0.0 and abs(moved) <= pull:
                        d[w] = -b
                    else:
                        d[w] = moved - (pull if moved > 0.0 else -pull) - b
                    mean[w] += 0.5 * (before + d[w]) / count
                    net[w] = effort[i, w] - v[w] / gain[w]
                    if v[w] != 0.0 or b + d[w] != 0.0:
                        moves[w] = 1.0
                    v[w] = b + d[w]
            for w in range(2):
                add = d[w] if instant else mean[w]
                out[i, w] = (base[i, w] + add) * (1.0 + scale[i, w]) * moves[w]
