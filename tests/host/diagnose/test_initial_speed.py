"""Runs that were cut off in motion: a first row is no measurement of the speed that a free run starts at."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import truing
from support import recorded_sets
from truing.cli import group
from truing.diagnose.data.set_data import set_data
from truing.recording.run import RecordingSet, Run

UGLY = Path(__file__).parents[1] / "ugly"


def test_a_recording_at_its_own_noise_is_consistent(tmp_path: Path) -> None:
    """Its second drive begins in motion, two rows before a step of effort, in speeds of a few counts."""
    out = tmp_path / "robot"
    done = CliRunner().invoke(group, ["import", str(UGLY / "mocap_gaps.csv"), "--out", str(out), "--yes"])
    assert done.exit_code == 0, done.output
    recordings = truing.read(out, counts_per_rev=1440, wheel_radius_m=0.03, wheelbase_m=0.23)
    found = truing.diagnose(recordings, jobs=1)
    assert found.verdict == "consistent"
    assert found.fit.refit_rmse < 1.1 * found.noise[0].rms


@pytest.mark.parametrize("delay_rows", [0, 3])
def test_a_step_of_effort_behind_the_first_row_is_not_extended_backwards(delay_rows: int) -> None:
    interval_s, before, after = 0.04, 0.5, 0.9
    t = np.arange(60) * interval_s
    effort = np.where(np.arange(60) < 2, before, after)
    # Counts of a robot at its steady speed, whose effort steps at the start of the second interval.
    goal = recorded_sets.GAIN_MPS * np.where(np.arange(60) < 2 + delay_rows, before, after)
    keep = np.exp(-interval_s / recorded_sets.TAU_S)
    position, speed = [0.0], recorded_sets.GAIN_MPS * before
    for row in range(1, 60):
        mean = goal[row] + (speed - goal[row]) * recorded_sets.TAU_S / interval_s * (1.0 - keep)
        position.append(position[-1] + interval_s * mean)
        speed = goal[row] + (speed - goal[row]) * keep
    columns = {"t_s": t, "effort_left": effort, "effort_right": effort}
    columns |= {"pos_left_m": np.array(position), "pos_right_m": np.array(position)}
    run = Run("01_cut", columns, order=tuple(columns))
    data = set_data(RecordingSet("cut", (run,), recorded_sets.baseline()))
    assert data.initial_mps[0] == pytest.approx(recorded_sets.GAIN_MPS * before, rel=0.01)
