"""How much a robot's numbers vary from set to set beyond their own intervals, learned from all sisters.

A set's interval holds the noise of its own log. Temperature, battery and floor differ from day to day as
well: the series y_i = x_i + session_i + noise_i has the variance tau^2 + sigma_i^2, and sessions that follow
each other are alike (correlation rho). Each robot gives a method-of-moments estimate of tau^2 (DerSimonian
and Laird 1986, with the line's two degrees of freedom taken) and of rho from the residual of a straight line;
the median over the sisters is robust against the few that wear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.fleet.series import Series

MIN_SETS = 5
MAX_CORRELATION = 0.8


@dataclass(frozen=True, slots=True)
class Variation:
    """Between-set variation of a quantity.

    Attributes
    ----------
    tau : standard deviation between sets, in the quantity's unit.
    inflation : of the variance of a mean or slope, for the correlation of sets that follow each other:
        (1 + rho) / (1 - rho).
    """

    tau: float
    inflation: float

    def weights(self, series: Series) -> FloatArray:
        """Inverse variances of a series, shape (n,)."""
        return 1.0 / (series.sigma**2 + self.tau**2)


def variation_of(sisters: Sequence[Series]) -> Variation:
    """The variation that the sisters' series show together."""
    found = [_moments(one) for one in sisters if len(one) >= MIN_SETS]
    if not found:
        return Variation(0.0, 1.0)
    tau2, rho = (float(np.median(values)) for values in zip(*found, strict=True))
    rho = min(max(rho, 0.0), MAX_CORRELATION)
    return Variation(float(np.sqrt(max(tau2, 0.0))), (1.0 + rho) / (1.0 - rho))


def _moments(series: Series) -> tuple[float, float]:
    """The squared tau of one series, which may be negative, and its first autocorrelation."""
    w = 1.0 / series.sigma**2
    n = len(series)
    t = series.t_days - series.t_days.mean()
    x = np.column_stack((np.ones(n), t / max(float(np.abs(t).max()), 1e-9)))
    gram = np.linalg.pinv(x.T @ (w[:, None] * x))
    residual = series.value - x @ (gram @ (x.T @ (w * series.value)))
    q = float(np.sum(w * residual**2))
    hat = float(np.sum(w)) - float(np.trace(gram @ (x.T @ ((w**2)[:, None] * x))))
    tau2 = (q - (n - 2)) / max(hat, 1e-300)
    power = float(np.sum(residual**2))
    rho = float(np.sum(residual[1:] * residual[:-1])) / power if power > 0.0 else 0.0
    # The first autocorrelation of the residual of a line is biased by about -2/n for white noise.
    return tau2, rho + 2.0 / n
