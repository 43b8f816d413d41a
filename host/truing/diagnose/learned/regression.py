"""The linear stage: every candidate's lookup, passed through the wheel's own lag, against what is left.

What a physical model leaves is the correction's speed. It obeys the wheel's first-order equation, so that
each hat function of a lookup, times where it acts, passed through that lag, is a regressor of the speed:
nothing is differentiated, and noise of the speeds stays noise of the target. The state in it is the smoothed
measured speed; the free run that follows (`refine.py`) replaces it by the simulated one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.diagnose.data.set_data import SetData
from truing.diagnose.learned.variables import Candidate, row_variable, state_variable
from truing.model.compiled import compiled
from truing.model.correction import PERIODIC, STATE_VARIABLES

# Groups of runs that regressions are summed over, and left out one by one.
GROUPS = 8
# Weights of the penalty on differences between neighbours of a lookup, as shares of what the rows say of a
# value on average; and the weight of a value's own size beside a difference's.
PENALTIES = (0.003, 0.03, 0.3)
RIDGE = 0.02
# The linear parts that every regression has: share of the effort, effort per speed.
LINEAR = 2


@dataclass(frozen=True, slots=True)
class Left:
    """What a physical model leaves of a set, and all that the regressors are made of.

    Attributes
    ----------
    speeds : shape (n, 2), m/s, of the physical model; state : shape (n, 2), a stand-in for the true state.
    weight : shape (n, 2), rows of the recording that each row stands for; 0 where it does not count.
    group : shape (n,), which group of runs a row belongs to.
    gain, tau : shape (2,), of the wheels' linear part.
    """

    data: SetData
    speeds: FloatArray
    state: FloatArray
    weight: FloatArray
    group: IntArray
    gain: FloatArray
    tau: FloatArray

    @property
    def error(self) -> FloatArray:
        """Measured minus simulated, shape (n, 2), 0 where a row does not count."""
        return np.where(self.weight > 0.0, self.data.speed_mps - self.speeds, 0.0)

    @property
    def groups(self) -> int:
        """How many groups there are."""
        return int(self.group.max()) + 1


def groups_of(data: SetData) -> IntArray:
    """Group of each row, shape (n,): runs in turn; few runs in parts. It lies in one fold of `folds_of`."""
    if data.runs > GROUPS // 2:
        return np.asarray(data.run_of_row % min(GROUPS, data.runs), dtype=np.int64)
    parts = GROUPS // data.runs
    first = np.searchsorted(data.run_of_row, np.arange(data.runs + 1))
    place = np.arange(len(data)) - first[data.run_of_row]
    part = np.minimum(place * parts // np.diff(first)[data.run_of_row], parts - 1)
    return np.asarray(data.run_of_row * parts + part, dtype=np.int64)


def columns_of(one: Candidate) -> int:
    """Free values of a wheel's lookup: of a repeating one the last is the first."""
    return len(one.grid) - (one.variable in PERIODIC)


def hats(one: Candidate, z: FloatArray) -> FloatArray:
    """Hat functions of a candidate's grid at z (n,), shape (n, columns)."""
    grid = np.array(one.grid)
    if one.variable == "speed":
        half = len(grid) // 2
        out = np.zeros((len(z), len(grid)))
        out[z < 0.0, :half] = _hats(grid[:half], z[z < 0.0])
        out[z >= 0.0, half:] = _hats(grid[half:], z[z >= 0.0])
        return out
    out = _hats(grid, z)
    if one.variable in PERIODIC:
        out[:, 0] += out[:, -1]
        out = out[:, :-1]
    return out


def _hats(grid: FloatArray, z: FloatArray) -> FloatArray:
    place = np.interp(z, grid, np.arange(len(grid)))
    low = np.minimum(place.astype(np.int64), len(grid) - 2)
    out = np.zeros((len(z), len(grid)))
    rows = np.arange(len(z))
    out[rows, low] = 1.0 - (place - low)
    out[rows, low + 1] = place - low
    return out


