"""A campaign goes on where it was stopped, says how it stands beside its bars, and a slice of it is right."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.pretended_trials import pretended
from truing.errors import TruingError
from truing.fleet.engine import ProcessPool
from truing.trial.campaign import read_scores, run_campaign
from truing.trial.figures import by_method, figures
from truing.trial.order import Task, tasks
from truing.trial.results import to_markdown
from truing.trial.score import Score, judge

TRIALS = 12
STRONG_RIGHT = "intermittent, S >= 2: `unexplained` or `partly_explained`"
NOT_HEALTHY = "intermittent: not `consistent` nor `parameters_only`"
BACKLASH = "gear backlash, S >= 2: named"


def run_and_mark(each: Task, folder: Path) -> Score:
    """Leave a mark for every time that a trial is run."""
    with (folder / "marks").open("a", encoding="utf-8") as file:
        file.write(f"{each.seed}\n")
    return pretended(each)


def run_but_some(each: Task, folder: Path) -> Score:
    """Fail from the seventh trial on, as a machine does that is switched off."""
    if each.number >= 6:
        raise TruingError("switched off")
    return run_and_mark(each, folder)


def campaign(folder: Path, **values: object) -> tuple[list[Score], list[float]]:
    shares: list[float] = []
    scores = run_campaign(
        TRIALS, 1, folder, shares.append, lambda _text: None, engine=ProcessPool(1), **values
    )  # type: ignore[arg-type]
    return scores, shares


def test_a_campaign_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    assert len(campaign(tmp_path, run=run_but_some)[0]) == 6
    with (tmp_path / "trials.jsonl").open("a", encoding="utf-8") as file:
        file.write('{"effect": "none", "se')  # what a kill leaves of a line
    (tmp_path / "trials.jsonl").write_text((tmp_path / "trials.jsonl").read_text() + "\n")
    scores, shares = campaign(tmp_path, run=run_and_mark)
    assert [each.seed for each in scores] == [each.seed for each in tasks(TRIALS, 1)]
    marks = (tmp_path / "marks").read_text().split()
    assert sorted(marks) == sorted(str(each.seed) for each in tasks(TRIALS, 1))
    assert shares[0] == 0.5
    assert shares[-1] == 1.0
    assert list(read_scores(tmp_path / "trials.jsonl").values()) == scores


def test_a_campaign_begins_no_trial_after_its_time(tmp_path: Path) -> None:
    assert campaign(tmp_path, run=run_and_mark, minutes=0.0)[0] == []


def test_the_page_has_every_figure_with_bar_bounds_and_seeds(tmp_path: Path) -> None:
    table = tmp_path / "RESULTS.md"
    scores, _ = campaign(tmp_path, run=run_and_mark, table=table)
    page = table.read_text()
    assert page == to_markdown(scores, trials=TRIALS, seed=1, block="main")
    assert all(each.title in page for each in figures(scores))
    assert all(f"| {each.effect} | {each.seed} |" in page for each in scores)
    met = {each.title: each.met for each in figures(scores)}
    assert met["nothing concealed: no false positive"]


def test_methods_are_counted_over_the_same_trials(tmp_path: Path) -> None:
    scores = [pretended(each) for each in tasks(100, 1)]
    table = by_method(scores)
    assert [(hits, number) for _, hits, number in table["guess"]][-1] == (100, 100)
    assert [number for _, _, number in table["guess"]] == [
        number for _, _, number in table["truing, named alone"]
    ]
    assert all(hits == number for title, hits, number in table["truing, named alone"][:-1])


@pytest.mark.parametrize(("right", "met"), [(100, True), (97, False)])
def test_a_false_positive_on_a_healthy_robot_counts_against_its_limit(right: int, met: bool) -> None:
    healthy = [each for each in tasks(470, 1) if each.effect == "none"]
    scores = [pretended(each) for each in healthy]
    wrong = judge("missing_physics", ("input_delay",), "null", ())
    for k in range(right, 100):
        values = scores[k].to_json() | {"right": wrong.right, "confidently_wrong": wrong.confidently_wrong}
        scores[k] = Score.from_json(values)
    figure = next(each for each in figures(scores) if each.title == "nothing concealed: no false positive")
    assert figure.number == 100
    assert figure.met is met


def of_kind(effect: str, family: str, strength: float, verdict: str, *said: str) -> Score:
    """A trial of one effect with this strength and this verdict."""
    worth = judge(verdict, said, family, (effect,))
    values = pretended(tasks(1, 1)[0]).to_json() | {
        "effect": effect, "family": family, "hidden": (effect,), "strengths": (strength,), "verdict": verdict,
        "said": said, "right": worth.right, "named": worth.named, "place_right": True,
    }  # fmt: skip
    return Score.from_json(values)


def test_what_acts_for_some_time_only_has_figures_of_its_own() -> None:
    strong = [of_kind("knocks", "intermittent", 2.5, "unexplained") for _ in range(18)]
    strong.append(of_kind("push", "intermittent", 2.0, "partly_explained", "input_delay"))
    weak = [of_kind("push", "intermittent", 1.9, "ambiguous", "input_delay", "driver_lag")]
    found = {each.title: each for each in figures([*strong, *weak])}
    assert (found[STRONG_RIGHT].number, found[STRONG_RIGHT].value, found[STRONG_RIGHT].met) == (19, 1.0, True)
    assert (found[NOT_HEALTHY].number, found[NOT_HEALTHY].met) == (20, True)
    assert found["outside the catalogue: `unexplained`"].number == 0

    missed = [of_kind("knocks", "intermittent", 1.1, "parameters_only")]
    found = {each.title: each for each in figures([*strong, *weak, *missed])}
    assert found[STRONG_RIGHT].met
    assert found[NOT_HEALTHY].met is False
    wrong = [of_kind("carpet_strip", "intermittent", 3.0, "missing_physics", "coulomb_friction")]
    found = {each.title: each for each in figures([*strong[:18], *wrong])}
    assert found[STRONG_RIGHT].met is False


def test_gear_backlash_of_some_size_must_be_named() -> None:
    named = [of_kind("gear_backlash", "one", 2.0, "ambiguous", "gear_backlash", "driver_deadband")] * 19
    weaker = [of_kind("gear_backlash", "one", 1.9, "parameters_only")]
    other = [of_kind("input_delay", "one", 4.0, "parameters_only")]
    figure = next(each for each in figures([*named, *weaker, *other]) if each.title == BACKLASH)
    assert (figure.number, figure.value, figure.met) == (19, 1.0, True)
    missed = [of_kind("gear_backlash", "one", 6.0, "unexplained")] * 2
    figure = next(each for each in figures([*named, *missed]) if each.title == BACKLASH)
    assert (figure.number, figure.met) == (21, False)
