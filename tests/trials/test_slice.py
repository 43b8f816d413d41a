"""A slice of the campaign: few runs, the real diagnosis, everything scored beside the truth."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
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


@pytest.mark.slow
def test_knocks_are_scored_by_where_they_are(tmp_path: Path, native_library: Path) -> None:
    one = trial("knocks", 3, tmp_path)
    assert (one.family, one.hidden) == ("intermittent", ("knocks",))
    assert one.strength >= 1.0
    assert one.right
    assert not one.named
    assert one.measured["covered"] > 0.5
    assert one.place_right
    # An impulse of some hundredths of a second leaves most of a run as it was.
    with np.load(tmp_path / "judged" / "truth.npz") as truth:
        energy = (truth["speed"] - truth["plain_speed"]) ** 2
    assert np.sort(energy.ravel())[::-1].cumsum()[energy.size // 4] > 0.8 * energy.sum()
