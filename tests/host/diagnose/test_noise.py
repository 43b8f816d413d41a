"""The noise model: estimated from residuals, its correlation time bounded by the wheel's."""

from __future__ import annotations

import numpy as np
import scipy

from truing.diagnose.noise import Noise, estimate_noise, farthest_rows, past_of, whiten

ROWS, INTERVAL_S = 6000, 0.05
STARTS = np.array([0, ROWS])
PAST = past_of(STARTS, INTERVAL_S)
COUNTED = np.ones((ROWS, 2))
FLOOR = np.full(2, 1e-5)
NO_CEILING = np.full(2, np.inf)


def remembered(memory: float, seed: int = 3) -> np.ndarray:
    """Noise of RMS 1 cm/s on both wheels that keeps `memory` of itself from row to row."""
    white = np.random.default_rng(seed).normal(size=(ROWS, 2)) * 0.01 * np.sqrt(1.0 - memory**2)
    return np.asarray(scipy.signal.lfilter([1.0], [1.0, -memory], white, axis=0))


def estimated(residual: np.ndarray, fade_s: float) -> Noise:
    return estimate_noise(residual, COUNTED, PAST, INTERVAL_S, np.full(2, fade_s), FLOOR, NO_CEILING)


def whitened(noise: Noise, residual: np.ndarray) -> np.ndarray:
    return whiten(noise, residual, COUNTED, PAST)


def test_noise_of_a_known_memory_is_found_and_whitened() -> None:
    residual = remembered(0.6)
    noise = estimated(residual, 20.0)
    np.testing.assert_allclose(noise.rms, 0.01, rtol=0.06)
    np.testing.assert_allclose(noise.lags[:, 0], 0.6, atol=0.05)
    white = whitened(noise, residual)
    np.testing.assert_allclose(white.std(axis=0), 1.0, atol=0.03)
    for wheel in range(2):
        assert abs(np.corrcoef(white[1:, wheel], white[:-1, wheel])[0, 1]) < 0.05


def test_a_slow_error_of_the_model_keeps_its_weight_beside_the_noise() -> None:
    slow = 0.1 * np.sin(2.0 * np.pi * np.arange(ROWS) / 400.0)[:, None] * np.ones((1, 2))
    residual = 0.05 * remembered(0.3) + slow
    bounded, unbounded = estimated(residual, 0.6), estimated(residual, 1e6)
    weight = [float(np.sum(whitened(noise, slow) ** 2)) for noise in (bounded, unbounded)]
    assert weight[0] > 3.0 * weight[1]
    assert np.all(bounded.memory_s < 0.7)


def test_noise_never_falls_below_what_the_sensor_resolves() -> None:
    noise = estimate_noise(
        np.zeros((ROWS, 2)),
        COUNTED,
        PAST,
        INTERVAL_S,
        np.full(2, 0.6),
        np.array([0.004, 0.002]),
        NO_CEILING,
    )
    np.testing.assert_allclose(noise.rms, [0.004, 0.002])
    assert np.all(noise.sigma > 0.0)


def test_rows_that_are_not_counted_have_no_influence() -> None:
    residual, counted = remembered(0.3), COUNTED.copy()
    residual[1000:2000] += 5.0
    counted[1000:2000] = 0.0
    noise = estimate_noise(residual, counted, PAST, INTERVAL_S, np.full(2, 20.0), FLOOR, NO_CEILING)
    np.testing.assert_allclose(noise.rms, 0.01, rtol=0.08)


def test_error_beyond_the_ceiling_of_noise_keeps_its_weight_and_counts_its_independent_rows() -> None:
    slow = 0.1 * np.sin(2.0 * np.pi * np.arange(ROWS) / 400.0)[:, None] * np.ones((1, 2))
    residual = 0.05 * remembered(0.3) + slow
    free = estimated(residual, 1e6)
    ceiling = np.full(2, 0.001)
    bounded = estimate_noise(residual, COUNTED, PAST, INTERVAL_S, np.full(2, 1e6), FLOOR, ceiling)
    assert np.abs(free.lags).max() > 0.3
    assert np.abs(bounded.lags).max() < 0.01
    np.testing.assert_allclose(bounded.rms, ceiling)
    assert np.all(bounded.sigma > 3.0 * 0.0707)  # 0.1 / sqrt(2), rows of one sample


def test_the_longest_lag_is_the_same_time_at_every_log_rate() -> None:
    for interval_s in (0.05, 0.02, 0.005):
        lags = farthest_rows(interval_s)
        assert len(lags) <= 8
        assert lags[0] == 1
        np.testing.assert_allclose(lags[-1] * interval_s, 0.3, atol=0.02)


def test_a_slow_disturbance_under_the_noise_of_counts_is_whitened_at_a_high_log_rate() -> None:
    """Sums over half a second vary as those of independent rows: they are not counted as evidence."""
    row_s, steps = 0.005, 100
    slow = scipy.signal.lfilter([1.0], [1.0, -0.98], np.random.default_rng(6).normal(size=(ROWS, 2)), axis=0)
    rounding = np.random.default_rng(7).uniform(-0.5, 0.5, size=(ROWS + 1, 2))
    residual = 0.003 * slow / slow.std() + 0.012 * np.diff(rounding, axis=0) / np.sqrt(1.0 / 6.0)
    past = past_of(STARTS, row_s)
    noise = estimate_noise(residual, COUNTED, past, row_s, np.full(2, 1.0), FLOOR, NO_CEILING)
    white = whiten(noise, residual, COUNTED, past)
    sums = white.reshape(ROWS // steps, steps, 2).sum(axis=1) / np.sqrt(steps)
    assert np.all(sums.std(axis=0) < 1.3)  # 2.7 and more with single rows for spans


def test_the_past_never_reaches_before_its_segment() -> None:
    starts, row_s = np.array([0, ROWS // 2, ROWS]), 0.005
    residual = remembered(0.6)
    noise = estimate_noise(
        residual, COUNTED, past_of(starts, row_s), row_s, np.full(2, 1.0), FLOOR, NO_CEILING
    )
    both = whiten(noise, residual, COUNTED, past_of(starts, row_s))
    alone = whiten(
        noise, residual[ROWS // 2 :], COUNTED[ROWS // 2 :], past_of(np.array([0, ROWS // 2]), row_s)
    )
    np.testing.assert_allclose(both[ROWS // 2 :], alone, atol=1e-9)


def test_the_noise_that_effects_are_compared_with_does_not_depend_on_the_log_rate() -> None:
    """Counts that are differenced in rows of 5 ms: ten times the noise of rows of 50 ms, one robot."""
    count_m, row_s = 1e-4, 0.005
    rounding = np.random.default_rng(5).uniform(-0.5, 0.5, size=(ROWS + 1, 2)) * count_m
    rows = np.diff(rounding, axis=0) / row_s
    noise = estimate_noise(rows, COUNTED, past_of(STARTS, row_s), row_s, np.full(2, 0.6), FLOOR, NO_CEILING)
    means = np.diff(rounding[::10], axis=0) / 0.05
    np.testing.assert_allclose(noise.compared, means.std(axis=0), rtol=0.1)
    np.testing.assert_allclose(noise.rms, 10.0 * noise.compared, rtol=0.1)


def test_rows_longer_than_that_are_compared_as_they_are() -> None:
    noise = estimated(remembered(0.6), 20.0)
    np.testing.assert_array_equal(noise.compared, noise.rms)
