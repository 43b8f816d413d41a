"""What changes with time and since when, who differs, what is pooled, which effects come together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy

from truing.fleet.analysis import discoveries
from truing.fleet.drift import Change, change_of
from truing.fleet.series import Series
from truing.fleet.sisters import own_numbers, pooled
from truing.fleet.together import effects_of_robots, pairs
from truing.fleet.variation import Variation, variation_of

YEAR = np.arange(0.0, 365.0, 7.0)
SIGMA, SESSION = 0.0005, 0.001


def series(shape: np.ndarray, robot: str = "a", seed: int = 1, correlation: float = 0.0) -> Series:
    """Friction around 0.05 that follows `shape`, with noise of each set and from session to session."""
    rng = np.random.default_rng(seed)
    n = len(shape)
    session = rng.normal(0.0, SESSION, n)
    for k in range(1, n):
        session[k] = correlation * session[k - 1] + np.sqrt(1.0 - correlation**2) * session[k]
    value = 0.05 * shape + session + rng.normal(0.0, SIGMA, n)
    return Series(robot, "", "friction", "left", "effort", 20_000.0 + YEAR[:n], value, np.full(n, SIGMA))


def found(shape: np.ndarray, seed: int = 1) -> Change:
    sisters = [series(np.ones(len(shape)), f"s{k}", 100 + k) for k in range(20)]
    change = change_of(series(shape, seed=seed), variation_of(sisters))
    assert change is not None
    return change


def test_a_line_is_found_with_its_rate() -> None:
    change = found(1.0 + 0.01 * YEAR / 7.0)
    assert (change.form, change.since_days) == ("line", 20_000.0)
    assert change.p < 1e-20
    assert change.ci95[0] < 0.05 * 0.01 * 365.25 / 7.0 < change.ci95[1]
    assert change.relative == pytest.approx(0.52, abs=0.04)


def test_wear_that_begins_later_is_dated() -> None:
    days = []
    for seed in range(20):
        change = found(1.0 + 0.01 * np.maximum(YEAR - 175.0, 0.0) / 7.0, seed)
        assert change.form == "hinge"
        days.append(change.since95[0] - 20_000.0 <= 175.0 <= change.since95[1] - 20_000.0)
        assert change.since95[1] - change.since95[0] < 120.0
    # 95 % intervals, 20 times: fewer than 17 would be chance once in 80.
    assert sum(days) >= 17


def test_a_part_that_was_changed_is_a_step_on_its_day() -> None:
    change = found(1.0 - 0.2 * (YEAR >= 210.0))
    assert change.form == "step"
    assert change.since_days == 20_210.0
    assert change.ci95[0] < -0.01 < change.ci95[1]


@pytest.mark.parametrize("correlation", [0.0, 0.5])
def test_what_does_not_change_is_seldom_found(correlation: float) -> None:
    """30 fleets of 40 robots, none of which changes: at a rate of 5 %, a discovery in one of 20."""
    fleets_with_a_discovery = 0
    for fleet in range(30):
        sisters = [series(np.ones(26), f"s{k}", 1000 * fleet + k, correlation) for k in range(40)]
        variation = variation_of(sisters)
        p = [change.p for one in sisters if (change := change_of(one, variation)) is not None]
        fleets_with_a_discovery += any(discoveries(p, 0.05))
    # 1.5 are expected at most; 6 and more would be chance once in 200.
    assert fleets_with_a_discovery <= 5


def test_the_variation_from_set_to_set_is_learned_from_the_sisters() -> None:
    sisters = [series(np.ones(52), f"s{k}", k, 0.5) for k in range(40)]
    variation = variation_of(sisters)
    assert variation.tau == pytest.approx(SESSION, rel=0.2)
    # The sessions' correlation, less what the sets' own noise dilutes: 0.5 * 1 / 1.25.
    assert (variation.inflation - 1.0) / (variation.inflation + 1.0) == pytest.approx(0.4, abs=0.12)
    assert variation_of([]) == Variation(0.0, 1.0)


def test_few_sets_say_nothing_about_time() -> None:
    assert change_of(series(np.ones(5)), Variation(0.0, 1.0)) is None


def fleet_numbers(shares: dict[str, float]) -> list[Series]:
    normal = scipy.stats.norm.ppf((np.arange(30) + 0.5) / 30.0)
    robots = {f"s{k:02d}": 1.0 + 0.05 * float(x) for k, x in enumerate(normal)} | shares
    return [series(np.full(10, share), name, seed) for seed, (name, share) in enumerate(robots.items())]


def test_a_robot_unlike_its_sisters_is_named_and_no_other() -> None:
    sisters = fleet_numbers({"odd": 1.5})
    numbers = own_numbers(sisters, variation_of(sisters))
    differs = discoveries([one.p for one in numbers], 0.01)
    assert [one.robot for one, yes in zip(numbers, differs, strict=True) if yes] == ["odd"]


def test_too_few_sisters_are_not_compared() -> None:
    sisters = fleet_numbers({})[:5]
    assert all(np.isnan(one.p) for one in own_numbers(sisters, variation_of(sisters)))


def test_a_robot_with_thin_data_leans_on_its_sisters() -> None:
    """Pooled numbers are nearer the truth than own ones; a robot with many sets keeps its own."""
    sisters = fleet_numbers({})
    thin = replace(sisters[0], value=np.array([0.08]), sigma=np.array([0.02]), t_days=np.array([20_000.0]))
    numbers = {one.robot: one for one in pooled(own_numbers([thin, *sisters[1:]], variation_of(sisters)))}
    assert numbers["s00"].pooled == pytest.approx(0.05, abs=0.003)
    assert numbers["s00"].pooled_sd < 0.25 * numbers["s00"].own_sd
    others = [one for name, one in numbers.items() if name != "s00"]
    assert all(abs(one.pooled - one.own) < 0.5 * one.own_sd for one in others)


def test_pooling_is_right_on_average() -> None:
    """Robots of one set each, drawn from a known distribution: the pooled error is the formula's."""
    rng = np.random.default_rng(5)
    own, shared = [], []
    for _ in range(20):
        truth = rng.normal(1.0, 0.1, 30)
        made = [
            Series(
                f"r{k}",
                "",
                "gain_mps",
                "left",
                "m/s",
                np.zeros(1),
                x + rng.normal(0.0, 0.1, 1),
                np.full(1, 0.1),
            )
            for k, x in enumerate(truth)
        ]
        numbers = pooled(own_numbers(made, Variation(0.0, 1.0)))
        own += [(one.own - x) ** 2 for one, x in zip(numbers, truth, strict=True)]
        shared += [(one.pooled - x) ** 2 for one, x in zip(numbers, truth, strict=True)]
    assert np.mean(own) == pytest.approx(0.01, rel=0.15)
    assert np.mean(shared) == pytest.approx(0.005, rel=0.2)


def test_effects_that_come_together_are_told_from_those_that_do_not() -> None:
    robots: dict[str, set[str]] = {}
    for k in range(60):
        robots[f"r{k}"] = {"coulomb_friction"} if k % 2 else set()
        robots[f"r{k}"] |= {"gear_backlash"} if k % 2 and k % 10 else set()
        robots[f"r{k}"] |= {"input_delay"} if k % 3 == 0 else set()
    found_pairs = pairs(robots)
    sure = discoveries([one.p for one in found_pairs], 0.01)
    named = [(one.first, one.second) for one, yes in zip(found_pairs, sure, strict=True) if yes]
    assert named == [("coulomb_friction", "gear_backlash")]


def test_a_robot_has_an_effect_that_half_of_its_sets_name() -> None:
    named = {"a": {"wheel_slip": 3, "input_delay": 1}}
    assert effects_of_robots(named, {"a": 6, "b": 2, "c": 0}) == {"a": {"wheel_slip"}, "b": set()}
