"""The printed models, and models of one run judged on another; the paper's commands on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from support.cli import truing_within
from support.first_order_robot import BASELINE, TEST_XI, FirstOrderRobot
from truing.errors import IdentifyError
from truing.model.linear import StateSpaceModel
from truing.recording.run import RecordingSet
from truing.studies.bakirci_models import (
    PRINTED_39,
    PRINTED_40,
    ModelStudy,
    printed_39_on_xvii,
    printed_models,
    rise_time_s,
    study_models,
)


def test_forty_cannot_be_right_it_repeats_the_matrices_of_thirty_nine() -> None:
    assert np.array_equal(PRINTED_39.a, PRINTED_40.a)
    assert np.array_equal(PRINTED_39.b, PRINTED_40.b)
    eq39, eq40 = printed_models()
    assert eq39.gain == pytest.approx(14.32, abs=0.01)
    assert eq40.gain == pytest.approx(9.15, abs=0.01)
    assert eq40.table_gain == pytest.approx(1.047, abs=0.001)


def test_thirty_nine_carries_over_to_the_gains_printed_for_xvii_and_misses_most_at_fifteen_per_cent() -> None:
    errors = dict(printed_39_on_xvii())
    assert max(errors, key=lambda effort: abs(errors[effort])) == 0.15
    assert errors[0.15] == pytest.approx(14.3213 / 13.338 - 1.0, abs=1e-4)


def test_the_rise_of_a_model_is_read_off_its_step() -> None:
    pole = float(np.exp(-0.05 / 0.4))
    slow = StateSpaceModel(np.array([[pole]]), np.array([1.0 - pole]), np.array([2.0]), np.zeros(1), 0.05)
    assert rise_time_s(slow) == pytest.approx(0.4, abs=0.002)
    assert rise_time_s(PRINTED_39) < 0.25 < printed_models()[0].table_tau_s


def staircase(*levels: float) -> tuple[tuple[float, float], ...]:
    return ((1.0, 0.0), *((2.0, level) for level in levels), (2.0, 0.0))


@pytest.fixture(scope="module")
def driven() -> RecordingSet:
    robot = FirstOrderRobot(disturbance=0.005)
    runs = (
        robot.drive(TEST_XI, name="11_XI", seed=11),
        robot.drive(staircase(0.35, 0.50, 0.45), name="15_XV", seed=15, mode="velocity"),
        robot.drive(staircase(0.45, 0.60, 0.55), name="16_XVI", seed=16, mode="velocity"),
        robot.drive(staircase(0.25, 0.40, 0.30, 0.35, 0.15, 0.60), name="17_XVII", seed=17),
    )
    return RecordingSet("paper", runs, BASELINE)


@pytest.fixture(scope="module")
def study(driven: RecordingSet) -> ModelStudy:
    return study_models(driven)


def errors(study: ModelStudy, judged_on: str, said: str) -> list[float]:
    found = [e.mean_percent for e in study.exercises if (e.judged_on, e.input) == (judged_on, said)]
    assert len(found) >= 3
    return found


def test_a_linear_robots_effort_model_carries_over_to_a_run_it_never_saw(study: ModelStudy) -> None:
    for exercise in study.exercises:
        if exercise.fitted_to == "XI" and exercise.judged_on == "XVII":
            assert not exercise.seen
            assert exercise.mean_percent < 2.0


def test_a_velocity_model_carries_over_and_fails_on_an_effort_only_because_of_its_unit(
    study: ModelStudy,
) -> None:
    assert max(errors(study, "XVI", "velocity")) < 2.0
    assert min(errors(study, "XVII", "per cent as mm/s")) > 40.0
    assert max(errors(study, "XVII", "effort × gain of XI")) < 2.0


def test_a_set_without_the_papers_tests_is_refused_by_name(driven: RecordingSet) -> None:
    with pytest.raises(IdentifyError, match="no run of test XV, XVI, XVII"):
        study_models(RecordingSet("one", driven.runs[:1], BASELINE))


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ("gains", ("+ pivot scrub", "13.338", "Left out", "Unexplained")),
        ("mom", ("3.156", "349.611", "-0.315", "Tables 3 and 4 cannot be replayed")),
    ],
)
def test_what_needs_no_board_prints_draws_and_writes_its_tables(
    part: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    done = truing_within("paper", part, "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    for word in words:
        assert word in done.stdout
    assert (tmp_path / f"{part}.png").read_bytes().startswith(b"\x89PNG")
    assert "," in (tmp_path / f"{part}.csv").read_text("utf-8")


@pytest.mark.parametrize("part", ["gains", "mom"])
def test_the_same_comes_as_one_json_value(part: str, tmp_path: Path) -> None:
    tree = json.loads(truing_within("paper", part, "--out", str(tmp_path), "--json").stdout)
    assert ("ladder" if part == "gains" else "replays") in tree


def test_models_without_driven_tests_say_how_to_drive_them(tmp_path: Path) -> None:
    done = truing_within("paper", "models", TRUING_OUT=str(tmp_path))
    assert done.returncode == 2
    assert "truing paper" in done.stderr
    assert "Traceback" not in done.stderr
