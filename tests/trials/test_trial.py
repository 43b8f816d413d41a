"""A concealed trial shows its seal first, keeps its answer, and scores what the diagnosis says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from truing.plan import load_plan
from truing.recording_reader import read_recording_set
from truing.trial.campaign import task
from truing.trial.concealed import run_concealed
from truing.trial.effects import CATALOGUE, OUTSIDE
from truing.trial.score import bounds, score
from truing.trial.seal import BrokenSealError, open_seal, seal
from truing.trial.spec import draw_trial, with_strengths

CATALOGUE_SIZE = 27


def says(kind: str, *names: str) -> dict[str, Any]:
    return {"verdict": kind, "effects": [{"name": name} for name in names]}


def hid(family: str, *names: str) -> dict[str, Any]:
    effects = [{"name": name, "strength": 2.0} for name in names]
    return {"family": family, "effects": effects, "driving": "whole"}


def scored(verdict: dict[str, Any], answer: dict[str, Any]) -> Any:
    return score("random", 1, verdict, answer, seconds=1.0, sha256="", on_board=False)


def test_a_seal_opens_with_its_own_answer_only() -> None:
    shown, text = seal({"effects": []})
    assert open_seal(shown, text) == {"effects": []}
    with pytest.raises(BrokenSealError):
        open_seal(shown, text.replace("effects", "effect"))
    assert seal({"effects": []})[0] != shown


def test_every_effect_of_the_catalogue_and_six_beyond_can_be_hidden_in_a_robot() -> None:
    assert len(CATALOGUE) == CATALOGUE_SIZE
    assert len(OUTSIDE) >= 6
    for effect in (*CATALOGUE.values(), *OUTSIDE.values()):
        trial = draw_trial(1, "outside" if effect.outside else "one", (effect.name,))
        parameters, _ = with_strengths(trial, (effect.start,)).build()
        assert parameters.problem() is None, effect.name


@pytest.mark.slow
def test_the_seal_is_shown_before_the_recordings_and_opened_after_the_verdict(
    tmp_path: Path, native_library: Path
) -> None:
    heard: list[str] = []

    def look(folder: Path, baseline: Path) -> dict[str, Any]:
        heard.append("diagnosed")
        runs = read_recording_set(folder, baseline)
        assert len(runs) == 2
        files = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
        assert files == {"baseline.toml", *(f"runs/{run.name}.csv" for run in runs)}
        return says("missing_physics", "input_delay")

    result = run_concealed(
        "input_delay", 3, tmp_path, plans=("diagnosis/02", "diagnosis/03"), core=True,
        tell=heard.append, diagnose=look,
    )  # fmt: skip
    assert heard == [result.sha256, "diagnosed"]
    assert [each["name"] for each in result.answer["effects"]] == ["input_delay"]
    assert scored(result.verdict, result.answer).right


def test_scores_are_what_the_bars_ask_for() -> None:
    assert scored(says("ambiguous", "a", "b", "c"), hid("one", "a")).named
    assert not scored(says("ambiguous", "a", "b", "c", "d"), hid("one", "a")).named
    assert scored(says("missing_physics", "b"), hid("one", "a")).confidently_wrong
    assert scored(says("missing_physics", "a"), hid("one", "a")).named_alone
    assert scored(says("missing_physics", "a", "b", "c"), hid("two", "a", "b")).named
    assert not scored(says("missing_physics", "a"), hid("two", "a", "b")).named
    assert scored(says("parameters_only"), hid("null")).right
    assert scored(says("missing_physics", "a"), hid("null")).confidently_wrong
    assert scored(says("unexplained"), hid("outside", "x")).right


def test_bounds_hold_their_share_and_narrow_with_trials() -> None:
    low, high = bounds(0, 10)
    assert low == 0.0
    assert high == pytest.approx(0.2775, abs=1e-3)
    assert bounds(90, 100)[0] > bounds(9, 10)[0]


def test_a_campaign_hides_each_single_effect_equally_often() -> None:
    singles = [task(1, number)[0] for number in range(900)]
    counts = [singles.count(name) for name in CATALOGUE]
    assert max(counts) - min(counts) <= 1


def test_the_diagnosis_plans_are_thirteen_runs_of_about_fifteen_seconds() -> None:
    plans = [load_plan(f"diagnosis/{number:02d}") for number in range(1, 14)]
    assert all(13.0 <= plan.duration_s <= 17.0 for plan in plans)
