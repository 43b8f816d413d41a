"""A slice of the campaign: few runs, the real diagnosis, everything scored beside the truth."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from truing.trial.campaign import score
from truing.trial.concealed import Asked, run_concealed
from truing.trial.score import Score
from truing.trial.spec import PLAN_NAMES

PLANS = tuple(PLAN_NAMES[index] for index in (0, 2, 4, 7))


def trial(effect: str, seed: int, folder: Path) -> Score:
    asked = Asked(effect, seed, plans=PLANS, weak=False, core=True, judged=folder / "judged")
    return score(asked, run_concealed(asked, folder / "set"), folder)


@pytest.mark.slow
def test_a_robot_that_drags_is_found_out_and_scored(tmp_path: Path, native_library: Path) -> None:
    one = trial("direction_asymmetry", 5, tmp_path)
    assert one.hidden == ("direction_asymmetry",)
    assert one.strength >= 1.0
    assert one.named
    figures = one.measured
    assert 0.8 < figures["gap_closed"] < 1.1
    assert figures["harm"] < 1.0
    assert 0.3 < figures["true_over_floor"] < 3.0
    assert figures["covered"] > 0.5
    assert figures["effect_share"] > 0.5
    assert set(figures["effective"]) == {"direction_asymmetry.left", "direction_asymmetry.right"}
    assert figures["rival_distance"] > 0.0
    assert set(one.methods) == {"regression with sign", "sparse regression", "picker by training error"}


@pytest.mark.slow
def test_nothing_is_named_on_a_healthy_robot(tmp_path: Path, native_library: Path) -> None:
    one = trial("none", 6, tmp_path)
    assert one.hidden == ()
    assert one.right
    assert one.measured["covered"] is None
    assert math.isfinite(one.measured["harm"])
