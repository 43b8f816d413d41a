"""A concealed trial shows its seal first, keeps its answer, and scores what the diagnosis says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from truing.diagnose.result import Diagnosis, FitErrors, NamedEffect, NextExperiment
from truing.errors import BrokenSealError
from truing.plan import load_plan
from truing.recording.reader import read_recording_set
from truing.trial.concealed import Asked, run_concealed
from truing.trial.effects import CATALOGUE, INTERMITTENT, OUTSIDE
from truing.trial.figures import bounds
from truing.trial.order import tasks
from truing.trial.score import judge, judge_method
from truing.trial.seal import open_seal, seal
from truing.trial.sealed_process import family_of
from truing.trial.spec import PLAN_NAMES, draw_trial, with_strengths

CATALOGUE_SIZE = 27


def diagnosed(kind: Any, *names: str) -> Diagnosis:
    effects = tuple(NamedEffect(name, "both", {}, 1.0, 1.0, 1.0) for name in names)
    return Diagnosis("set", kind, (), FitErrors(1.0, 1.0, 1.0, 1.0), effects)


def test_a_seal_opens_with_its_own_answer_only() -> None:
    shown, text = seal({"effects": []})
    assert open_seal(shown, text) == {"effects": []}
    with pytest.raises(BrokenSealError):
        open_seal(shown, text.replace("effects", "effect"))
    assert seal({"effects": []})[0] != shown


def test_every_effect_of_the_catalogue_and_those_beyond_can_be_hidden_in_a_robot() -> None:
    assert len(CATALOGUE) == CATALOGUE_SIZE
    assert len(OUTSIDE) == 8
    assert len(INTERMITTENT) == 4
    for effect in (*CATALOGUE.values(), *OUTSIDE.values(), *INTERMITTENT.values()):
        trial = draw_trial(1, "outside" if effect.outside else "one", (effect.name,))
        parameters, _ = with_strengths(trial, (effect.start,)).build()
        assert parameters.problem() is None, effect.name


@pytest.mark.slow
def test_the_seal_is_shown_before_the_recordings_and_opened_after_the_verdict(
    tmp_path: Path, native_library: Path
) -> None:
    heard: list[str] = []

    def stand_in(folder: Path, baseline: Path) -> Diagnosis:
        heard.append("diagnosed")
        runs = read_recording_set(folder, baseline)
        assert len(runs) == 2
        files = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
        assert files == {"baseline.toml", *(f"runs/{run.name}.csv" for run in runs)}
        assert not (tmp_path / "judged").exists()
        return diagnosed("missing_physics", "input_delay")

    asked = Asked(
        "input_delay",
        3,
        plans=("diagnosis/reversals", "diagnosis/slow_ramps"),
        core=True,
        judged=tmp_path / "judged",
    )
    result = run_concealed(asked, tmp_path / "set", tell=heard.append, diagnose=stand_in)
    assert heard == [result.sha256, "diagnosed"]
    assert [each["name"] for each in result.answer["effects"]] == ["input_delay"]
    assert len(list((tmp_path / "judged" / "runs").glob("*.csv"))) == 4


@pytest.mark.slow
def test_an_ambiguity_gets_the_runs_that_it_proposes_from_the_same_robot(
    tmp_path: Path, native_library: Path
) -> None:
    plan = load_plan("diagnosis/coast_downs")
    seen: list[int] = []

    def stand_in(folder: Path, baseline: Path) -> Diagnosis:
        seen.append(len(read_recording_set(folder, baseline)))
        proposed = NextExperiment(plan, (("input_delay",), ("driver_lag",)), 5.0, "")
        return replace(diagnosed("ambiguous", "input_delay", "driver_lag"), next_experiment=proposed)

    asked = Asked("input_delay", 3, plans=("diagnosis/reversals",), core=True, more_runs=2)
    result = run_concealed(asked, tmp_path, diagnose=stand_in)
    assert seen == [1, 2, 3]
    assert len(result.more) == 2


def test_verdicts_are_worth_what_the_bars_ask_for() -> None:
    assert judge("ambiguous", ("a", "b", "c"), "one", ("a",)).named
    assert not judge("ambiguous", ("a", "b", "c", "d"), "one", ("a",)).named
    assert judge("missing_physics", ("b",), "one", ("a",)).confidently_wrong
    assert not judge("ambiguous", ("b",), "one", ("a",)).confidently_wrong
    assert judge("missing_physics", ("a",), "one", ("a",)).named_alone
    assert judge("missing_physics", ("a", "b", "c"), "two", ("a", "b")).named
    assert not judge("missing_physics", ("a", "b", "c", "d"), "two", ("a", "b")).named
    assert not judge("missing_physics", ("a",), "two", ("a", "b")).named
    several = judge("partly_explained", ("a", "b", "c", "d"), "several", ("a", "b", "c"), sure=("a", "b"))
    assert several.named
    assert not several.confidently_wrong
    assert judge("partly_explained", ("a", "x"), "several", ("a", "b", "c"), sure=("x",)).confidently_wrong
    assert judge("parameters_only", (), "null", ()).right
    assert judge("missing_physics", ("a",), "null", ()).confidently_wrong
    assert judge("unexplained", (), "outside", ("x",)).right
    assert judge("missing_physics", ("a",), "outside", ("x",)).confidently_wrong
    assert judge("unexplained", (), "intermittent", ("push",)).right
    assert judge("partly_explained", (), "intermittent", ("push",)).right
    for kind in ("consistent", "parameters_only", "missing_physics", "ambiguous"):
        assert not judge(kind, (), "intermittent", ("push",)).right
    assert judge("partly_explained", ("a",), "intermittent", ("push",)).confidently_wrong
    assert judge_method(["a"], "one", ("a",)) == (True, False)
    assert judge_method(["a", "b"], "one", ("a",)) == (False, True)
    assert judge_method([], "null", ()) == (True, False)


def test_bounds_hold_their_share_and_narrow_with_trials() -> None:
    low, high = bounds(0, 10)
    assert low == 0.0
    assert high == pytest.approx(0.3085, abs=1e-3)
    assert bounds(90, 100)[0] > bounds(9, 10)[0]


def test_a_campaign_hides_each_single_effect_equally_often_at_both_strengths() -> None:
    every = tasks(470, 1)
    for name in CATALOGUE:
        mine = [each.weak for each in every if each.effect == name]
        assert (len(mine), sum(bool(weak) for weak in mine)) == (10, 5), name
    assert [sum(each.effect == kind for each in every) for kind in ("none", "pair")] == [100, 60]
    assert sum(each.on_board for each in every) == 47


@pytest.mark.parametrize("trials", [20, 50, 137])
def test_any_beginning_of_a_campaign_is_balanced(trials: int) -> None:
    counts = {"none": 100, "pair": 60}
    some = tasks(trials, 1)
    for kind, of_all in counts.items():
        assert abs(sum(each.effect == kind for each in some) - trials * of_all / 470) <= 1.0
    weak = [each.weak for each in some if each.weak is not None]
    assert abs(2 * sum(weak) - len(weak)) <= 1
    assert some == tasks(470, 1)[:trials]


def test_the_block_of_several_conceals_three_and_four_effects_at_once() -> None:
    every = tasks(60, 1, "several")
    assert {each.effect for each in every} == {"several"}
    numbers = {len(draw_trial(each.seed, family_of(each.effect)[0]).names) for each in every}
    assert numbers == {3, 4}


def test_the_last_block_shares_no_seed_with_any_campaign() -> None:
    last = {each.seed for each in tasks(470, 3, "last")}
    others = {each.seed for seed in range(1, 50) for each in tasks(470, seed)}
    assert not last & others


def test_the_diagnosis_plans_are_thirteen_runs_of_about_fifteen_seconds() -> None:
    plans = [load_plan(name) for name in PLAN_NAMES]
    assert all(13.0 <= plan.duration_s <= 17.0 for plan in plans)
