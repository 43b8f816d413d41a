"""Error models: what a diagnosis found becomes sliders, acts on simulated wheels, and is kept as a file."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from truing.recording.baseline import read_baseline
from truing.recording.reader import read_run
from truing.recording.run import Run
from truing.web.models.comparison import compare
from truing.web.models.error_model import (
    ModelChoice,
    diagnosed_model,
    explanations,
    load_model,
    paper_sliders,
    save_model,
)
from truing.web.models.known_robot import known_robot, robot_of
from truing.web.models.plan_rollout import plan_rollout
from truing.web.path.trajectory import Cycle, poses
from truing.web.pose import Pose
from truing.web.views.comparison import comparison_content, speed_error
from web.synthetic_runs import BASELINE, VERDICT, straight_run, synthetic_set


def test_each_number_of_a_diagnosis_is_a_knob_around_its_interval():
    choice, sliders = diagnosed_model(VERDICT)
    assert choice.kind == "found"
    assert choice.effects == {"coulomb_friction": {"left": 0.05, "right": 0.05}}
    assert choice.numbers == {"gain_left": 1.4}
    assert [slider.interval for slider in sliders] == [(0.04, 0.06), (0.04, 0.06), (1.38, 1.42)]
    assert all(
        slider.low <= slider.interval[0] < slider.interval[1] <= slider.high
        for slider in sliders
        if slider.interval
    )
    assert all(slider.low >= 0.0 for slider in sliders)


def test_of_two_explanations_one_is_chosen():
    verdict = copy.deepcopy(VERDICT)
    other = copy.deepcopy(verdict["effects"][0]) | {"name": "driver_deadband", "explanation": 1}
    verdict["effects"].append(other)
    assert explanations(verdict) == [(0, "coulomb friction"), (1, "driver deadband")]
    assert set(diagnosed_model(verdict)[0].effects) == {"coulomb_friction"}
    assert set(diagnosed_model(verdict, 1)[0].effects) == {"driver_deadband"}


def test_the_papers_constants_can_be_turned():
    adjusted = ModelChoice("paper").with_value("paper.straight", -0.3)
    assert adjusted.motion.straight == -0.3
    assert ModelChoice("none").motion.straight == 0.0
    straight = next(slider for slider in paper_sliders(adjusted.paper) if slider.key == "paper.straight")
    assert straight.value == -0.3
    # What Table 2 implies: DESIGN's own figure.
    assert straight.interval == pytest.approx((-0.315, -0.2635), abs=5e-4)


def test_a_model_is_kept_and_is_a_baseline_too(tmp_path):
    (tmp_path / "baseline.toml").write_text(BASELINE)
    choice = diagnosed_model(VERDICT)[0].with_value("effect.coulomb_friction.left", 0.07)
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
    runs = [read_run(path) for path in sorted((synthetic_set(tmp_path / "made") / "runs").glob("*.csv"))]
    baseline = read_baseline(tmp_path / "made/baseline.toml")
    first, *more = [compare(run, baseline, None) for run in runs]
    found = comparison_content(first, more)
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
    times = np.array(found["figure"]["panels"][0]["lines"][0]["t"])
    assert times[-1] == pytest.approx(6.0)


def test_what_was_found_acts_on_control_inputs_that_a_controller_holds():
    known = robot_of(known_robot({}))
    cycles = [Cycle(min(0.1 * k, 0.5), 0.0) for k in range(1, 40)] + [
        Cycle(0.5 - 0.1 * k, 0.0) for k in range(1, 6)
    ]
    desired = poses(Pose(0.5, 0.5, 0.0), cycles)[-1]

    def end(**effects):
        model = ModelChoice("found", effects=effects)
        return plan_rollout(cycles, known, model.applied(known), Pose(0.5, 0.5, 0.0))[-1]

    plain = end()
    assert np.hypot(plain[0] - desired.x_m, plain[1] - desired.y_m) < 0.02
    way = desired.x_m - 0.5
    # What no encoder sees bends the path as it is.
    drifted = end(heading_drift={"drift": -0.3, "distance_scale": 0.0})
    assert drifted[2] == pytest.approx(-0.3 * way, rel=0.05)
    # What acts on the wheels is what the controller leaves of it: 0.05 of effort is 0.075 m/s.
    slowed = end(coulomb_friction={"left": 0.05, "right": 0.05})
    assert 0.005 < plain[0] - slowed[0] < 0.3 * 0.075 * 4.4
    # Beyond the effort's end no controller helps.
    assert end(speed_limit={"limit": 0.3})[0] < 0.5 + 0.3 * 5.5


def test_charge_that_earlier_runs_drew_is_missing_in_a_later_one(tmp_path):
    folder = synthetic_set(tmp_path / "made")
    baseline = read_baseline(folder / "baseline.toml")
    runs = [read_run(path) for path in sorted((folder / "runs").glob("*.csv"))]
    tired = ModelChoice("found", effects={"supply_sag": {"drop_at_stall": 0.0, "drop_over_set": 0.2}})

    def way(run, whole):
        found = compare(run, baseline, None, tired, set_runs=lambda: whole)
        assert found.modelled is not None
        return found.modelled.end.x_m, found.notes

    # By itself a run draws the set's whole charge in its own course: wrong for the first and the last.
    assert way(runs[0], runs)[0] > way(runs[0], [])[0] + 0.02
    alone, _ = way(runs[2], [])
    among, notes = way(runs[2], runs)
    assert among < alone - 0.02
    assert not any("charge" in note for note in notes)
    without = {name: values for name, values in runs[1].columns.items() if "vel" not in name}
    broken, notes = way(runs[2], [runs[0], Run("other", without), runs[2]])
    assert broken == pytest.approx(alone)
    assert any("charge" in note for note in notes)
