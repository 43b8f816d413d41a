"""What no effect explains is learned as a shape, judged on runs left out, and stays bounded."""

from __future__ import annotations

import importlib.util
import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from support import diagnoses
from support.recorded_sets import recordings
from support.simulated_runs import noisy_robot
from truing.diagnose.engine import initial_fit
from truing.diagnose.learned.describe import resemblances, sentence
from truing.diagnose.learned.learner import learned_correction
from truing.diagnose.learned.result import LearnedCorrection
from truing.diagnose.learned.skeleton import write_skeleton
from truing.diagnose.present.page import render_report
from truing.diagnose.present.text import learned_lines
from truing.diagnose.result import Diagnosis
from truing.diagnose.simulation.simulator import SetSimulator
from truing.errors import IdentifyError
from truing.model.correction import Correction, Rows, Term, corrected_speeds, limited

NOISE_MPS = 0.004
SCHEMA = Path(__file__).resolve().parents[3] / "docs" / "verdict.schema.json"


def learned_from(hidden: dict[str, dict[str, float]]) -> LearnedCorrection:
    """What is learned beside gain and time constant from a robot that hides an effect."""
    rng = np.random.default_rng(3)
    efforts = tuple(np.repeat(rng.uniform(-1.0, 1.0, (12, 2)), 20, axis=0) for _ in range(6))
    data = noisy_robot(efforts, hidden, NOISE_MPS, 5)
    stage = initial_fit(data, SetSimulator(data, data.baseline))
    return learned_correction(stage.problem, (stage.base,))


@pytest.fixture(scope="module")
def drag() -> LearnedCorrection:
    """A robot with drag that grows with the square of the speed, and no catalogue."""
    return learned_from({"quadratic_drag": {"left": 0.3, "right": 0.3}})


def diagnosis_with(learned: LearnedCorrection) -> Diagnosis:
    return replace(diagnoses.unexplained(), learned=learned)


def test_a_hidden_drag_is_learned_down_to_the_noise_on_runs_left_out(drag: LearnedCorrection) -> None:
    assert drag.heldout_before > 3.0 * NOISE_MPS
    assert drag.heldout_after < 1.5 * NOISE_MPS
    first = drag.terms[0].term
    assert (first.place, first.variable) == ("friction", "speed")
    assert all(wide > 0.0 for wide in first.left_band)


def test_the_robot_without_anything_hidden_teaches_nothing() -> None:
    found = learned_from({})
    assert found.correction is None
    assert found.to_json() is None
    diagnosis = diagnosis_with(found)
    assert "what is left is noise" in learned_lines(diagnosis)[0]
    quiet = replace(diagnosis, fit=replace(diagnosis.fit, noise_floor=0.2 * found.heldout_before))
    assert "what is left is no noise" in learned_lines(quiet)[0]


def test_text_page_and_verdict_hold_the_learned_shape(drag: LearnedCorrection) -> None:
    diagnosis = diagnosis_with(drag)
    assert drag.terms[0].sentence in learned_lines(diagnosis)
    page = render_report(recordings(), diagnosis)
    assert "What is learned" in page
    assert "learned-0" in page
    jsonschema.validate(diagnosis.to_json(), json.loads(SCHEMA.read_text(encoding="utf-8")))
    table = diagnosis.to_json()["left_over"]["learned"]
    assert Correction.from_dict(table) == drag.correction
    assert table["beside_effects"] == []


