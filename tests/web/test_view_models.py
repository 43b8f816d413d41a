"""Error models: what a diagnosis found becomes sliders, acts on simulated wheels, and is kept as a file."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from truing.baseline import read_baseline
from truing.errors import FileError
from truing.recording_reader import read_run
from truing.web.comparison import compare
from truing.web.comparison_view import shown, speed_error
from truing.web.dropped_files import keep
from truing.web.error_model import (
    ModelChoice,
    explanations,
    found_choice,
    load_model,
    paper_knobs,
    read_verdict,
    save_model,
)
from web.made_runs import BASELINE, VERDICT, made_set, straight_run


def test_each_number_of_a_diagnosis_is_a_knob_around_its_interval():
    choice, knobs = found_choice(VERDICT)
    assert choice.kind == "found"
    assert choice.effects == {"coulomb_friction": {"left": 0.05, "right": 0.05}}
    assert choice.numbers == {"gain_left": 1.4}
    assert [knob.interval for knob in knobs] == [(0.04, 0.06), (0.04, 0.06), (1.38, 1.42)]
    assert all(
        knob.low <= knob.interval[0] < knob.interval[1] <= knob.high for knob in knobs if knob.interval
    )
    assert all(knob.low >= 0.0 for knob in knobs)


def test_of_two_explanations_one_is_chosen():
    verdict = copy.deepcopy(VERDICT)
    other = copy.deepcopy(verdict["effects"][0]) | {"name": "driver_deadband", "explanation": 1}
    verdict["effects"].append(other)
    assert explanations(verdict) == [(0, "coulomb friction"), (1, "driver deadband")]
    assert set(found_choice(verdict)[0].effects) == {"coulomb_friction"}
    assert set(found_choice(verdict, 1)[0].effects) == {"driver_deadband"}


def test_the_papers_constants_can_be_turned():
    turned = ModelChoice("paper").turned("paper.straight", -0.3)
    assert turned.motion.straight == -0.3
    assert ModelChoice("none").motion.straight == 0.0
    straight = next(knob for knob in paper_knobs(turned.paper) if knob.key == "paper.straight")
    assert straight.value == -0.3
    # What Table 2 implies: DESIGN's own figure.
    assert straight.interval == pytest.approx((-0.315, -0.2635), abs=5e-4)


def test_a_model_is_kept_and_is_a_baseline_too(tmp_path):
    (tmp_path / "baseline.toml").write_text(BASELINE)
    choice = found_choice(VERDICT)[0].turned("effect.coulomb_friction.left", 0.07)
    path = save_model(choice, read_baseline(tmp_path / "baseline.toml"), tmp_path / "robot.toml")
    assert load_model(path) == choice
    kept = read_baseline(path)
    assert kept.effects == {"coulomb_friction": {"left": 0.07, "right": 0.05}}
    assert kept.left.gain_mps == 1.4
    assert kept.right.gain_mps == 1.45
    assert kept.wheelbase_m == 0.283
    assert load_model(tmp_path / "none.toml") is None


def test_friction_that_was_found_slows_the_simulated_wheels(tmp_path):
    (tmp_path / "baseline.toml").write_text(BASELINE)
    baseline = read_baseline(tmp_path / "baseline.toml")
    run = straight_run(0.5)
    nothing = compare(run, baseline, None, ModelChoice("found"))
    assert nothing.simulated is not None
    assert nothing.modelled is not None
    # Two simulators of the same wheel: without effects they agree, down to how each lays out a row.
    assert nothing.modelled.end.distance_m(nothing.simulated.end) < 0.01
    slowed = compare(
        run, baseline, None, ModelChoice("found", effects={"coulomb_friction": {"left": 0.05, "right": 0.05}})
    )
    assert slowed.modelled is not None
    lost = nothing.modelled.end.x_m - slowed.modelled.end.x_m
    # 0.05 of full effort is 0.0725 m/s, over about five seconds.
    assert lost == pytest.approx(0.0725 * 5.0, rel=0.15)
    before, after = (speed_error(slowed, column) for column in (1, 2))
    assert before is not None
    assert after is not None
    assert after > before + 0.05


def test_an_effect_with_wrong_parameters_is_said(tmp_path):
    (tmp_path / "baseline.toml").write_text(BASELINE)
    from truing.errors import TruingError

    wrong = ModelChoice("found", effects={"heading_drift": {"nonsense": 1.0}})
    with pytest.raises(TruingError):
        compare(straight_run(), read_baseline(tmp_path / "baseline.toml"), None, wrong)


def test_what_a_page_draws_has_a_column_for_every_run(tmp_path):
    runs = [read_run(path) for path in sorted((made_set(tmp_path / "made") / "runs").glob("*.csv"))]
    baseline = read_baseline(tmp_path / "made/baseline.toml")
    first, *more = [compare(run, baseline, None) for run in runs]
    found = shown(first, more)
    assert len(found["head"]) == 7
    assert all(len(row) == 7 for row in found["rows"])
    assert [path["title"] for path in found["paths"]] == [
        "Simulated",
        "Real robot",
        "02_straight",
        "03_straight",
    ]
    # Wheels of 1.3 m/s against a baseline of 1.45: 0.3 m/s come out a tenth too fast.
    assert found["rms"]["simulated"] == pytest.approx(0.3 * (1.0 - 1.3 / 1.45), rel=0.2)
    times = np.array(found["figure"]["data"][0]["x"])
    assert times[-1] == pytest.approx(6.0)


def test_dropped_files_are_kept_by_what_they_are(tmp_path):
    import json

    made = made_set(tmp_path / "made")
    data = (made / "runs/01_straight.csv").read_bytes()
    dropped, diagnoses = tmp_path / "dropped", tmp_path / "diagnoses"
    assert keep("../../01_straight.csv", data, dropped, diagnoses)["path"] == str(
        dropped / "runs/01_straight.csv"
    )
    assert keep("baseline.toml", BASELINE.encode(), dropped, diagnoses)["kind"] == "baseline"
    assert keep("v.json", json.dumps(VERDICT).encode(), dropped, diagnoses)["kind"] == "diagnosis"
    assert read_verdict(diagnoses / "v.json")["name"] == "made"
    for name, bad in (
        ("x.csv", b"not a run"),
        ("x.toml", b"= ="),
        ("x.json", b"{"),
        ("y.json", b'{"verdict": 1}'),
    ):
        assert "error" in keep(name, bad, dropped, diagnoses), name
    assert not (dropped / "runs/x.csv").exists()
    assert read_baseline(dropped / "baseline.toml").left.gain_mps == 1.45
    assert not (diagnoses / "y.json").exists()
    with pytest.raises(FileError):
        read_verdict(tmp_path / "nowhere.json")
