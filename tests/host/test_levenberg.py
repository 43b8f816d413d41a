"""Bounded Levenberg-Marquardt: its minimum, its box, and derivatives corrected along the steps."""

from __future__ import annotations

import numpy as np
import pytest

from truing.arrays import FloatArray
from truing.levenberg import Minimum, minimise

TIME_S = np.linspace(0.0, 2.0, 40)
TRUE = np.array([1.3, 0.4, 0.2])
START = np.array([1.1, 0.55, 0.3])


def step_response(theta: FloatArray) -> FloatArray:
    """Gain, time constant and offset of a first-order step."""
    gain, tau, offset = theta
    return np.asarray(offset + gain * (1.0 - np.exp(-TIME_S / tau)))


def fitted(*, secant: bool, upper: FloatArray) -> tuple[Minimum, int]:
    """The fit of a noisy step response, and how often its derivatives were computed."""
    measured = step_response(TRUE) + 0.01 * np.random.default_rng(3).standard_normal(len(TIME_S))
    computed = 0

    def jacobian(theta: FloatArray, _: FloatArray) -> FloatArray:
        nonlocal computed
        computed += 1
        moved = [step_response(theta + change) for change in 1e-6 * np.eye(3)]
        return (np.stack(moved, axis=1) - step_response(theta)[:, None]) / 1e-6

    end = minimise(
        lambda theta: step_response(theta) - measured,
        jacobian,
        START,
        np.full(3, 0.05),
        upper,
        tolerance=1e-10,
        secant=secant,
    )
    return end, computed


@pytest.mark.parametrize("secant", [False, True])
@pytest.mark.parametrize("upper", [np.full(3, 5.0), np.array([1.2, 5.0, 5.0])])
def test_the_minimum_has_no_slope_inside_the_box(secant: bool, upper: FloatArray) -> None:
    end, _ = fitted(secant=secant, upper=upper)
    assert end.converged
    assert np.all(end.theta <= upper)
    exact, _ = fitted(secant=False, upper=upper)
    assert end.theta == pytest.approx(exact.theta, rel=1e-4)
    assert upper[0] > TRUE[0] or end.theta[0] == upper[0]


def test_corrected_derivatives_need_fewer_computations() -> None:
    upper = np.full(3, 5.0)
    (_, often), (_, seldom) = (fitted(secant=secant, upper=upper) for secant in (False, True))
    assert seldom < often