def difference_penalty(one: Candidate) -> FloatArray:
    """Squared differences of neighbours, and a little of the values themselves, shape (columns, columns)."""
    count = columns_of(one)
    steps = np.diff(np.eye(count), axis=0)
    if one.variable == "speed":
        steps = np.delete(steps, count // 2 - 1, axis=0)
    if one.variable in PERIODIC:
        steps = np.vstack((steps, np.eye(count)[0] - np.eye(count)[-1]))
    return np.asarray(steps.T @ steps + RIDGE * np.eye(count))


def linear_regressors(left: Left, w: int, rows: slice) -> FloatArray:
    """The lagged linear parts, shape (n, LINEAR)."""
    parts = np.stack((left.data.effort[rows, w], left.state[rows, w]), axis=1)
    return _lagged(left, w, rows, parts)


def regressors(left: Left, one: Candidate, w: int, rows: slice, z: FloatArray) -> FloatArray:
    """The lagged regressors of one candidate at one wheel, shape (n, columns); z (n, 2) of all rows."""
    basis = hats(one, z[rows, w])
    # What noise of the measured speed would explain of itself, unlagged, the simulated one cannot.
    if one.place == "signal":
        return basis * left.speeds[rows, w, None]
    return _lagged(left, w, rows, basis * multiplier(left, one, w)[rows, None])


def multiplier(left: Left, one: Candidate, w: int) -> FloatArray:
    """Effort for a lookup's value 1, shape (n,)."""
    if one.place == "force":
        return np.ones(len(left.state))
    if one.place == "friction":
        return -np.sign(left.state[:, w])
    if one.place == "gain":
        return left.data.effort[:, w]
    return np.asarray(left.data.effort[:, w] - left.state[:, w] / left.gain[w])


def variable_of(left: Left, one: Candidate) -> FloatArray:
    """The candidate's variable at all rows, shape (n, 2)."""
    if one.place == "signal" and one.variable == "speed":
        return left.speeds
    if one.variable in STATE_VARIABLES:
        return state_variable(one.variable, left.state, left.data.effort, left.gain)
    return row_variable(left.data, one.variable, one.constant)


def _lagged(left: Left, w: int, rows: slice, efforts: FloatArray) -> FloatArray:
    data = left.data
    first = np.zeros(len(data), dtype=np.bool_)
    first[data.starts[:-1]] = True
    out = np.zeros_like(efforts)
    _lag(
        first[rows],
        data.dt_s[rows],
        np.ascontiguousarray(efforts),
        left.gain[w],
        left.tau[w],
        data.instant,
        out,
    )
    return out


@compiled
def _lag(first, dt, f, gain, tau, instant, out) -> None:  # type: ignore[no-untyped-def]
    """Speeds (n, k), as they are recorded, of efforts that are held over the rows, behind the wheel's lag."""
    state = np.zeros(f.shape[1])
    for i in range(len(f)):
        if first[i]:
            state[:] = 0.0
            continue
        keep = math.exp(-dt[i] / tau)
        mean = (1.0 - keep) * tau / dt[i]
        for k in range(f.shape[1]):
            goal = gain * f[i, k]
            before = state[k]
            state[k] = goal + (before - goal) * keep
            out[i, k] = state[k] if instant else goal + (before - goal) * mean


@dataclass(frozen=True)
class Sums:
    """Normal equations of all candidates, per group of runs and wheel.

    Attributes
    ----------
    candidates, at : and the columns of each (the linear parts are the first).
    gram, moment, square : shapes (groups, 2, f, f), (groups, 2, f), (groups, 2): with the error as target.
    """

    candidates: tuple[Candidate, ...]
    at: tuple[IntArray, ...]
    gram: FloatArray
    moment: FloatArray
    square: FloatArray


def block(sums: FloatArray, groups: Sequence[int], w: int, columns: IntArray) -> FloatArray:
    """The square part (groups, k, k) of sums (groups, 2, f, f) that belongs to these columns."""
    places = np.asarray(list(groups), dtype=np.int64)[:, None, None]
    return np.asarray(sums[places, w, columns[None, :, None], columns[None, None, :]])


def sums_of(left: Left, tried: Sequence[Candidate]) -> Sums:
    """Normal equations of these candidates."""
    at, width = [], LINEAR
    for one in tried:
        at.append(np.arange(width, width + columns_of(one)))
        width += columns_of(one)
    gram = np.zeros((left.groups, 2, width, width))
    moment = np.zeros((left.groups, 2, width))
    square = np.zeros((left.groups, 2))
    variables = [variable_of(left, one) for one in tried]
    for group, rows in _pieces(left):
        for w in range(2):
            weight = left.weight[rows, w]
            if not weight.any():
                continue
            whole = np.hstack(
                [linear_regressors(left, w, rows)]
                + [regressors(left, one, w, rows, z) for one, z in zip(tried, variables, strict=True)]
            )
            weighted = whole * weight[:, None]
            error = left.error[rows, w]
            gram[group, w] += weighted.T @ whole
            moment[group, w] += weighted.T @ error
            square[group, w] += float(weight @ error**2)
    return Sums(tuple(tried), tuple(at), gram, moment, square)


def _pieces(left: Left) -> list[tuple[int, slice]]:
    """Consecutive rows of one group, cut at segments and groups; a lag goes on only inside a run's rows."""
    edges = np.unique(np.concatenate((left.data.starts, np.flatnonzero(np.diff(left.group)) + 1)))
    return [(int(left.group[a]), slice(int(a), int(b))) for a, b in pairwise(edges)]
