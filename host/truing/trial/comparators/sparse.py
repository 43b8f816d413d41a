"""Sparse regression of acceleration over named terms: sequential thresholded least squares (SINDy's way).

Every term stands for one effect of the catalogue, as far as an effect is a term at all. The threshold is
the one with the smallest Bayesian information criterion among a few (Brunton, Proctor & Kutz 2016).
"""

from __future__ import annotations

import math

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.data.set_data import SetData
from truing.trial.comparators.opinion import Opinion, slopes

_THRESHOLDS = (0.01, 0.02, 0.05, 0.1, 0.2)
_ROUNDS = 10
_STANDING = 0.02
_PLAIN = ("gain", "decay")


def sparse(data: SetData) -> Opinion:
    """Return the effects whose terms survive on either wheel."""
    names: list[str] = []
    for wheel in (0, 1):
        target, terms = library(data, wheel)
        for name in survivors(target, terms):
            if name not in names and name not in _PLAIN:
                names.append(name)
    return Opinion(tuple(names), {})


def library(data: SetData, wheel: int) -> tuple[FloatArray, dict[str, list[FloatArray]]]:
    """Return the acceleration, shape (k,), and the columns of each effect."""
    seen, other = slopes(data, wheel), slopes(data, 1 - wheel)
    u, v, row = seen.effort, seen.speed, seen.row
    top = data.top_mps
    moving = np.where(np.abs(v) > _STANDING * top, np.sign(v), 0.0)
    late = data.elapsed_s[row] / max(data.duration_s, 1e-9)
    after = np.maximum(np.abs(v) - 0.8 * np.abs(v).max(), 0.0) * np.sign(v)
    terms: dict[str, list[FloatArray]] = {
        "gain": [u],
        "decay": [v],
        "coulomb_friction": [moving],
        "stribeck_friction": [moving * np.exp(-np.abs(v) / (0.1 * top))],
        "turning_scrub": [np.sign(np.round((v - other.speed) / (_STANDING * top)))],
        "quadratic_drag": [v * np.abs(v)],
        "supply_sag": [u * (np.abs(u) + np.abs(other.effort))],
        "winding_heating": [u * late],
        "input_delay": [seen.before - u],
        "driver_deadband": [np.sign(u)],
        "current_limit": [(u - v / top) ** 3],
        "speed_limit": [after],
        "direction_asymmetry": [np.minimum(u, 0.0)],
        "coast_decay": [np.where(u == 0.0, v, 0.0)],
        "inertia_coupling": [other.acceleration],
        "payload_change": [u * (late > 0.5), v * (late > 0.5)],
    }
    if data.angle_rad is not None:
        angle = data.angle_rad[row, wheel]
        terms["encoder_eccentricity"] = [np.sin(angle) * v**2, np.cos(angle) * v**2]
        ripple = [f(k * angle) for k in range(2, 9) for f in (np.sin, np.cos)]
        terms["torque_ripple"] = ripple
    if data.heading_rad is not None:
        heading = data.heading_rad[row]
        terms["floor_slope"] = [np.cos(heading), np.sin(heading)]
    return seen.acceleration, terms


def survivors(target: FloatArray, terms: dict[str, list[FloatArray]]) -> list[str]:
    """Return the names of the terms that the best threshold leaves."""
    owner = [name for name, columns in terms.items() for _ in columns]
    table = np.column_stack([column for columns in terms.values() for column in columns])
    scale = np.sqrt(np.mean(table**2, axis=0))
    used = scale > 1e-9
    table = np.where(used, table / np.where(used, scale, 1.0), 0.0)
    size = float(np.sqrt(np.mean(target**2))) or 1.0
    best, kept = math.inf, used
    for threshold in _THRESHOLDS:
        active = used.copy()
        weights = np.zeros(len(owner))
        for _ in range(_ROUNDS):
            weights[:] = 0.0
            weights[active], *_ = np.linalg.lstsq(table[:, active], target, rcond=None)
            small = active & (np.abs(weights) < threshold * size)
            if not small.any():
                break
            active &= ~small
        left = target - table @ weights
        rows = len(target)
        cost = rows * math.log(max(float(left @ left) / rows, 1e-30)) + int(active.sum()) * math.log(rows)
        if cost < best:
            best, kept = cost, active
    return list(dict.fromkeys(name for name, on in zip(owner, kept, strict=True) if on))
