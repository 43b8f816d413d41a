"""A run beside its simulations, in the form of the MOM paper's Tables 2 to 4."""

from __future__ import annotations

import numpy as np
import pytest

from truing.recording.baseline import read_baseline
from truing.recording.run import Run
from truing.web.models.comparison import compare
from truing.web.models.error_model import ModelChoice
from truing.web.path.sequence_file import plan_of
from truing.web.path.trajectory import Cycle
from truing.web.pose import Pose
from web.synthetic_runs import BASELINE, TAU_S, straight_run


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
    assert x[0] == "x (m)"
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
