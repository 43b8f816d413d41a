"""Public recordings are read by one command with at most one question, as a new user would try it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from support.public_sets import PUBLIC_SETS
from truing.cli import group
from truing.cli.app import App
from truing.cli.import_dialogue import QUESTION
from truing.diagnose.diagnosis_input import Options
from truing.diagnose.engine import analyse, diagnose
from truing.recording.axis import Axis
from truing.recording.reader import read_recording_set
from truing.studies.real.drivetrains import read_drivetrain
from truing.studies.real.mrclam import FULL_SPEED_MPS
from truing.studies.real.row_set import judged_rows

pytestmark = pytest.mark.recordings

AXES = {"emps": Axis("translation"), "odrive": Axis("rotation")}


def run(*arguments: object, answers: str | None = None) -> Result:
    return CliRunner().invoke(group, [str(a) for a in arguments], input=answers)


def files_of(recordings: Path, name: str) -> list[Path]:
    files = PUBLIC_SETS[name].paths(recordings)
    for file in files:
        if not file.exists():
            pytest.skip(f"{file} is not there; docs/howto/public_sets.md says where it comes from")
    return files


@pytest.mark.parametrize("name", PUBLIC_SETS)
def test_a_public_set_is_read_by_one_command_with_at_most_one_question(
    name: str, recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(App, "asks", property(lambda self: True))
    files_of(recordings, name)
    one = PUBLIC_SETS[name]
    result = run(*one.arguments(recordings, tmp_path / "set"), answers=one.answers)
    assert result.exit_code == 0, result.output
    assert result.output.count(QUESTION) == (0 if one.answers is None else one.answers.count("\n"))
    read = read_recording_set(tmp_path / "set")
    assert len(read.runs) == one.runs
    if name in AXES:
        assert read.axis == AXES[name]


def test_the_axis_of_a_controller_that_moves_is_taken_of_four(recordings: Path, tmp_path: Path) -> None:
    files = files_of(recordings, "odrive")
    said = run("import", *files, "--out", tmp_path / "set", "--yes")
    assert said.exit_code == 0, said.output
    assert "of axes 0, 1, 2, 3: 2, which moves furthest, is taken" in said.output
    assert "a current, full effort taken as" in said.output
    lifted = {each.name.split("_")[-1][:2]: each for each in read_recording_set(tmp_path / "set")}
    # Gravity keeps the current's sign whichever way the load goes: no file is turned round by itself.
    assert np.median(lifted["up"].effort("left")) * np.median(lifted["do"].effort("left")) > 0.0


def test_mrclams_delay_and_scale_come_out_of_the_imported_files(recordings: Path, tmp_path: Path) -> None:
    """As `truing.studies.real.mrclam` has them, which reads the files by code of its own."""
    files_of(recordings, "mrclam")
    out = tmp_path / "set"
    arguments = PUBLIC_SETS["mrclam"].arguments(recordings, out)
    said = run(*arguments, "--set", "to_s=300; rate_hz=20", "--yes")
    assert said.exit_code == 0, said.output
    assert f"next: truing diagnose {out} --commanded" in said.output
    # The verdict without the next experiment, which test_real_recordings.py has of the same robot.
    done = analyse(read_recording_set(out), jobs=1, commanded=True)
    delay = next(effect for effect in done.effects if effect.name == "input_delay").parameters["delay"]
    assert 0.05 < delay.ci95[0] < delay.ci95[1] < 0.2
    gains = [entry.with_effects.value for entry in done.numbers if entry.name == "gain_mps"]
    assert all(0.93 < gain / FULL_SPEED_MPS < 0.97 for gain in gains)


def test_romis_noisy_speeds_are_as_good_as_plain_least_squares(recordings: Path, tmp_path: Path) -> None:
    """Its noise is as large as its errors: positions beside the speeds are evidence of their filter."""
    files_of(recordings, "romi")
    assert run(*PUBLIC_SETS["romi"].arguments(recordings, tmp_path / "set"), "--yes").exit_code == 0
    read = read_drivetrain(tmp_path / "set")
    done = diagnose(read, Options(jobs=1))
    assert {"speed_filter", "driver_deadband"} <= {effect.name for effect in done.effects}
    top = judged_rows(read, done).top_mps
    # The best rung of the ladder (a delay and a filter): 5.75 % fitted, 5.91 % on runs left out.
    assert done.fit.model_rmse / top < 1.05 * 0.0575
    assert done.fit.heldout_model_rmse / top < 1.05 * 0.0591
