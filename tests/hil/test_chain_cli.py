"""The command line on a virtual board: what a user does in a first hour."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from support.cli import truing


def test_a_file_that_is_no_image_is_named(tmp_path: Path, native_library: Path) -> None:
    wrong = tmp_path / "wrong.elf"
    wrong.write_bytes(b"not an ELF file")
    done = truing("info", "--image", str(wrong))
    assert done.returncode == 1
    assert "the virtual board cannot start" in done.stderr
    assert "Traceback" not in done.stderr


def test_json_stands_before_or_after_the_subcommand(image: Path, native_library: Path) -> None:
    before = json.loads(truing("--json", "info").stdout)
    after = json.loads(truing("info", "--json").stdout)
    assert before == after
    assert before["status"]["state"] == "idle"
    assert before["board"]["board_name"]


def test_parameters_are_listed_and_set(image: Path, native_library: Path) -> None:
    listed = json.loads(truing("params", "list", "--json").stdout)
    assert listed["counts_per_rev"]["value"] == 2400
    done = json.loads(truing("params", "set", "wheelbase_m", "0.29", "--json").stdout)
    assert done == {"name": "wheelbase_m", "before": 0.283, "value": 0.29}
    refused = truing("params", "set", "wheelbase_m", "-5")
    assert refused.returncode == 1
    assert "must lie within 0.02 to 5 m" in refused.stderr


def test_a_step_is_driven_and_identified(image: Path, native_library: Path, tmp_path: Path) -> None:
    done = truing("step", "--effort", "0.4", "--duration", "2", "--set", str(tmp_path / "set"))
    assert done.returncode == 0, done.stderr
    assert "floor:" in done.stderr
    assert "40 %" in done.stdout
    assert (tmp_path / "set/runs/01_step.csv").is_file()


def test_another_virtual_robot_behaves_as_its_file_says(
    image: Path, native_library: Path, tmp_path: Path
) -> None:
    heavy = tmp_path / "heavy.toml"
    heavy.write_text("[chassis]\nmass_kg = 20.0\n")

    def time_constant(*more: str) -> float:
        done = truing(
            "step", "--effort", "0.5", "--duration", "6", "--set", str(tmp_path / "set"), "--json", *more
        )
        steps = json.loads(done.stdout)["identification"]["runs"][0]["left"]["steps"]
        return float(steps[0]["time_constant_s"]["value"])

    assert time_constant("--robot", str(heavy)) > 1.5 * time_constant()
    heavy.write_text("[chassis]\nweight = 20.0\n")
    wrong = truing("info", "--robot", str(heavy))
    assert wrong.returncode == 2
    assert "weight" in wrong.stderr


def test_a_full_disk_or_a_file_in_the_way_is_one_clear_line(
    image: Path, native_library: Path, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    done = truing("run", "paper/I", "--set", str(tmp_path / "file" / "set"))
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "file" in done.stderr


def test_the_demo_says_what_it_does_and_where_its_files_lie(
    image: Path, native_library: Path, tmp_path: Path
) -> None:
    places = {"TRUING_OUT": str(tmp_path / "out"), "TRUING_RECORDINGS": str(tmp_path / "none")}
    done = truing("demo", "--only", "drive", "--json", **places)
    assert done.returncode == 0, done.stderr
    written = [Path(path) for path in json.loads(done.stdout)["written"]]
    assert all(path.is_file() for path in written)
    assert {".png", ".html", ".csv", ".json"} <= {path.suffix for path in written}
    assert all(tmp_path in path.parents for path in written)
    plain = truing("demo", "--only", "drive", **places)
    assert "No real recording was identified" in plain.stdout
    assert str(tmp_path / "none") in plain.stdout
    assert plain.stdout.index("report.html") > plain.stdout.index("Written")


@pytest.mark.recordings
def test_the_demo_identifies_a_real_recording_too(
    image: Path, native_library: Path, recordings: Path, tmp_path: Path
) -> None:
    places = {"TRUING_OUT": str(tmp_path / "out"), "TRUING_RECORDINGS": str(recordings)}
    done = truing("demo", "--only", "drive", "--json", **places)
    real = json.loads(done.stdout)["real"]
    assert recordings in Path(real["set"]).parents
    assert real["runs"]
