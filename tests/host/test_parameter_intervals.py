"""The intervals of fitted parameters where the rows hardly distinguish the parameters."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from truing.identify.uncertainty import half_widths

Array = NDArray[np.float64]
ROWS = 400


def found(jacobian: Array) -> Array:
    """Half widths under a residual that wanders, over four runs."""
    rng = np.random.default_rng(5)
    residual = 0.1 * np.cumsum(rng.standard_normal(ROWS))
    return half_widths(jacobian, residual, np.ones(ROWS), np.repeat(np.arange(4), ROWS // 4))


def slopes(difference: float) -> Array:
    """Two parameters that change the speed alike but for this share, and a third of its own."""
    rng = np.random.default_rng(3)
    alike = np.sin(np.arange(ROWS) / 20.0)
    other = alike + difference * rng.standard_normal(ROWS)
    return np.stack([alike, other, np.cos(np.arange(ROWS) / 7.0)], axis=1)


@pytest.mark.parametrize("difference", [0.0, 1e-16, 1e-10, 1e-8, 1e-7])
@pytest.mark.filterwarnings("error")
def test_indistinguishable_parameters_have_no_interval(difference: float) -> None:
    """Rounding errors stood for them: nan, or an interval as narrow as one likes."""
    widths = found(slopes(difference))
    assert np.isinf(widths[:2]).all()
    assert 0.0 < widths[2] < 1.0


@pytest.mark.parametrize("difference", [1e-4, 1e-3, 0.1])
@pytest.mark.filterwarnings("error")
def test_an_interval_grows_as_the_difference_shrinks(difference: float) -> None:
    widths, wider = found(slopes(difference)), found(slopes(0.1 * difference))
    assert wider[0] == pytest.approx(10.0 * widths[0], rel=0.3)
    assert wider[2] == pytest.approx(widths[2], rel=0.1)


def test_a_parameter_without_any_slope_has_no_interval() -> None:
    widths = found(np.stack([np.sin(np.arange(ROWS) / 20.0), np.zeros(ROWS)], axis=1))
    assert np.isfinite(widths[0])
    assert np.isinf(widths[1])
