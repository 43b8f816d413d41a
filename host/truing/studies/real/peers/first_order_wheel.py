"""A first-order wheel with dry friction, a late input and a filtered output, solved in closed form.

    tau dv/dt = g_s (u(t - delay) - s f_s) - v,    s = sign v,    lag dw/dt = v - w

It shares no code with the diagnosis, whose answers it is compared with. At rest the wheel stays so while
|u| <= f_s. The effort is constant between rows, so each piece is an exponential, stops included.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.model.compiled import compiled
from truing.studies.real.peers.wheel_runs import WheelRun

# Order of the numbers; gains in m/s per unit effort, times in s, frictions in effort.
NUMBERS = ("gain_forward", "gain_reverse", "tau", "friction_forward", "friction_reverse", "delay", "lag")
# A filter faster than this is none, s.
NO_LAG_S = 1e-4


@dataclass(frozen=True, slots=True)
class FirstOrderWheel:
    """The numbers of `NUMBERS`, shape (7,), and which structure they were fitted in."""

    numbers: FloatArray
    structure: str = ""

    def simulate(self, run: WheelRun) -> FloatArray:
        """Free run: speeds, m/s, shape (n,)."""
        out = np.empty(len(run))
        rollout(run.t_s, run.effort, run.initial_mps, self.numbers, out)
        return out


@compiled
def _advance(p: FloatArray, state: FloatArray, effort: float, duration: float) -> None:
    """Advance speed and filtered speed (state 0, 1) under a constant effort."""
    tau, lag = p[2], p[6]
    if abs(lag - tau) < 1e-6 * tau:
        lag *= 1.0 + 1e-5  # the two exponentials of the cascade must differ
    left = duration
    while left > 0.0:
        v = state[0]
        forward = v > 0.0 or (v == 0.0 and effort > 0.0)
        sign = 1.0 if forward else -1.0
        gain = p[0] if forward else p[1]
        friction = p[3] if forward else p[4]
        goal = gain * (effort - sign * friction)
        if v == 0.0 and sign * goal <= 0.0:
            state[1] = state[1] * math.exp(-left / lag) if lag > NO_LAG_S else 0.0
            return
        h = left
        stops = False
        if sign * goal < 0.0:
            until = tau * math.log((v - goal) / -goal)
            if until <= left:
                h, stops = until, True
        part = (v - goal) * tau / (tau - lag)
        decay = math.exp(-h / tau)
        state[0] = 0.0 if stops else goal + (v - goal) * decay
        if lag > NO_LAG_S:
            state[1] = goal + part * decay + (state[1] - goal - part) * math.exp(-h / lag)
        else:
            state[1] = state[0]
        left -= h


@compiled
def rollout(t_s: FloatArray, effort: FloatArray, initial_mps: float, p: FloatArray, out: FloatArray) -> None:
    """Fill `out` (n,) with the filtered speed at the rows; `p` as in `NUMBERS`."""
    state = np.array([initial_mps, initial_mps])
    out[0] = initial_mps
    piece = 0
    for row in range(1, len(t_s)):
        now = t_s[row - 1]
        while now < t_s[row]:
            change = t_s[piece] + p[5]
            if change <= now and piece < len(t_s) - 1:
                piece += 1
                continue
            end = min(t_s[row], change) if change > now else t_s[row]
            _advance(p, state, effort[piece], end - now)
            now = end
        out[row] = state[1]
