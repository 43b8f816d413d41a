"""A run beside its simulations, in the form of the MOM paper's Tables 2 to 4."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from truing.errors import TruingError
from truing.recording.baseline import Baseline, WheelModel, read_baseline
from truing.recording.run import Run
from truing.web.models.comparison import compare
from truing.web.models.error_model import ModelChoice
from truing.web.path.sequence_file import plan_of
from truing.web.path.trajectory import Cycle
from truing.web.pose import Pose
from truing.web.views.comparison import comparison_content, comparison_csv
from web.synthetic_runs import BASELINE, TAU_S, straight_run

POSE_COLUMNS = ("x_m", "y_m", "theta_rad")


def test_stopping_points_of_a_straight_line(tmp_path):
    (tmp_path / "baseline.toml").write_text(BASELINE)
    plan = plan_of("straight", [Cycle(0.0, 0.0)] * 10 + [Cycle(0.5, 0.0)] * 50)
    found = compare(
        straight_run(),
        read_baseline(tmp_path / "baseline.toml"),
        plan,
        ModelChoice("paper"),
        Pose(0.5, 0.5, 0.0),
    )
    x, y, theta, off, _ = found.stopping_points()
    assert x[0] == "x, m"
    assert x[1] == "3.0000"
    assert y[1] == "0.5000"
    # The wheels need their time constant to get going: 0.35 s of the way at 0.5 m/s is missing.
    assert float(x[4]) == pytest.approx(3.0 - TAU_S * 0.5, abs=1e-3)
    assert float(x[2]) == pytest.approx(float(x[4]), abs=2e-3)
    assert theta[3].startswith("−37.7")  # -0.2635 rad/m over 2.5 m
    assert float(off[1]) == pytest.approx(TAU_S * 0.5, abs=1e-3)
    assert float(off[3]) > 0.5
    assert off[4] == "0.0000"
    residual = found.residual("left")
    assert residual is not None
    assert np.abs(residual).max() < 5e-3


def test_a_virtual_robot_is_called_so_and_not_real(tmp_path):
    (tmp_path / "baseline.toml").write_text(BASELINE)
    run = straight_run()
    assert run.metadata is not None
    run = replace(run, metadata=replace(run.metadata, seed=1))
    found = compare(run, read_baseline(tmp_path / "baseline.toml"), None, ModelChoice("paper"))
    content = comparison_content(found)
    assert content["head"][-1] == "Virtual robot"
    names = {line["name"] for panel in content["figure"]["panels"] for line in panel["lines"]}
    assert {"Virtual robot", "left residual", "right residual"} <= names
    assert "eal" not in "".join(names)
    assert "Real" not in comparison_csv(found).splitlines()[0]


def test_unknown_columns_are_left_empty_and_reported():
    found = compare(straight_run(), None, None)
    assert found.desired is None
    assert found.simulated is None
    assert found.stopping_points()[0][1:4] == ["–", "–", "–"]
    assert len(found.notes) == 2


def test_an_outside_pose_is_the_real_one():
    run = straight_run()
    truth = {
        "truth_x_m": run.columns["x_m"],
        "truth_y_m": 0.1 * run.columns["x_m"],
        "truth_theta_rad": run.columns["theta_rad"],
    }
    found = compare(Run("r", run.columns | truth), None, None)
    assert found.real.end.y_m == pytest.approx(0.1 * (2.5 - TAU_S * 0.5), abs=1e-3)


@pytest.mark.parametrize("kind", ["none", "paper", "found"])
def test_speeds_and_residuals_need_no_wheelbase(kind):
    made = straight_run(0.5, gain=1.3)
    columns = {name: made.columns[name] for name in made.columns if name not in POSE_COLUMNS}
    run = replace(made, columns=columns)
    bare = Baseline(Path("b"), WheelModel(1.45, 0.35), WheelModel(1.45, 0.35))
    model = ModelChoice(kind, numbers={"gain_left": 1.3, "gain_right": 1.3})
    found = compare(run, bare, None, model)
    content = comparison_content(found)
    assert content["paths"] == []
    assert any("no wheelbase" in note for note in content["notes"])
    assert content["rms"]["simulated"] == pytest.approx(0.5 * (1.0 - 1.3 / 1.45), rel=0.25)
    if kind == "found":
        assert content["rms"]["modelled"] < 0.1 * content["rms"]["simulated"]
    assert "residual, m/s" in [panel["unit"] for panel in content["figure"]["panels"]]
    head, *rows = comparison_csv(found).splitlines()
    assert "left, Real robot minus Simulated (m/s)" in head
    assert len(rows) == len(run)


def test_a_run_without_pose_and_speeds_says_what_its_set_lacks():
    made = straight_run()
    kept = ("t_s", "effort_left", "effort_right")
    run = replace(made, columns={name: made.columns[name] for name in kept})
    with pytest.raises(TruingError, match="neither a pose nor wheel speeds"):
        compare(run, None, None)
