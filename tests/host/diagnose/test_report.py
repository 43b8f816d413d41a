"""What is said and drawn about a diagnosis: sentences, one page without a network, cells at a stated rate."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from support import diagnoses
from support.recorded_sets import recordings
from truing.diagnose.present.cells import benjamini_hochberg, locate
from truing.diagnose.present.page import render_report, save_report
from truing.diagnose.present.text import headline, place_lines, sections, value_text
from truing.diagnose.result import Diagnosis, EffectParameter, Explanation, MismatchSpan

DIAGNOSES = [
    diagnoses.missing_physics,
    diagnoses.ambiguous,
    diagnoses.parameters_only,
    diagnoses.consistent,
    diagnoses.unexplained,
]


def said(diagnosis: Diagnosis) -> str:
    return "\n".join(line for section in sections(diagnosis) for line in section.lines)


def test_the_verdict_names_the_effect_its_size_and_what_it_brings() -> None:
    text = said(diagnoses.missing_physics())
    assert "dry friction" in text
    assert "left 0.051 of full effort (0.049 to 0.053)" in text
    assert "falls from 43 to 12 mm/s; the noise floor is 11 mm/s" in text
    assert "could not have shown: a current limit" in text


def test_parameters_that_differ_are_listed_with_their_estimates() -> None:
    text = said(diagnoses.parameters_only())
    assert "The parameters of your simulation are wrong; no missing effect was detected." in text
    assert "Left gain: 1.520 m/s (1.516 to 1.524) instead of 1.45 m/s (+4.8 %)." in text
    assert "Right gain" not in text, "a number inside its interval is not off"


def test_an_explained_verdict_beside_a_large_error_warns() -> None:
    explained = diagnoses.parameters_only()
    assert "the verdict is uncertain" not in said(explained)
    left = replace(explained, fit=replace(explained.fit, refit_rmse=0.03))
    assert "still 2.7 times the noise floor" in said(left)


def test_rivals_are_named_in_the_headline_with_the_run_that_settles_it() -> None:
    diagnosis = diagnoses.ambiguous()
    assert "dry friction or a dead band" in headline(diagnosis)
    assert "Drive this 5-second run (--next-run FILE writes it)" in said(diagnosis)


def test_effects_that_act_together_are_one_alternative() -> None:
    both = (
        diagnoses.friction(indistinguishable_from=("input_delay",)),
        diagnoses.deadband(indistinguishable_from=("input_delay",)),
        diagnoses.deadband(
            name="input_delay", indistinguishable_from=("coulomb_friction", "driver_deadband"), explanation=1
        ),
    )
    text = headline(replace(diagnoses.ambiguous(), effects=both))
    assert "dry friction with a dead band in the motor driver; or a delay" in text


def test_an_uncertain_second_effect_is_named_beside_the_certain_first() -> None:
    explanations = tuple(
        Explanation(names, np.zeros(4)) for names in (("wheel_slip", "gear_backlash"), ("wheel_slip",))
    )
    slip = diagnoses.friction(name="wheel_slip", indistinguishable_from=())
    gap = diagnoses.friction(name="gear_backlash", indistinguishable_from=("wheel_slip",))
    diagnosis = replace(diagnoses.ambiguous(), effects=(slip, gap), explanations=explanations)
    assert headline(diagnosis).startswith("Missing from the simulation: ")
    assert "perhaps also" in headline(diagnosis)
    assert "Perhaps absent: without it, " in render_report(recordings(4), diagnosis)


def test_places_of_one_kind_are_listed_together() -> None:
    lines = place_lines(diagnoses.missing_physics())
    assert lines[0].startswith("Left wheel, near standstill, after a reversal: 52 % of the mismatch")
    assert "and 1 like it" in lines[0]
    assert len(lines) == 2


def test_hundreds_of_places_still_make_a_few_lines() -> None:
    spans = tuple(MismatchSpan("01", "vel_left_mps", k, k + 1.0, 0.01, f"kind {k % 9}") for k in range(200))
    assert len(place_lines(replace(diagnoses.missing_physics(), mismatch=spans))) <= 5


@pytest.mark.parametrize(
    ("parameter", "text"),
    [
        (EffectParameter(0.0512, (0.0493, 0.0531), "effort"), "0.051 of full effort (0.049 to 0.053)"),
        (EffectParameter(0.0604, (0.0581, 0.0627), "s"), "60 ms (58 to 63)"),
        (EffectParameter(1.0512, (1.0402, 1.0622), "1"), "1.05 (1.04 to 1.06)"),
        (EffectParameter(-0.00004, (-0.004, 0.004), "rad"), "0.000 rad (-0.004 to 0.004)"),
    ],
)
def test_values_have_as_many_digits_as_their_interval_is_worth(parameter: EffectParameter, text: str) -> None:
    assert value_text(parameter) == text


@pytest.mark.parametrize("make", DIAGNOSES)
def test_the_page_stands_alone_and_has_every_section_it_promises(make, tmp_path: Path) -> None:
    diagnosis = make()
    path = save_report(recordings(4), diagnosis, tmp_path / "report.html")
    page = path.read_text("utf-8")
    assert "What was compared" in page
    assert "Where it differs" in page
    assert "What to do" in page
    markup = re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r'(src|href)="(https?:)?//', markup), "nothing is fetched"
    places = set(re.findall(r'class="plot" id="([^"]+)"', markup))
    figures = set(re.findall(r'"((?:heat|against|run|ranking|splits|plan|pose)(?:-\d+)?)":\{"data"', page))
    assert places == figures
    _Balanced().feed(markup)


def test_names_from_files_cannot_break_the_page() -> None:
    evil = "<script>alert(1)</script>"
    diagnosis = replace(
        diagnoses.missing_physics(),
        name=evil,
        notes=(evil,),
        mismatch=(MismatchSpan(evil, "vel_left_mps", 0.0, 1.0, 1.0, evil),),
        traces=tuple(replace(trace, run=evil) for trace in diagnoses.traces()),
    )
    assert evil not in render_report(recordings(4), diagnosis)


def test_a_diagnosis_without_traces_still_makes_a_page() -> None:
    page = render_report(recordings(4), replace(diagnoses.unexplained(), traces=(), mismatch=(), splits=()))
    assert "nothing in the catalogue explains it" in page


def test_the_bump_stands_out_in_time_and_few_cells_elsewhere_do() -> None:
    true, false, found = 0, 0, 0
    for seed in range(10):
        left, right = locate(diagnoses.missing_physics(traces=diagnoses.traces(seed))).cells
        rows, columns = np.nonzero(left.stands_out)
        inside = (rows == 1) & (left.edges_s[columns + 1] > 2.0) & (left.edges_s[columns] < 3.0)
        true += inside.sum()
        false += (~inside).sum() + right.stands_out.sum()
        found += bool(inside.any())
    assert found == 10
    # The bump fills four or five cells of a quarter of a second; stated rate 5 %.
    assert true >= 40
    assert false <= 0.1 * (true + false)


def test_after_the_bump_is_modelled_hardly_a_cell_stands_out() -> None:
    located = locate(diagnoses.missing_physics(), after=True)
    assert located.found <= 2
    assert located.tested > 200


def test_pure_noise_names_cells_at_no_more_than_the_stated_rate() -> None:
    sets_with_a_cell = 0
    for seed in range(40):
        diagnosis = diagnoses.missing_physics(traces=diagnoses.traces(seed, bump_mps=0.0))
        sets_with_a_cell += locate(diagnosis).found > 0
    # With nothing to find, the rate is the chance of any discovery: 2 of 40; 6 is beyond its 99 % point.
    assert sets_with_a_cell <= 6


def test_benjamini_hochberg_takes_the_smallest_up_to_the_last_below_the_line() -> None:
    p_values = np.array([0.001, 0.04, 0.012, np.nan, 0.9, 0.02])
    # Sorted over 5: 0.001 <= 0.01, 0.012 <= 0.02, 0.02 <= 0.03, 0.04 <= 0.04.
    assert benjamini_hochberg(p_values).tolist() == [True, True, True, False, False, True]
    assert not benjamini_hochberg(np.array([0.2, 0.5])).any()


class _Balanced(HTMLParser):
    """Fails on a tag that is closed without being open."""

    VOID = frozenset({"meta", "br", "hr", "img", "input", "link", "line", "circle"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in self.VOID:
            assert self.open
            assert self.open.pop() == tag
