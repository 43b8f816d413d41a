"""Verdicts on the practice robots: correct or ambiguous, never confidently wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.practice_robots import judge, make_trial
from support.practice_robots.score import Judgement
from truing.diagnose.diagnosis_input import read_input
from truing.diagnose.engine import analyse

pytestmark = pytest.mark.slow


def judged(folder: Path, seed: int, effect: str, second: str | None = None) -> Judgement:
    answer = make_trial(seed, effect, folder=folder, plan_kind="thirds", second_effect=second)
    # What is judged here needs no proposal for the next run.
    return judge(answer, analyse(read_input(folder / "recordings", None), jobs=1).to_json())


@pytest.mark.parametrize(
    ("effect", "seed"),
    [
        ("coulomb_friction", 31),
        ("gear_backlash", 35),  # of robot 31 it is ambiguous, and takes four times as long
        ("torque_ripple", 31),
        ("wheelbase_error", 31),
        ("speed_filter", 31),
    ],
)
def test_a_hidden_effect_is_named(tmp_path: Path, effect: str, seed: int) -> None:
    said = judged(tmp_path, seed, effect)
    assert said["named"]
    assert not said["confidently_wrong"]


def test_two_hidden_effects_are_both_named(tmp_path: Path) -> None:
    said = judged(tmp_path, 32, "turning_scrub", "driver_lag")
    assert said["named"]
    assert not said["confidently_wrong"]


@pytest.mark.parametrize("kind", ["null_exact", "null_numbers"])
def test_a_healthy_robot_gets_no_false_positive(tmp_path: Path, kind: str) -> None:
    assert judged(tmp_path, 33, kind)["right"]


@pytest.mark.parametrize(("effect", "seed"), [("knocks", 34), ("flexible_drive", 36)])
def test_what_is_in_no_catalogue_is_not_called_by_a_name_of_it(
    tmp_path: Path, effect: str, seed: int
) -> None:
    assert not judged(tmp_path, seed, effect)["confidently_wrong"]
