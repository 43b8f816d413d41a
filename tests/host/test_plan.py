"""Plans: what they may say, what is wrong with one that says otherwise, and the floor they need."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from truing.errors import FileError, PlanError
from truing.floor import MotionModel, estimate_floor
from truing.plan import Kind, Plan, Segment, built_in_names, load_plan, parse_plan

ROMAN = [
    "I",
    "II",
    "III",
    "IV",
    "V",
    "VI",
    "VII",
    "VIII",
    "IX",
    "X",
    "XI",
    "XII",
    "XIII",
    "XIV",
    "XV",
    "XVI",
    "XVII",
]


def write(tmp_path: Path, text: str) -> str:
    path = tmp_path / "my.toml"
    path.write_text(text)
    return str(path)


def test_the_papers_seventeen_tests_come_with_truing_in_their_order() -> None:
    assert [name for name in built_in_names() if name.startswith("paper/")] == [f"paper/{r}" for r in ROMAN]


@pytest.mark.parametrize(
    ("name", "kind", "levels"),
    [
        ("paper/I", Kind.EFFORT, [(0.15, 0)]),
        ("paper/IV", Kind.EFFORT, [(0.60, 0)]),
        ("paper/V", Kind.VELOCITY, [(0.15, 0)]),
        ("paper/VII", Kind.VELOCITY, [(0.35, 0)]),
        ("paper/IX", Kind.EFFORT, [(0.15, 0.15), (0.30, 0.30), (0.25, 0.25)]),
        ("paper/XI", Kind.EFFORT, [(0.35, 0.35), (0.50, 0.50), (0.45, 0.45)]),
        ("paper/XVI", Kind.VELOCITY, [(0.45, 0.45), (0.60, 0.60), (0.55, 0.55)]),
        ("paper/XVII", Kind.EFFORT, [(x, x) for x in (0.25, 0.40, 0.30, 0.35, 0.15, 0.60)]),
    ],
)
def test_a_test_of_the_paper_has_its_levels_two_seconds_each(
    name: str, kind: Kind, levels: list[tuple[float, float]]
) -> None:
    first, *middle, last = load_plan(name).segments
    assert [(s.a, s.b) for s in middle] == levels
    assert {s.kind for s in middle} == {kind}
    assert {s.duration_s for s in middle} == {2.0}
    assert (first.duration_s, first.a, first.b) == (1.0, 0.0, 0.0)
    assert (last.duration_s, last.a, last.b) == (2.0, 0.0, 0.0)


def test_a_plan_file_may_use_every_form(tmp_path: Path) -> None:
    plan = load_plan(
        write(
            tmp_path,
            """
            title = "all forms"
            log_rate_hz = 100
            repeat = 2
            [[segment]]
            duration_s = 0.5
            effort = 0.2
            [[segment]]
            duration_s = 1
            velocity_mps = { left = -0.1 }
            [[segment]]
            duration_s = 1.5
            twist = { v_mps = 0.2, omega_radps = -1.0 }
            """,
        )
    )
    assert plan.name == "my"
    assert plan.log_rate_hz == 100
    assert plan.segments[:3] == (
        Segment(Kind.EFFORT, 0.5, 0.2, 0.2),
        Segment(Kind.VELOCITY, 1.0, -0.1, 0.0),
        Segment(Kind.TWIST, 1.5, 0.2, -1.0),
    )
    assert plan.segments[3:] == plan.segments[:3]
    assert plan.duration_s == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", r"my\.toml: there is no \[\[segment\]\]"),
        ("[[segment]]\neffort = 0.1", r"segment 1: duration_s: is missing"),
        ("[[segment]]\nduration_s = 1", r"segment 1: needs exactly one of .*; it has none"),
        ("[[segment]]\nduration_s = 1\neffort = 0.1\nvelocity_mps = 0.1", r"it has effort and velocity_mps"),
        ("[[segment]]\nduration_s = 1\neffort = 0.1\n[[segment]]\nduration_s = 1\neffort = 1.5",
         r"segment 2: effort: 1.5 is outside -1 to 1"),
        ("[[segment]]\nduration_s = 1\neffort = nan", r"segment 1: effort: must be a finite number"),
        ("[[segment]]\nduration_s = inf\neffort = 0.1", r"segment 1: duration_s: must be a finite number"),
        ("[[segment]]\nduration_s = 601\neffort = 0.1", r"duration_s: 601 is outside"),
        ("[[segment]]\nduration_s = 0\neffort = 0.1", r"duration_s: 0 is outside"),
        ('[[segment]]\nduration_s = "1"\neffort = 0.1', r"duration_s: must be a number"),
        ("[[segment]]\nduration_s = true\neffort = 0.1", r"duration_s: must be a number"),
        ("[[segment]]\nduration_s = 1\neffort = [0.1, 0.2, 0.3]", r"two numbers, left and right; it has 3"),
        ("[[segment]]\nduration_s = 1\nefort = 0.1", r"segment 1: efort: unknown key"),
        ("[[segment]]\nduration_s = 1\ntwist = 0.1", r"twist: must be a table"),
        ("[[segment]]\nduration_s = 1\ntwist = { v = 0.1 }", r"twist: v: unknown key"),
        ("log_rate_hz = 500\n[[segment]]\nduration_s = 1\neffort = 0.1", r"500 is outside 1 to 200"),
        ("repeat = 300\n[[segment]]\nduration_s = 1\neffort = 0.1", r"300 segments are more than the 256"),
        ("repeat = 0\n[[segment]]\nduration_s = 1\neffort = 0.1", r"repeat: must be 1 or more"),
        ("segment = 3", r"there is no \[\[segment\]\]"),
        ("[[segment]", r"is not TOML"),
    ],
)  # fmt: skip
def test_a_wrong_plan_is_refused_with_file_segment_and_key(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(PlanError, match=says) as caught:
        load_plan(write(tmp_path, text))
    assert "my.toml" in str(caught.value)


def test_a_mistyped_name_gets_a_suggestion() -> None:
    with pytest.raises(PlanError) as caught:
        load_plan("papr/XI")
    assert "paper/XI" in caught.value.next_step
    with pytest.raises(FileError, match="cannot be read"):
        load_plan("nowhere/none.toml")


def test_names_do_not_depend_on_capitals() -> None:
    assert load_plan("PAPER/xi").name == "paper/XI"


def straight(effort: float, seconds: float) -> Plan:
    return Plan("p", "p", (Segment(Kind.EFFORT, seconds, effort, effort),))


def test_the_floor_is_never_less_than_an_ideal_robot_needs() -> None:
    model = MotionModel(1.45, 1.45, 0.35)
    need = estimate_floor(straight(0.5, 10.0), model)
    assert need.ahead_m > 0.5 * 1.45 * 10.0
    assert need.ahead_m < 1.25 * 0.5 * 1.45 * 10.0
    assert need.top_wheel_speed_mps >= 0.5 * 1.45
    assert need.behind_m == 0.0
    assert need.left_m == pytest.approx(need.right_m)
    assert need.left_m > 0.1


def test_a_robot_that_backs_up_needs_floor_behind_it() -> None:
    need = estimate_floor(straight(-0.3, 2.0))
    assert need.behind_m > 0.5
    assert need.ahead_m == 0.0


def test_a_pivot_needs_little_floor_and_a_square_its_sides() -> None:
    spin = Plan("p", "p", (Segment(Kind.TWIST, 5.0, 0.0, 2.0),))
    assert "turns on the spot" in estimate_floor(spin).sentence()
    square = estimate_floor(load_plan("square"))
    assert square.ahead_m > 0.5
    assert square.left_m > 0.5


def test_the_sentence_says_floor_speed_time_and_that_it_is_an_estimate() -> None:
    said = estimate_floor(load_plan("paper/XI")).sentence()
    for word in ("ahead", "m/s", "9.0 s", "estimate", "default robot"):
        assert word in said


def test_a_plan_that_runs_unattended_says_so_in_every_form() -> None:
    content = {"unattended": True, "segment": [{"duration_s": 1.0, "effort": 0.2}]}
    plan = parse_plan(content, "alone", "here")
    assert plan.unattended
    assert plan.to_dict()["unattended"] is True
    assert tomllib.loads(plan.to_toml())["unattended"] is True
    with pytest.raises(PlanError, match="unattended: must be true or false"):
        parse_plan({**content, "unattended": 1}, "alone", "here")
    assert "unattended" not in load_plan("paper/I").to_dict()
