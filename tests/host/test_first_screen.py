"""Three lines come first: what the robot does, what the simulation lacks, what to do next; in plain words."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import truing
from support import diagnoses
from support.recorded_sets import recordings
from truing.cli import app as cli_app
from truing.cli import group
from truing.diagnose.present.page import render_report
from truing.diagnose.present.text import sections, wrapped
from truing.diagnose.result import Compensation, Diagnosis
from truing.recording.run import RunMetadata
from truing.recording.wheel_text import wheels_text

EXAMPLE = Path(__file__).parents[2] / "docs/example"
# Words of the method, of the papers and of other trades.
JARGON = re.compile(
    r"\bnats\b|\bcontract\b|\bbends\b|Table I|of the noise\b|nuisance|whitened", re.IGNORECASE
)
VERDICTS = [
    diagnoses.missing_physics,
    diagnoses.partly_explained,
    diagnoses.ambiguous,
    diagnoses.parameters_only,
    diagnoses.consistent,
    diagnoses.unexplained,
]


def first_screen(diagnosis: Diagnosis) -> list[str]:
    return list(sections(diagnosis)[0].lines)


@pytest.mark.parametrize("make", VERDICTS)
def test_every_verdict_begins_with_robot_simulation_and_next_step(make) -> None:
    robot, simulation, following = first_screen(make())
    assert robot.startswith("The robot: 1.")
    assert "m/s" in robot
    assert "350 ms" in robot
    assert "mm/s" in simulation
    assert "noise" in simulation
    assert following.startswith("Next: ")
    # On a screen of 100 columns none of them takes more than two lines.
    assert len(list(wrapped(sections(make())[:1]))) <= 2 + 3 * 2


def test_the_second_line_says_what_the_missing_effect_brings_on_runs_left_out() -> None:
    made = diagnoses.missing_physics()
    fit = replace(made.fit, heldout_refit_rmse=0.045, heldout_model_rmse=0.013)
    _, simulation, _ = first_screen(replace(made, fit=fit))
    assert "dry friction" in simulation
    assert "With it the error on runs left out of the fit falls from 45 to 13 mm/s" in simulation
    fit = replace(made.fit, heldout_refit_rmse=np.nan, heldout_model_rmse=np.nan)
    _, simulation, _ = first_screen(replace(made, fit=fit))
    assert "With it the error falls from 43 to 12 mm/s" in simulation


def test_a_board_is_spoken_of_only_to_who_has_one() -> None:
    found = replace(diagnoses.missing_physics(), compensation=Compensation({"ff_ks_left": 0.02}))
    own = recordings(2)
    logged = replace(
        own, runs=tuple(replace(run, metadata=RunMetadata(firmware={"version": "0.1"})) for run in own.runs)
    )
    for runs, board in ((own, False), (logged, True)):
        text = "\n".join(wrapped(sections(replace(found, recordings=runs))))
        assert ("params" in text) == board
        page = render_report(runs, found)
        assert ("Values for the board" in page) == board
    assert "params" in "\n".join(wrapped(sections(found, board=True)))


@pytest.mark.parametrize("make", VERDICTS)
def test_text_and_page_have_no_jargon(make) -> None:
    made = make()
    noted = [replace(entry, note="changes a signal by 6.21 of the noise") for entry in made.ranking]
    made = replace(made, ranking=tuple(noted))
    assert not JARGON.search("\n".join(wrapped(sections(made, board=True))))
    page = render_report(recordings(4), made, board=True)
    visible = re.sub(r"<script.*?</script>|<style.*?</style>", "", page, flags=re.S)
    assert not JARGON.search(visible)


def test_identify_and_fit_begin_with_three_lines_too() -> None:
    for command, missing in (
        ("identify", "the gain of small steps is"),
        ("fit", "lacks dry friction: with it"),
    ):
        result = CliRunner().invoke(group, [command, str(EXAMPLE)], catch_exceptions=False)
        lines = result.stdout.splitlines()
        assert lines[0].startswith("The robot: 1."), command
        assert missing in lines[1], command
        assert lines[2].startswith("Next: "), command
        assert f"truing {'fit' if command == 'identify' else 'diagnose'} {EXAMPLE}" in lines[2]
        assert lines[3] == ""
        assert not JARGON.search(result.stdout)


def test_results_in_python_begin_with_the_same_lines() -> None:
    example = truing.read(EXAMPLE)
    for found in (truing.identify(example), truing.fit(example)):
        assert str(found).startswith("The robot: 1.")


def test_a_wheel_that_does_not_tell_its_gain_is_said_to_be_unknown() -> None:
    still = recordings(2, lambda _, columns: columns.update(effort_left=0.0 * columns["effort_left"]))
    text = str(truing.identify(still))
    assert "(right wheel) at full effort" in text.splitlines()[0]


@pytest.mark.parametrize(
    ("values", "unit", "said"),
    [
        ({"left": 1.401, "right": 1.399}, "m/s", "1.4 m/s"),
        ({"left": 1.401, "right": 1.36}, "m/s", "1.4 / 1.36 m/s (left / right)"),
        ({"left": 0.1381, "right": 0.14}, "s", "138 / 140 ms (left / right)"),
        ({"right": 2.0}, "s", "2 s (right wheel)"),
    ],
)
def test_numbers_of_wheels_are_said_once_where_they_agree(values, unit: str, said: str) -> None:
    assert wheels_text(values, unit, sides=True) == said


def test_a_pipe_is_told_the_progress_in_lines_with_the_time_left() -> None:
    said: list[str] = []
    now = [0.0]
    lines = cli_app.ProgressLines("fitting", said.append, clock=lambda: now[0])
    for second in range(1, 40):
        now[0] = float(second)
        lines(second / 40)
    assert said[0] == "fitting: 12 %, about 35 s left"
    assert len(said) == 7
    now[0] = 400.0
    lines(0.1)
    assert said[-1].endswith("about 60 min left")
