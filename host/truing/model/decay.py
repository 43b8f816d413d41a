"""The integral of an exponential decay, which every closed-form step of a wheel is made of."""

from __future__ import annotations

import math

from truing.model.compiled import compiled


@compiled
def decay_integral(rate: float, h: float) -> float:
    """(1 - exp(-rate h)) / rate, s, well-behaved for a rate near zero or below it."""
    z = rate * h
    if abs(z) < 1e-9:
        return h * (1.0 - 0.5 * z)
    return -math.expm1(-z) / rate
