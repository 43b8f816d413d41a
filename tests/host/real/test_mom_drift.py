"""The MOM paper's drift is found in runs made from its constants, and its real end is met better."""

from __future__ import annotations

from functools import cache

import pytest

from truing.diagnose.present.text import sections
from truing.studies.mom_odometry import PAPER_MODEL
from truing.studies.real.mom import constants_runs, end_run
from truing.studies.real.study import DriftStudy, study_drift


@cache
def study() -> DriftStudy:
    return study_drift(lambda share: None)


def test_heading_drift_alone_is_named_in_runs_made_from_the_papers_constants() -> None:
    diagnosis = study().diagnosis
    assert diagnosis.verdict == "missing_physics"
    assert [effect.name for effect in diagnosis.effects] == ["heading_drift"]


def test_the_papers_constants_come_out_again() -> None:
    found = study().diagnosis.effects[0].parameters
    assert found["drift"].value == pytest.approx(PAPER_MODEL.straight, abs=0.002)
    assert found["distance_scale"].value == pytest.approx(PAPER_MODEL.scale, abs=0.002)
    for name, true in (("drift", PAPER_MODEL.straight), ("distance_scale", PAPER_MODEL.scale)):
        low, high = found[name].ci95
        assert low - 5e-4 <= true <= high + 5e-4


def test_the_drift_lowers_the_error_on_runs_that_were_left_out() -> None:
    effect = study().diagnosis.effects[0]
    assert effect.unit == "m"
    assert effect.heldout_rmse_after < 0.1 * effect.heldout_rmse_before


def test_a_command_held_against_a_pose_says_nothing_of_wheels() -> None:
    diagnosis = study().diagnosis
    assert diagnosis.mismatch
    assert not [span.signal for span in diagnosis.mismatch if span.signal.startswith("vel_")]
    assert not diagnosis.recorder
    said = "\n".join(line for part in sections(diagnosis) for line in part.lines)
    assert "Error of the pose over short windows" in said
    assert "wheels' speeds" not in said


def test_the_printed_real_end_is_met_better_than_by_the_papers_constants() -> None:
    commanded, paper, found, fitted = study().ends
    assert paper.distance_m == pytest.approx(0.202, abs=0.002)
    assert found.distance_m == pytest.approx(paper.distance_m, abs=0.005)
    assert fitted.distance_m < 0.05 * paper.distance_m
    assert abs(fitted.heading_deg) < 1.0 < abs(paper.heading_deg)
    assert paper.distance_m < commanded.distance_m


def test_the_real_end_implies_the_known_drift_and_scale() -> None:
    fitted = study().ends[-1]
    assert fitted.drift == pytest.approx(-0.315, abs=0.002)
    assert fitted.scale == pytest.approx(0.067, abs=0.001)


def test_made_runs_start_at_zero_and_drive_the_commanded_line() -> None:
    runs = constants_runs().runs
    assert len(runs) == 5
    for run in runs:
        assert [run.columns[name][0] for name in ("t_s", "x_m", "y_m", "theta_rad")] == [0.0] * 4
        assert (run.effort("left")[:5] == 0.0).all()
    line = end_run().runs[0]
    driven = float((line.effort("left") * 0.1).sum())
    assert driven == pytest.approx(2.79, abs=0.001)
