"""Public recordings are read by one command with at most one question, as a new user would try it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from truing.cli import group
from truing.cli.app import App
from truing.cli.import_dialogue import QUESTION
from truing.diagnose.diagnosis_input import Options
from truing.diagnose.engine import diagnose
from truing.recording.axis import Axis
from truing.recording.reader import read_recording_set
from truing.studies.real.mrclam import FULL_SPEED_MPS, WHEELBASE_M

pytestmark = pytest.mark.recordings

MRCLAM = "mrclam/D6_Robot1_Odometry.dat.gz"
POSE = "mrclam/D6_Robot1_Groundtruth.dat.gz"
# Files under raw/, what the user adds, the answers (none: no question), and the runs that come out.
SETS: dict[str, tuple[tuple[str, ...], tuple[str, ...], str | None, int]] = {
    "armada2508": (("armada2508/data20200509-1153.json.gz",), (), None, 4),
    "frc2881": (("frc2881/sysid_data20220227-150426.json.gz",), (), None, 4),
    "frc5024": (("frc5024/MinibotCarpet20200124-1730.json.gz",), (), None, 4),
    "team4099": (("team4099/CharacterizationTestOutput.json.gz",), (), None, 4),
    "romi": (("romi/FRC_20250321_153530.wpilog",), (), None, 4),
    "romi table": (("romi/romi_sysid.csv",), (), "\n", 4),
    "emps": (("emps/DATA_EMPS.mat",), (), "\n", 1),
    # What effort its modes stand for is written in its author's notes alone.
    "micromouse": (
        ("micromouse/encoders3.csv",),
        (),
        "effort = leftMode / 4 * 100 / 255\n\n",
        1,
    ),
    "micromouse map": (("micromouse/wheelSpeedCalibration5.csv",), ("--wheel-radius", "0.016"), "\n", 1),
    "mrclam": ((MRCLAM,), ("--wheelbase", str(WHEELBASE_M), "--full-speed", str(FULL_SPEED_MPS)), "\n", 1),
    "odrive": (
        tuple(f"odrive/{way}{speed}.csv" for way in ("Down", "Up") for speed in ("1", "4")),
        (),
        "\n",
        4,
    ),
}
AXES = {"emps": Axis("translation"), "odrive": Axis("rotation")}


def run(*arguments: object, answers: str | None = None) -> Result:
    return CliRunner().invoke(group, [str(a) for a in arguments], input=answers)


def files_of(recordings: Path, names: tuple[str, ...]) -> list[Path]:
    files = [recordings / "raw" / name for name in names]
    for file in files:
        if not file.exists():
            pytest.skip(f"{file} is not there; docs/howto/public_sets.md says where it comes from")
    return files


def imported(recordings: Path, name: str, out: Path) -> Result:
    names, options, answers, _ = SETS[name]
    files = files_of(recordings, names)
    if name == "mrclam":
        options = (*options, "--pose", str(files_of(recordings, (POSE,))[0]))
    return run("import", *files, "--out", out, *options, answers=answers)


@pytest.mark.parametrize("name", SETS)
def test_a_public_set_is_read_by_one_command_with_at_most_one_question(
    name: str, recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(App, "asks", property(lambda self: True))
    result = imported(recordings, name, tmp_path / "set")
    assert result.exit_code == 0, result.output
    *_, answers, runs = SETS[name]
    # A line that changes the proposal is followed by Enter, which takes it.
    assert result.output.count(QUESTION) == (0 if answers is None else answers.count("\n"))
    read = read_recording_set(tmp_path / "set")
    assert len(read.runs) == runs
    if name in AXES:
        assert read.axis == AXES[name]


def test_the_axis_of_a_controller_that_moves_is_taken_of_four(recordings: Path, tmp_path: Path) -> None:
    files = files_of(recordings, SETS["odrive"][0])
    said = run("import", *files, "--out", tmp_path / "set", "--yes")
    assert said.exit_code == 0, said.output
    assert "of axes 0, 1, 2, 3: 2, which moves furthest, is taken" in said.output
    assert "a current, full effort taken as" in said.output
    lifted = {each.name.split("_")[-1][:2]: each for each in read_recording_set(tmp_path / "set")}
    # Gravity keeps the current's sign whichever way the load goes: no file is turned round by itself.
    assert np.median(lifted["up"].effort("left")) * np.median(lifted["do"].effort("left")) > 0.0


def test_mrclams_delay_and_scale_come_out_of_the_imported_files(recordings: Path, tmp_path: Path) -> None:
    """As `truing.studies.real.mrclam` has them, which reads the files by code of its own."""
    names, options, *_ = SETS["mrclam"]
    (log,), (pose,) = files_of(recordings, names), files_of(recordings, (POSE,))
    out = tmp_path / "set"
    rows = ("--set", "to_s=300; rate_hz=20")
    said = run("import", log, "--pose", pose, "--out", out, *options, *rows, "--yes")
    assert said.exit_code == 0, said.output
    assert f"next: truing diagnose {out} --commanded" in said.output
    done = diagnose(read_recording_set(out), Options(commanded=True))
    delay = next(effect for effect in done.effects if effect.name == "input_delay").parameters["delay"]
    assert 0.05 < delay.ci95[0] < delay.ci95[1] < 0.2
    gains = [entry.with_effects.value for entry in done.numbers if entry.name == "gain_mps"]
    assert all(0.93 < gain / FULL_SPEED_MPS < 0.97 for gain in gains)
