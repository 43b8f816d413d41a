"""What only the hardest of several runs reaches: the other runs cannot say what it shows."""

from __future__ import annotations

import numpy as np
import pytest

from support.simulated_runs import levels, noisy_robot
from truing.diagnose.engine import initial_fit, investigate
from truing.diagnose.search import Search
from truing.diagnose.simulation.simulator import SetSimulator
from truing.diagnose.unseen_runs import UnseenRuns

NOISE_MPS, LIMIT = 0.003, 1.2
GENTLE = (
    levels((0.6, 0.6), (0.2, 0.5), (0.0, 0.0), (0.4, 0.3)),
    levels((0.3, 0.0), (0.0, 0.0), (0.5, -0.4), (0.7, 0.7)),
    levels((-0.4, -0.4), (0.0, 0.0), (0.6, 0.2), (0.0, 0.0)),
)
REVERSALS = levels((1.0, 1.0), (-1.0, -1.0), (0.0, 0.0))


@pytest.fixture(scope="module")
def limited():
    """Thirteen runs; the driver's limit acts in the reversals of the last one alone."""
    return noisy_robot((*(4 * GENTLE), REVERSALS), {"current_limit": {"limit": LIMIT}}, NOISE_MPS, 4)


def test_a_run_that_alone_shows_an_effect_is_left_out_in_quarters(limited) -> None:
    stage = initial_fit(limited, SetSimulator(limited))
    one = Search(stage.problem, {(): stage.base}, jobs=1).with_effect(stage.base, "current_limit")
    unseen = UnseenRuns(stage.problem, stage.base)
    assert unseen.benefit(one, stage.base) > 0.3
    split = frozenset({12})
    assert {runs for _, runs in unseen._known} == {split}
    by_part = unseen.errors(one, split).by_part
    assert (
        np.count_nonzero(by_part) == 4 + 4
    )  # the other runs in four parts, and the quarters of the last one
    np.testing.assert_allclose(by_part.sum(), unseen.errors(one, split).by_run.sum())


def test_a_run_among_others_that_show_the_effect_is_left_out_whole() -> None:
    shown = noisy_robot((REVERSALS, *GENTLE, REVERSALS), {"current_limit": {"limit": LIMIT}}, NOISE_MPS, 4)
    stage = initial_fit(shown, SetSimulator(shown))
    one = Search(stage.problem, {(): stage.base}, jobs=1).with_effect(stage.base, "current_limit")
    unseen = UnseenRuns(stage.problem, stage.base)
    assert unseen.benefit(one, stage.base) > 0.3
    assert {runs for _, runs in unseen._known} == {frozenset()}


def test_a_limit_that_one_run_reaches_is_named(limited) -> None:
    found = investigate(limited, lambda _: None, 1)
    assert found.best.effects == ("current_limit",)
    assert found.best.value("current_limit.limit") == pytest.approx(LIMIT, rel=0.05)
