"""Encoder counts are identified without a baseline: counts per revolution and wheel radius are enough."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from support.cli import truing_within
from truing.errors import IdentifyError, TruingError
from truing.identify.identification import identify_set
from truing.importers import read_runs
from truing.recording.baseline import RobotGeometry, read_baseline
from truing.recording.geometry import given_geometry
from truing.recording.reader import read_run
from truing.recording.writer import write_run

EXAMPLE = Path(__file__).parents[2] / "docs/example"
GIVEN = ("--counts-per-rev", "4096", "--wheel-radius", "0.0457003", "--wheelbase", "0.175603")


@pytest.fixture
def counts(tmp_path: Path) -> Path:
    """One run of time, efforts and counts alone, with no baseline beside it."""
    run = read_run(EXAMPLE / "runs/01_diagnosis_steps_from_rest.csv")
    order = ("t_s", "effort_left", "effort_right", "ticks_left", "ticks_right")
    columns = {name: run.columns[name] for name in order}
    return write_run(type(run)("run", columns, order=order), tmp_path / "run.csv")


def test_gain_and_time_constant_are_those_that_a_baseline_with_the_geometry_gives(counts: Path) -> None:
    known = read_runs(counts, EXAMPLE / "baseline.toml")
    given = read_runs(counts, geometry=given_geometry(4096, 0.0457003, 0.175603))
    assert given.baseline is None
    with_baseline, without = identify_set(known), identify_set(given)
    for wheel, fit in with_baseline.whole_fits.items():
        assert without.whole_fits[wheel].gain == fit.gain
        assert without.whole_fits[wheel].time_constant == fit.time_constant


def test_identify_writes_a_baseline_that_holds_what_it_found(counts: Path, tmp_path: Path) -> None:
    file = tmp_path / "baseline.toml"
    done = truing_within("identify", str(counts), *GIVEN, "--write-baseline", str(file))
    assert done.returncode == 0, done.stderr
    found = identify_set(read_runs(counts, geometry=given_geometry(4096, 0.0457003))).whole_fits
    baseline = read_baseline(file)
    assert baseline.robot == RobotGeometry("", 0.0457003, 0.175603, 4096)
    assert baseline.left.gain_mps == found["left"].gain.value
    assert baseline.right.time_constant_s == found["right"].time_constant.value
    assert truing_within("identify", str(counts), "--model", str(file)).returncode == 0


@pytest.mark.parametrize(("command", "option"), [("identify", "--write-baseline"), ("fit", "--out")])
def test_a_model_is_written_although_nobody_reads_what_is_printed(
    counts: Path, tmp_path: Path, command: str, option: str
) -> None:
    """As in `truing identify ... | head -1`."""
    reader, writer = os.pipe()
    os.close(reader)
    file = tmp_path / "model.toml"
    with os.fdopen(writer, "wb") as closed:
        line = [sys.executable, "-m", "truing", command, counts, *GIVEN, option, file]
        subprocess.run(line, stdout=closed, stderr=subprocess.DEVNULL, timeout=120, check=False)
    assert read_baseline(file).left.gain_mps > 0.0


def test_fit_takes_the_geometry_as_identify_does(counts: Path, tmp_path: Path) -> None:
    assert truing_within("fit", str(counts)).returncode == 2
    done = truing_within("fit", str(counts), *GIVEN, "--out", str(tmp_path / "model.toml"))
    assert done.returncode == 0, done.stderr
    assert read_baseline(tmp_path / "model.toml").wheelbase_m == 0.175603


def test_counts_without_geometry_say_which_two_numbers_are_needed(counts: Path) -> None:
    done = truing_within("identify", str(counts))
    assert done.returncode == 2
    assert str(counts) in done.stderr
    assert "--counts-per-rev" in done.stderr
    assert "--wheel-radius" in done.stderr
    half = truing_within("identify", str(counts), "--counts-per-rev", "4096")
    assert half.returncode == 2
    assert "wheel_radius_m" in half.stderr


@pytest.mark.parametrize("value", [0.0, -1.0, float("inf"), float("nan")])
def test_a_geometry_that_no_wheel_has_is_refused_by_name(value: float) -> None:
    with pytest.raises(TruingError, match="wheel_radius_m"):
        given_geometry(2400, value)


def test_numbers_given_take_the_place_of_the_baselines(counts: Path) -> None:
    corrected = read_runs(counts, EXAMPLE / "baseline.toml", geometry=given_geometry(wheelbase_m=0.2))
    assert corrected.baseline is not None
    assert corrected.baseline.robot == RobotGeometry("trial", 0.0457003, 0.2, 4096)


def test_no_baseline_is_written_of_runs_that_show_no_time_constant(tmp_path: Path) -> None:
    run = read_run(EXAMPLE / "runs/01_diagnosis_steps_from_rest.csv")
    still = run.columns | {"effort_right": 0.0 * run.t_s}
    path = write_run(type(run)("run", still, run.mode, order=run.order), tmp_path / "run.csv")
    result = identify_set(read_runs(path))
    with pytest.raises(IdentifyError, match="right wheel"):
        result.robot_model()
