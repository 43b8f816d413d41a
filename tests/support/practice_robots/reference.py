"""Effective parameters: the catalogue's plain equation as a first-order wheel, fitted to noise-free output.

The equations here are the plainest reading of the catalogue (docs/DATA_FORMAT.md, section 5), for the effects
whose practice robot is finer: bristles for dry friction, an inductance for a lag, a limited current beside
viscous friction, two wheels of different time constants coasting.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeAlias

import numba
import numpy as np
import scipy
from numpy.typing import NDArray

from support.practice_robots.physics import Physics
from support.practice_robots.plans import draw_plan
from support.practice_robots.recorder import Layout
from support.practice_robots.strength import Experiment

Array: TypeAlias = NDArray[np.float64]

# Where each effect's numbers stand behind the two gains and the two time constants.
GAIN, TAU, RUNNING, BREAKAWAY, STRIBECK_MPS, SCRUB, LAG, LIMIT, COAST = 0, 2, 4, 6, 8, 9, 10, 11, 12
SIZE = 13
FREE: dict[str, dict[str, int]] = {
    "coulomb_friction": {"left": RUNNING, "right": RUNNING + 1},
    "stribeck_friction": {
        "left": RUNNING,
        "right": RUNNING + 1,
        "breakaway_left": BREAKAWAY,
        "breakaway_right": BREAKAWAY + 1,
    },
    "turning_scrub": {"scrub": SCRUB},
    "driver_lag": {"time_constant": LAG},
    "current_limit": {"limit": LIMIT},
    "coast_decay": {"time_constant": COAST},
}
PLAN_SEED = 20


@numba.njit(cache=True, nogil=True, error_model="numpy")
def catalogue_speeds(
    q: NDArray[np.float64],
    effort: NDArray[np.float64],
    start: NDArray[np.bool_],
    row: NDArray[np.bool_],
    dt: float,
) -> NDArray[np.float64]:
    """Mean speeds (rows, 2) of `tau dv/dt = gain (u - friction) - v` and its kin at 1 ms."""
    out = np.empty((int(row.sum()), 2))
    v = np.zeros(2)
    travel = np.zeros(2)
    lagged = np.zeros(2)
    at = 0
    h = 1e-3
    for ms in range(effort.shape[0]):
        if start[ms]:
            v[:] = 0.0
            travel[:] = 0.0
            lagged[:] = 0.0
        shift = np.zeros(2)
        for w in range(2):
            gain, tau = q[GAIN + w], q[TAU + w]
            u = effort[ms, w]
            if q[LAG] > 0.0:
                lagged[w] += (u - lagged[w]) * (1.0 - np.exp(-h / q[LAG]))
                u = lagged[w]
            if q[COAST] > 0.0 and effort[ms, w] == 0.0:
                tau = q[COAST]
            share = 1.0 - np.exp(-h / tau)
            torque = u - v[w] / gain
            torque = min(max(torque, -q[LIMIT]), q[LIMIT])
            free = v[w] + share * gain * torque
            before = v[w]
            running, breakaway = q[RUNNING + w], q[BREAKAWAY + w]
            level = running
            if breakaway > running:
                slow = before / q[STRIBECK_MPS]
                level += (breakaway - running) * np.exp(-slow * slow)
            max_change = share * gain * level
            v[w] = np.sign(free) * max(abs(free) - max_change, 0.0)
            travel[w] += 0.5 * h * (before + v[w])
            shift[w] = share * gain * q[SCRUB]
        if q[SCRUB] > 0.0:
            apart = v[0] - v[1]
            take = min(1.0, (shift[0] + shift[1]) / max(abs(apart), 1e-12)) * apart
            total = shift[0] + shift[1]
            v[0] -= take * shift[0] / total
            v[1] += take * shift[1] / total
        if row[ms]:
            for w in range(2):
                out[at, w] = travel[w] / dt
                travel[w] = 0.0
            at += 1
    return out


def effective(
    experiment: Experiment, name: str, robot: Physics, nominal: dict[str, float]
) -> tuple[dict[str, float], float]:
    """The catalogue's parameters of `name` that serve long noise-free output of `robot` best.

    With the RMS (m/s) that even they leave on the plan of `experiment`: what the robot has beyond the
    catalogue's equation.
    """
    free = FREE[name]
    longer = _long_experiment(experiment)
    layout = longer.layout
    clean = longer.clean(robot).speed
    q = np.zeros(SIZE)
    q[LIMIT] = 1e9
    gain, tau = _first_order(experiment)
    q[GAIN : GAIN + 2], q[TAU : TAU + 2] = gain, tau
    q[STRIBECK_MPS] = max(experiment.healthy.radius * 0.8, 0.02)
    places = [GAIN, GAIN + 1, TAU, TAU + 1]
    for parameter, place in free.items():
        q[place] = nominal[parameter]
        if nominal[parameter] > 0:
            places.append(place)
    if name == "stribeck_friction":
        places.append(STRIBECK_MPS)
    scale = q[places].copy()

    def left(x: Array) -> Array:
        trial = q.copy()
        trial[places] = scale * np.exp(x)
        return np.asarray(
            (catalogue_speeds(trial, layout.effort, layout.start, layout.row, layout.dt_s) - clean).ravel(),
            dtype=np.float64,
        )

    fitted = scipy.optimize.least_squares(
        left, np.zeros(len(places)), diff_step=[2e-3] * len(places), bounds=(-2.5, 2.5), max_nfev=12
    )
    q[places] = scale * np.exp(fitted.x)
    values = {parameter: float(q[place]) for parameter, place in free.items()}
    own = experiment.layout
    predicted = catalogue_speeds(q, own.effort, own.start, own.row, own.dt_s)
    return values, float(np.sqrt(np.mean((predicted - experiment.clean(robot).speed) ** 2)))


def _first_order(experiment: Experiment) -> tuple[Array, Array]:
    p = experiment.healthy
    share = p.viscous * p.resistance / p.torque_constant**2
    return p.radius * p.voltage / (p.torque_constant * (1 + share)), experiment.time_constant


def _long_experiment(experiment: Experiment) -> Experiment:
    """The same robot on a rich plan of its own, on which effective parameters are defined."""
    layout = Layout.of(draw_plan("rich", np.random.default_rng(PLAN_SEED))[:12], 1 / experiment.layout.dt_s)
    return replace(experiment, layout=layout, torque=np.zeros_like(layout.effort))
