"""A second effect is named for sure only where it is more than a mend of the first one's equation."""

from __future__ import annotations

import numpy as np
import pytest

from support.simulated_runs import RICH, noisy_robot
from truing.diagnose.engine import investigate
from truing.diagnose.pairs import stronger_part, surely_both
from truing.diagnose.verdict import Reasoning

pytestmark = pytest.mark.slow

NOISE_MPS = 0.01
SIX_RUNS = tuple(scale * run for scale in (1.0, 0.8, 0.9) for run in RICH)
FIRST = {"quadratic_drag": {"left": 0.3, "right": 0.3}}


def reasoned(second: dict[str, dict[str, float]]) -> Reasoning:
    return investigate(noisy_robot(SIX_RUNS, FIRST | second, NOISE_MPS, 3), lambda _: None, 1)


def test_two_strong_effects_are_both_missing() -> None:
    found = reasoned({"direction_asymmetry": {"left": 0.9, "right": 0.92}})
    assert found.verdict == "missing_physics"
    assert set(found.best.effects) == {"quadratic_drag", "direction_asymmetry"}
    assert surely_both(found.search, found.best)


def test_a_second_effect_below_the_noise_is_told_as_a_doubt() -> None:
    found = reasoned({"direction_asymmetry": {"left": 0.985, "right": 0.985}})
    assert found.verdict == "ambiguous"
    assert set(found.best.effects) == {"quadratic_drag", "direction_asymmetry"}
    assert ("quadratic_drag",) in [rival.effects for rival in found.rivals]
    assert found.confidence <= 0.5


def test_what_helps_some_runs_at_the_cost_of_others_is_no_second_effect() -> None:
    found = reasoned({"direction_asymmetry": {"left": 0.9, "right": 0.92}})
    search, pair = found.search, found.best
    assert stronger_part(search, pair).effects in (("quadratic_drag",), ("direction_asymmetry",))
    harmed = np.isin(search.problem.data.run_of_row, (0, 1))
    pair.residual.wheels[harmed] *= 2.0
    assert not surely_both(search, pair)
