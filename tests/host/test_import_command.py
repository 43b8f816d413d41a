"""`truing import` writes a set that the rest of truing reads, and says what it found."""

from __future__ import annotations

import json
from pathlib import Path

from click.testing import CliRunner

from support.foreign_files import GAIN, TAU, drives, sysid_rows, write_sysid, write_wpilog
from truing.cli import group
from truing.errors import OutputError
from truing.importers import read_runs
from truing.recording.reader import read_recording_set


def test_several_files_become_one_set_in_their_order(tmp_path: Path) -> None:
    files = [write_sysid(tmp_path / "a.json"), write_wpilog(tmp_path / "b.wpilog")]
    out = tmp_path / "set"
    result = CliRunner().invoke(group, ["import", *map(str, files), "--out", str(out)])
    assert result.exit_code == 0, result.output
    recordings = read_recording_set(out)
    assert [run.name for run in recordings][:2] == ["01_slow_forward", "02_slow_backward"]
    assert [run.name for run in recordings][4] == "05_quasistatic_forward"
    assert "note: positions are taken as metres" in result.output
    assert f"truing identify {out}" in result.output


def test_json_holds_every_run_and_every_finding(tmp_path: Path) -> None:
    path = write_sysid(tmp_path / "a.json", time_scale=1e6)
    result = CliRunner().invoke(group, ["import", str(path), "--out", str(tmp_path / "set"), "--json"])
    value = json.loads(result.stdout)
    assert value["runs"][0]["run"] == "01_slow_forward"
    assert {"time_unit", "position_unit"} == {finding["code"] for finding in value["findings"]}
    assert [item["corrected"] for item in value["findings"] if item["code"] == "time_unit"] == [True]


def test_a_set_that_has_runs_is_not_added_to(tmp_path: Path) -> None:
    path = write_sysid(tmp_path / "a.json")
    arguments = ["import", str(path), "--out", str(tmp_path / "set")]
    assert CliRunner().invoke(group, arguments).exit_code == 0
    again = CliRunner().invoke(group, arguments)
    assert isinstance(again.exception, OutputError)
    assert "already holds runs" in str(again.exception)


def test_a_bad_file_leaves_no_set_behind(tmp_path: Path) -> None:
    good, bad = write_sysid(tmp_path / "a.json"), tmp_path / "b.json"
    bad.write_text("{")
    result = CliRunner().invoke(group, ["import", str(good), str(bad), "--out", str(tmp_path / "set")])
    assert result.exception is not None
    assert "b.json" in str(result.exception)
    assert not (tmp_path / "set").exists()


def test_identify_takes_a_file_of_another_program_and_says_what_was_found(tmp_path: Path) -> None:
    path = write_sysid(tmp_path / "a.json", time_scale=1e6)
    result = CliRunner().invoke(group, ["identify", str(path), "--json"])
    assert result.exit_code == 0, result.output
    value = json.loads(result.stdout)
    assert [run["run"] for run in value["runs"]][2:] == ["03_fast_forward", "04_fast_backward"]
    texts = [finding["text"] for finding in value["findings"]]
    assert any("taken as microseconds" in text for text in texts)
    for fit in value["first_order"]:
        assert abs(fit["gain_mps"]["value"] - GAIN) < 0.02 * GAIN
        assert abs(fit["time_constant_s"]["value"] - TAU) < 0.1 * TAU


def test_a_spin_on_the_spot_is_imported_when_asked_and_not_identified_with_straight_runs(
    tmp_path: Path,
) -> None:
    spin = sysid_rows(drives()[2], 9)
    for row in spin:
        row[2], row[4], row[6] = -row[2], -row[4], -row[6]
    path = write_sysid(tmp_path / "a.json", **{"track-width": spin})
    result = CliRunner().invoke(group, ["import", str(path), "--out", str(tmp_path / "set")])
    assert "05_track_width" not in result.output
    assert "track-width is left out" in result.output
    result = CliRunner().invoke(group, ["import", str(path), "--out", str(tmp_path / "all"), "--spins"])
    assert "05_track_width" in result.output
    recordings = read_runs(path)
    assert len(recordings) == 4
    assert any("track-width is left out" in text for text in recordings.runs[0].warnings)
