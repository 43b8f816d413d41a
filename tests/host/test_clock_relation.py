"""Offset and drift of a board's clock are within what is stated of them, whatever delays the line has."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from truing.clock.relation import ClockRelation, RoundTrip, relate
from truing.errors import ClockError

Delay = Callable[[np.random.Generator], float]
OFFSET_S = -1234.567
SEEDS = 200


def constant(_: np.random.Generator) -> float:
    return 0.0


# Delay to the board, delay from it, seconds, beside 0.1 ms on the wire.
LINES: dict[str, tuple[Delay, Delay]] = {
    "a bare serial line": (constant, lambda rng: rng.uniform(0, 5e-6)),
    "one that is busy both ways": (lambda rng: rng.exponential(3e-4), lambda rng: rng.exponential(3e-4)),
    "an adapter that collects for 16 ms": (constant, lambda rng: rng.uniform(0, 16e-3)),
    "an adapter that is asked every millisecond": (
        lambda rng: rng.uniform(0, 1e-3),
        lambda rng: rng.uniform(0, 1e-3),
    ),
    "a host that is now and then away": (
        lambda rng: 20e-3 * (rng.random() < 0.1) * rng.random(),
        lambda rng: 20e-3 * (rng.random() < 0.1) * rng.random() + rng.exponential(2e-5),
    ),
}


def measured(line: str, ppm: float, seed: int, seconds: float = 2.5, step_s: float = 1e-6) -> list[RoundTrip]:
    """Round trips over such a line; the device's clock is rounded down to `step_s`."""
    rng = np.random.default_rng(seed)
    there, back = LINES[line]
    trips, now = [], 1000.0
    while now < 1000.0 + seconds:
        asked = now + 1e-4 + there(rng)
        device = asked + OFFSET_S + ppm * 1e-6 * (asked - 1000.0)
        answered = asked + 1e-4 + back(rng)
        trips.append(RoundTrip(now, answered, np.floor(device / step_s) * step_s))
        now = answered + rng.uniform(0, 0.02)
    return trips


def true_offset(relation: ClockRelation, ppm: float) -> float:
    return OFFSET_S + ppm * 1e-6 * (relation.host_s - 1000.0)


@pytest.mark.parametrize("line", LINES)
def test_the_drift_lies_in_its_interval_in_19_of_20_measurements(line: str) -> None:
    inside, widths = 0, []
    for seed in range(SEEDS):
        ppm = float(np.random.default_rng(seed).uniform(-100, 100))
        low, high = relate(measured(line, ppm, seed)).drift_ci95_ppm
        inside += low <= ppm <= high
        widths.append(high - low)
    print(f"{line}: {inside} of {SEEDS} inside, +-{np.median(widths) / 2:.3g} ppm in 2.5 s")
    # 190 are due; a binomial of 200 at 0.95 leaves 180 to 198 once in a thousand.
    assert 180 <= inside <= 198


@pytest.mark.parametrize("line", LINES)
def test_the_offset_always_lies_in_bounds_as_wide_as_a_few_quick_trips(line: str) -> None:
    for seed in range(20):
        trips = measured(line, 37.0, seed)
        relation = relate(trips)
        low, high = relation.offset_bounds_s
        assert low <= true_offset(relation, 37.0) <= high
        assert low <= relation.offset_s <= high
        assert high - low < 3 * relation.shortest_s
        low, high = relation.drift_bounds_ppm
        assert low <= 37.0 <= high


def test_a_clock_that_ticks_in_milliseconds_widens_the_interval_and_keeps_its_coverage() -> None:
    inside, widths = 0, []
    for seed in range(SEEDS):
        relation = relate(measured("a bare serial line", -80.0, seed, step_s=1e-3), resolution_s=1e-3)
        low, high = relation.drift_ci95_ppm
        inside += low <= -80.0 <= high
        widths.append(high - low)
        low, high = relation.offset_bounds_s
        assert low <= true_offset(relation, -80.0) <= high
    print(f"{inside} of {SEEDS} inside, +-{np.median(widths) / 2:.3g} ppm in 2.5 s")
    assert inside >= 180


def test_a_longer_measurement_knows_the_drift_better() -> None:
    widths = []
    for seconds in (2.5, 10.0):
        low, high = relate(measured("one that is busy both ways", 5.0, 3, seconds)).drift_ci95_ppm
        widths.append(high - low)
    assert widths[1] < widths[0] / 4


def test_each_clocks_time_is_had_from_the_others() -> None:
    relation = relate(measured("a bare serial line", 37.0, 1))
    later = relation.host_s + 3600.0
    assert relation.host_at(relation.device_at(later)) == pytest.approx(later, abs=1e-9)
    truth = later + OFFSET_S + 37e-6 * (later - 1000.0)
    assert abs(relation.device_at(later) - truth) < relation.uncertainty_s(later)
    assert relation.uncertainty_s(later) > relation.uncertainty_s(relation.host_s)


def test_a_clock_that_jumps_is_told_and_not_averaged() -> None:
    trips = measured("a bare serial line", 37.0, 1)
    half = len(trips) // 2
    moved = [RoundTrip(t.sent_s, t.received_s, t.device_s + 0.01) for t in trips[half:]]
    with pytest.raises(ClockError, match="one of them jumped"):
        relate(trips[:half] + moved)


def test_readings_that_agree_to_the_microsecond_are_still_rounded() -> None:
    trips = [RoundTrip(k * 0.01, k * 0.01 + 4e-4, k * 0.01 + 2e-4) for k in range(100)]
    low, high = relate(trips).drift_ci95_ppm
    assert low < -0.1 < 0.1 < high


def test_too_few_round_trips_are_refused() -> None:
    with pytest.raises(ClockError, match="7 round trips are too few"):
        relate(measured("a bare serial line", 0.0, 1)[:7])
