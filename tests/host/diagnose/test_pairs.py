"""A second effect is named only where it does more than compensate the first one's model error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from support.simulated_runs import RICH, noisy_robot
from truing.diagnose.engine import investigate
from truing.diagnose.pairs import both_significant, stronger_part
from truing.diagnose.verdict import Reasoning

pytestmark = pytest.mark.slow

NOISE_MPS = 0.01
SIX_RUNS = tuple(scale * run for scale in (1.0, 0.8, 0.9) for run in RICH)
FIRST = {"quadratic_drag": {"left": 0.3, "right": 0.3}}


def reasoned(second: dict[str, dict[str, float]]) -> Reasoning:
    return investigate(noisy_robot(SIX_RUNS, FIRST | second, NOISE_MPS, 3), lambda _: None, 1)


@pytest.fixture(scope="module")
def two_strong() -> Reasoning:
    return reasoned({"direction_asymmetry": {"left": 0.9, "right": 0.92}})


def test_two_strong_effects_are_both_missing(two_strong: Reasoning) -> None:
    found = two_strong
    assert found.verdict == "missing_physics"
    assert set(found.best.effects) == {"quadratic_drag", "direction_asymmetry"}
    assert both_significant(found.search, found.best)


def test_a_second_effect_below_the_noise_makes_the_verdict_ambiguous() -> None:
    found = reasoned({"direction_asymmetry": {"left": 0.985, "right": 0.985}})
    assert found.verdict == "ambiguous"
    assert set(found.best.effects) == {"quadratic_drag", "direction_asymmetry"}
    assert ("quadratic_drag",) in [rival.effects for rival in found.rivals]
    assert found.confidence <= 0.5


def test_what_helps_some_runs_at_the_cost_of_others_is_no_second_effect(two_strong: Reasoning) -> None:
    search, pair = two_strong.search, two_strong.best
    assert stronger_part(search, pair).effects in (("quadratic_drag",), ("direction_asymmetry",))
    harmed = np.isin(search.problem.data.run_of_row, (0, 1))[:, None]
    wheels = np.where(harmed, 2.0 * pair.residual.wheels, pair.residual.wheels)
    assert not both_significant(search, replace(pair, residual=replace(pair.residual, wheels=wheels)))
