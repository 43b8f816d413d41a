"""What a strength S is made of on any plant: the best first-order model, and displacements over windows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from truing.arrays import FloatArray

# Smallest time constant that is tried.
_MIN_S = 0.02


def fit_first_order(
    unit: Callable[[float], FloatArray], target: FloatArray, *, max_s: float, tolerance: float
) -> tuple[float, float, FloatArray]:
    """Gain, time constant (s) and residual of the model that fits `target` best, shape as given.

    For each time constant the best gain is a projection (Golub and Pereyra 1973).

    Parameters
    ----------
    unit : speeds of the model of gain 1 with this time constant, in the shape of `target`.
    max_s, tolerance : largest time constant; tolerance of its logarithm.
    """
    from scipy.optimize import minimize_scalar

    def parts(log_s: float) -> tuple[float, FloatArray]:
        speed = unit(float(np.exp(log_s)))
        energy = float((speed * speed).sum())
        gain = float((speed * target).sum()) / energy if energy > 0.0 else 0.0
        return gain, target - gain * speed

    found = minimize_scalar(
        lambda log_s: float((parts(log_s)[1] ** 2).sum()),
        bounds=(np.log(_MIN_S), np.log(max_s)),
        method="bounded",
        options={"xatol": tolerance},
    )
    gain, residual = parts(float(found.x))
    return gain, float(np.exp(found.x)), residual


def displacements(pose: FloatArray) -> FloatArray:
    """From each pose (x, y, heading) to the next, in the frame of the first: forward, lateral, heading."""
    step = np.diff(pose, axis=0)
    c, s = np.cos(pose[:-1, 2]), np.sin(pose[:-1, 2])
    return np.column_stack([c * step[:, 0] + s * step[:, 1], c * step[:, 1] - s * step[:, 0], step[:, 2]])
