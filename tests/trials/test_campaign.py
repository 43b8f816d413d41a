"""A campaign goes on where it was stopped, says how it stands beside its bars, and a slice of it is right."""

from __future__ import annotations

from pathlib import Path

import pytest

from truing.errors import TruingError
from truing.trial.campaign import read_scores, run_campaign
from truing.trial.figures import by_method, figures
from truing.trial.order import Task, tasks
from truing.trial.results import to_markdown
from truing.trial.score import Score, judge

TRIALS = 12


def pretended(each: Task) -> Score:
    """A trial whose verdict is always the truth, of a campaign that takes no time."""
    families = {"none": "null", "pair": "two"}
    family = families.get(each.effect, "outside" if each.weak is None else "one")
    hidden = {"null": (), "two": ("input_delay", "turning_scrub")}.get(family, (each.effect,))
    kind = {"null": "consistent", "outside": "unexplained"}.get(family, "missing_physics")
    said = hidden if kind == "missing_physics" else ()
    worth = judge(kind, said, family, hidden)
    return Score(
        effect=each.effect, seed=each.seed, weak=each.weak, family=family, hidden=hidden,
        strengths=tuple(0.5 if each.weak else 2.0 for _ in hidden), driving="whole", on_board=each.on_board,
        verdict=kind, said=said, named=worth.named, named_alone=worth.named_alone,
        confidently_wrong=worth.confidently_wrong, right=worth.right,
        place_right=True if family == "outside" else None, later=(), resolved=None, seconds=1.0, cpu_s=1.0,
        building_cpu_s=1.0, scoring_cpu_s=1.0, sha256="", measured={"gap_closed": 0.95, "harm": 0.5},
        methods={"guess": (False, True)},
    )  # fmt: skip


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
    scores = run_campaign(TRIALS, 1, folder, shares.append, lambda _text: None, jobs=1, **values)  # type: ignore[arg-type]
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
