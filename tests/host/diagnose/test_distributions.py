"""The distributions' tails and quantiles are those of scipy.stats, to the last bit."""

from __future__ import annotations

import numpy as np
import scipy

from truing.diagnose import distributions


def test_every_function_gives_the_bits_of_scipy_stats() -> None:
    stats, rng = scipy.stats, np.random.default_rng(1)
    for _ in range(500):
        count, share = int(rng.integers(1, 2000)), float(rng.uniform())
        value, free = float(rng.exponential(count)), float(rng.uniform(0.5, 300.0))
        assert distributions.normal_tail(share) == stats.norm.sf(share)
        assert distributions.normal_tail(-value) == stats.norm.sf(-value)
        assert distributions.chi2_tail(value, count) == stats.chi2.sf(value, count)
        assert distributions.chi2_quantile(share, free) == stats.chi2.ppf(share, free)
        assert distributions.student_quantile(share, count) == stats.t.ppf(share, count)
    many = rng.uniform(0.5, 30.0, 1000)
    np.testing.assert_array_equal(distributions.chi2_quantiles(0.9999, many), stats.chi2.ppf(0.9999, many))


def test_the_constants_are_the_quantiles_that_they_say() -> None:
    assert scipy.stats.norm.ppf(0.975) == distributions.NORMAL_975
    assert scipy.stats.chi2.ppf(0.95, 1) == distributions.CHI2_95


def test_what_never_happens_has_no_probability() -> None:
    assert distributions.normal_tail(np.inf) == 0.0
    assert np.isnan(distributions.normal_tail(np.nan))
    assert distributions.chi2_tail(0.0, 3) == 1.0
