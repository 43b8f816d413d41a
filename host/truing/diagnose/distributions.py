"""Tails and quantiles of the distributions that tests are made with, bit for bit as scipy.stats gives them.

scipy.stats itself takes a second to import, and a tenth of a millisecond for each number.
"""

from __future__ import annotations

import numpy as np
import scipy

from truing.arrays import FloatArray

NORMAL_975 = 1.959963984540054
"""A standard normal number stays below this with probability 0.975."""
CHI2_95 = 3.841458820694124
"""The square of a standard normal number stays below this with probability 0.95."""


def normal_tail(value: float) -> float:
    """Probability that a standard normal number exceeds `value`."""
    return float(scipy.special.ndtr(-value))


def chi2_tail(value: float, count: int) -> float:
    """Probability that the sum of `count` squared standard normal numbers exceeds `value`."""
    return float(scipy.special.chdtrc(count, value))


def chi2_quantile(probability: float, count: float) -> float:
    """Value that the sum of `count` squared standard normal numbers stays below with `probability`."""
    return float(2 * scipy.special.gammaincinv(count / 2, probability))


def chi2_quantiles(probability: float, counts: FloatArray) -> FloatArray:
    """The same for each of several counts, which need not be whole."""
    return np.asarray(2 * scipy.special.gammaincinv(counts / 2, probability))


def student_quantile(probability: float, count: int) -> float:
    """Value that Student's t with `count` degrees of freedom stays below with `probability`."""
    return float(scipy.special.stdtrit(count, probability))
