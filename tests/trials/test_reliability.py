"""Stated confidences beside how often the effects are concealed."""

from __future__ import annotations

from dataclasses import replace

import pytest

from support.pretended_trials import pretended
from truing.trial.order import Task
from truing.trial.reliability import reliability, reliability_table
from truing.trial.score import Score


def named(effect: str, stated: float, concealed: str = "coulomb_friction") -> Score:
    """A trial that conceals one effect and names one with a stated confidence."""
    score = pretended(Task(0, concealed, 1, False, False))
    return replace(score, said=(effect,), confidences={effect: stated})


def test_a_confidence_that_is_right_as_often_as_it_says_is_calibrated() -> None:
    right = [named("coulomb_friction", 0.85)] * 17
    wrong = [named("input_delay", 0.85)] * 3
    (only,) = reliability([*right, *wrong])
    assert (only.true, only.number) == (17, 20)
    assert only.stated == pytest.approx(0.85)
    assert only.is_calibrated


def test_a_confidence_that_is_right_less_often_is_not() -> None:
    (only,) = reliability([named("input_delay", 0.99)] * 10 + [named("coulomb_friction", 0.99)] * 10)
    assert not only.is_calibrated
    assert any(
        "| 50 % |" in line and "| no |" in line
        for line in reliability_table(
            [named("x", 1.0)] * 2
            + [named("coulomb_friction", 1.0)] * 2
            + [named("input_delay", 0.99)] * 8
            + [named("coulomb_friction", 0.99)] * 8
        )
    )


def test_a_name_in_a_trial_outside_the_catalogue_is_wrong() -> None:
    score = replace(named("coulomb_friction", 0.5), family="outside", hidden=("tether",))
    (only,) = reliability([score])
    assert only.true == 0


def test_campaigns_from_before_confidences_were_kept_say_so() -> None:
    score = replace(named("coulomb_friction", 0.5), confidences={})
    assert "No trial" in reliability_table([score])[0]
    assert Score.from_json(score.to_json()) == score