def test_any_lookups_give_a_bounded_free_run() -> None:
    rng = np.random.default_rng(7)
    effort = np.repeat(rng.uniform(-1.0, 1.0, (200, 2)), 20, axis=0)
    rows = Rows(np.array([0, len(effort)]), np.full(len(effort), 0.02), effort, False)
    base = np.zeros_like(effort)
    grid = tuple(np.linspace(-1.0, 1.0, 9).tolist())
    two_sided = (*np.linspace(-1.0, 0.0, 5).tolist(), *np.linspace(0.0, 1.0, 5).tolist())
    for _ in range(40):
        values = rng.normal(0.0, 3.0, (5, 2, 10))
        terms = (
            Term("friction", "speed", 0.0, two_sided, (), ()).with_values(values[0]),
            Term("inertia", "speed", 0.0, two_sided, (), ()).with_values(values[1]),
            Term("force", "speed_difference", 0.0, grid, (), ()).with_values(values[2, :, :9]),
            Term("force", "net_effort", 0.0, grid, (), ()).with_values(values[3, :, :9]),
        )
        drags = tuple(rng.normal(0.0, 5.0, 2).tolist())
        found = limited(Correction((1.2, 0.9), (0.3, 0.1), terms, (0.3, -0.2), (drags[0], drags[1])))
        speeds = corrected_speeds(found, rows, base)
        assert np.isfinite(speeds).all()
        assert np.abs(speeds).max() < 500.0


def test_friction_that_is_learned_holds_a_wheel_exactly_at_rest() -> None:
    effort = np.full((100, 2), 0.08)
    rows = Rows(np.array([0, 100]), np.full(100, 0.02), effort, True)
    settling = 0.08 * (1.0 - np.exp(-0.02 * np.arange(100) / 0.3))[:, None] * np.ones(2)
    grid = (-1.0, 0.0, 0.0, 1.0)
    term = Term("friction", "speed", 0.0, grid, (0.1,) * 4, (0.05,) * 4)
    speeds = corrected_speeds(Correction((1.0, 1.0), (0.3, 0.3), (term,)), rows, settling)
    assert not speeds[:, 0].any(), "an effort of 0.08 does not overcome a friction of 0.1"
    assert speeds[-1, 1] == pytest.approx(0.03, abs=2e-3)


@pytest.mark.parametrize(
    ("term", "said", "known"),
    [
        (
            Term("friction", "run_time", 0.0, tuple(range(10)), (0, 0, 0, 9, 9, 9, 0, 0, 0, 0), (0,) * 10),
            "appears between 2.5 and 5.5 s of a run",
            "",
        ),
        (
            Term("force", "effort", 0.0, (-1, -0.5, 0, 0.5, 1), (-4, -1, 0, 1, 4), (-4, -1, 0, 1, 4)),
            "grows with the square of the wheel's own effort",
            "a driver whose output goes with the square",
        ),
        (
            Term("force", "ahead", 0.0, (-1, 0, 1), (2, 0, -2), (1, 0, -1)),
            "is proportional to the distance from the start",
            "a spring to where the run began",
        ),
        (
            Term("force", "angle_repeating", 0.071, (0, 0.02, 0.05, 0.071), (0, 1, -1, 0), (0, 1, -1, 0)),
            "repeats every 71 mm of travel",
            "",
        ),
    ],
)
def test_shapes_are_said_in_the_fields_words(term: Term, said: str, known: str) -> None:
    assert said in sentence(term)
    if known:
        assert resemblances(term)[0].physics == known


def test_a_learned_shape_becomes_a_file_of_the_catalogue(drag: LearnedCorrection, tmp_path: Path) -> None:
    path = tmp_path / "some_drag.py"
    write_skeleton(drag, path)
    spec = importlib.util.spec_from_file_location("some_drag", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    term = drag.terms[0].term
    assert module.EFFECT.name == "some_drag"
    for speed, values in ((0.9 * term.grid[-1], term.values()), (0.5 * term.grid[-1], term.values())):
        wanted = np.mean(
            [np.interp(speed, term.grid[len(term.grid) // 2 :], v[len(v) // 2 :]) for v in values]
        )
        assert module.friction(1.0, speed, 1.0) == pytest.approx(wanted, abs=1e-4)
        assert module.friction(0.0, speed, 1.0) == 0.0


def test_without_a_learned_term_there_is_no_file(tmp_path: Path) -> None:
    nothing = LearnedCorrection(None, (), 0.01, 0.01, 0.01, 0.01)
    with pytest.raises(IdentifyError, match="no learned term"):
        write_skeleton(nothing, tmp_path / "nothing.py")
    assert not (tmp_path / "nothing.py").exists()
