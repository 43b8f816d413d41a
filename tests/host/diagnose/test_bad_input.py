"""Poor recordings, diagnosed: a clear error, or a verdict with its limitations."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from support.recorded_sets import BASELINE_TOML, Columns, write_set
from truing.cli.app import App
from truing.cli.diagnose import command
from truing.diagnose.result import VERDICTS

WITHOUT_GEOMETRY = BASELINE_TOML[BASELINE_TOML.index("[wheel.left]") :]


def run(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(a) for a in arguments], obj=App())


def refusal(folder: Path) -> str:
    """The message of a refused set; the command itself turns it into one line and exit status 2."""
    result = run(folder)
    assert result.exit_code != 0
    assert result.exception is not None
    assert getattr(result.exception, "exit_code", 2) == 2, result.exception
    message = str(getattr(result.exception, "message", result.exception))
    assert "\n" not in message
    return message


def judged(folder: Path, *options: object) -> dict:
    """The JSON of a set that gets a verdict."""
    out = folder.parent / "verdict.json"
    result = run(folder, "--json", out, "--jobs", 1, *options)
    assert result.exit_code == 0, (result.output, result.exception)
    tree = json.loads(out.read_text())
    assert tree["verdict"] in VERDICTS
    return tree


def said(tree: dict) -> str:
    return "\n".join(check["text"] for check in tree["checks"])


@pytest.mark.parametrize("column", ["t_s", "effort_right", "ticks_left"])
def test_a_missing_column_is_named_with_its_file(tmp_path: Path, column: str) -> None:
    folder = write_set(tmp_path / "set", change=lambda name, c: c.pop(column))
    message = refusal(folder)
    assert column in message
    assert "01" in message


def test_runs_without_excitation_are_refused(tmp_path: Path) -> None:
    def still(name: str, c: Columns) -> None:
        for key in c:
            if key != "t_s":
                c[key] = np.zeros_like(c[key])

    assert "no excitation" in refusal(write_set(tmp_path / "set", change=still))


def test_constant_efforts_at_a_steady_speed_are_refused(tmp_path: Path) -> None:
    def steady(name: str, c: Columns) -> None:
        for wheel in ("left", "right"):
            c[f"effort_{wheel}"] = np.full_like(c["t_s"], 0.4)
            c[f"ticks_{wheel}"] = np.round(3500.0 * c["t_s"])

    assert "constant efforts" in refusal(write_set(tmp_path / "set", change=steady))


def test_one_run_only_gets_a_verdict_with_the_limitations_of_one_run(tmp_path: Path) -> None:
    tree = judged(write_set(tmp_path / "set", count=1))
    assert tree["verdict"] in ("consistent", "parameters_only")
    assert "one run only" in said(tree)


def test_a_wheel_that_never_moves_is_left_out_and_the_other_is_judged(tmp_path: Path) -> None:
    def dead(name: str, c: Columns) -> None:
        c["ticks_right"] = np.zeros_like(c["ticks_right"])

    tree = judged(write_set(tmp_path / "set", change=dead))
    assert "the right wheel never moves" in said(tree)
    assert not [effect for effect in tree["effects"] if effect["scope"] in ("right", "both")]
    assert not [span for span in tree["mismatch"] if "right" in span["signal"]]
    assert {"turning_scrub", "inertia_coupling", "side_asymmetry"} <= set(tree["not_exercised"])


def test_a_baseline_without_geometry_diagnoses_speeds_and_lists_what_it_cannot(tmp_path: Path) -> None:
    def in_metres(name: str, c: Columns) -> None:
        for wheel in ("left", "right"):
            c[f"pos_{wheel}_m"] = c.pop(f"ticks_{wheel}") * (2.0 * np.pi * 0.0635 / 2400.0)

    tree = judged(write_set(tmp_path / "set", change=in_metres, model=WITHOUT_GEOMETRY))
    assert tree["verdict"] in ("consistent", "parameters_only")
    assert "no [robot]" in said(tree)
    assert {"wheel_slip", "wheelbase_error", "wheel_radius_error"} <= set(tree["not_exercised"])


def test_counts_without_geometry_are_refused(tmp_path: Path) -> None:
    assert "counts_per_rev" in refusal(write_set(tmp_path / "set", model=WITHOUT_GEOMETRY))


def test_a_commanded_set_without_any_pose_is_refused(tmp_path: Path) -> None:
    result = run(write_set(tmp_path / "set"), "--commanded")
    assert "no pose" in str(getattr(result.exception, "message", ""))


def test_a_simulator_that_drives_as_the_robot_did_is_consistent(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set")
    tree = judged(folder, "--sim-runs", folder / "runs")
    assert tree["verdict"] == "consistent"
    assert tree["effects"] == []
    assert tree["fit"]["baseline_rmse"] == pytest.approx(0.0, abs=1e-12)
    assert "your simulator is reproduced to" in said(tree)


def test_a_simulator_whose_robot_is_too_fast_has_wrong_numbers(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set")

    def fast(name: str, c: Columns) -> None:
        for wheel in ("left", "right"):
            c[f"ticks_{wheel}"] = np.round(1.08 * c[f"ticks_{wheel}"])

    other = write_set(tmp_path / "other", change=fast)
    tree = judged(folder, "--sim-runs", other / "runs")
    assert tree["verdict"] == "parameters_only"
    gains = [entry for entry in tree["numbers"] if entry["name"] == "gain_mps"]
    assert all(entry["given"] == pytest.approx(1.08 * entry["refitted"], rel=0.01) for entry in gains)
