"""WPILib SysId and frc-characterization files become runs."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from support.foreign_files import drives, sysid_rows, write_sysid
from truing.errors import RecordingError
from truing.importers import ImportOptions, import_file, is_foreign


@pytest.mark.parametrize("width", [10, 9])
def test_both_layouts_of_a_drive_give_the_same_runs(tmp_path: Path, width: int) -> None:
    imported = import_file(write_sysid(tmp_path / "drive.json", width))
    assert [run.name for run in imported.runs] == [
        "01_slow_forward",
        "02_slow_backward",
        "03_fast_forward",
        "04_fast_backward",
    ]
    for run, truth in zip(imported.runs, drives(), strict=True):
        for side in ("left", "right"):
            np.testing.assert_allclose(run.columns[f"effort_{side}"], truth.volts / 12.0, atol=1e-12)
            np.testing.assert_allclose(run.columns[f"vel_{side}_mps"], truth.speed, atol=1e-12)
            np.testing.assert_allclose(run.columns[f"pos_{side}_m"], truth.travel, atol=1e-12)
    assert ("battery_v" in imported.runs[0].columns) == (width == 10)


@pytest.mark.parametrize("width", [6, 4])
def test_a_single_mechanism_stands_on_both_sides_and_that_is_said(tmp_path: Path, width: int) -> None:
    imported = import_file(write_sysid(tmp_path / "arm.json", width))
    run, truth = imported.runs[2], drives()[2]
    np.testing.assert_allclose(run.columns["vel_left_mps"], truth.speed, atol=1e-12)
    np.testing.assert_array_equal(run.columns["vel_left_mps"], run.columns["vel_right_mps"])
    assert {finding.code for finding in imported.findings} == {"position_unit", "single_mechanism"}


def test_full_effort_and_the_length_of_a_unit_can_be_given(tmp_path: Path) -> None:
    path = write_sysid(tmp_path / "drive.json")
    run = import_file(path, ImportOptions(nominal_voltage_v=10.0, metres_per_unit=0.5)).runs[2]
    np.testing.assert_allclose(run.columns["effort_left"], 0.7)
    np.testing.assert_allclose(run.columns["vel_left_mps"], 0.5 * drives()[2].speed, atol=1e-12)


def test_the_unit_that_the_file_names_is_applied_and_the_gearing_is_left_to_the_user(tmp_path: Path) -> None:
    path = write_sysid(tmp_path / "drive.json", units="Feet", unitsPerRotation=1.5)
    imported = import_file(path)
    np.testing.assert_allclose(
        imported.runs[2].columns["vel_left_mps"], 0.3048 * drives()[2].speed, atol=1e-12
    )
    (finding,) = [item for item in imported.findings if item.code == "position_unit"]
    assert "feet" in finding.text
    assert "1.5 units per rotation are not applied" in finding.text


def test_a_packed_file_is_read_as_it_is(tmp_path: Path) -> None:
    plain = write_sysid(tmp_path / "drive.json")
    packed = tmp_path / "packed.json.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    assert is_foreign(packed)
    for one, other in zip(import_file(plain).runs, import_file(packed).runs, strict=True):
        np.testing.assert_array_equal(one.columns["vel_left_mps"], other.columns["vel_left_mps"])


def test_a_test_too_short_for_a_run_is_left_out_and_that_is_said(tmp_path: Path) -> None:
    data = {test.name: sysid_rows(test, 9) for test in drives()}
    data["fast-backward"] = data["fast-backward"][:12]
    path = tmp_path / "drive.json"
    path.write_text(json.dumps(data))
    imported = import_file(path)
    assert len(imported.runs) == 3
    assert "fast_backward: only 12 rows; left out" in [str(finding) for finding in imported.findings]


@pytest.mark.parametrize("share", [0.1, 0.5, 0.95])
@pytest.mark.parametrize("packed", [False, True])
def test_a_truncated_file_is_refused_by_name(tmp_path: Path, share: float, packed: bool) -> None:
    data = write_sysid(tmp_path / "whole.json").read_bytes()
    data = gzip.compress(data) if packed else data
    path = tmp_path / ("cut.json.gz" if packed else "cut.json")
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(RecordingError, match=path.name):
        import_file(path)


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda rows: rows[7].pop(), "its row 8: 8 numbers where the first row has 9"),
        (lambda rows: rows[3].__setitem__(2, None), "its row 4, voltage right: None is not a finite number"),
        (lambda rows: rows[3].__setitem__(5, float("nan")), "its row 4, speed left: nan"),
        (lambda rows: rows[3].__setitem__(0, "soon"), "its row 4, time: 'soon'"),
        (lambda rows: rows[9].__setitem__(0, -1.0), "time runs backwards in test 'slow_forward', its row 10"),
        (lambda rows: rows.__setitem__(0, [1.0, 2.0]), "rows of 2 numbers; 10 or 9"),
        (lambda rows: rows.__setitem__(0, 3), "is not a list of rows"),
    ],
)
def test_a_damaged_row_is_named(tmp_path: Path, damage: object, says: str) -> None:
    data = {test.name: sysid_rows(test, 9) for test in drives()}
    damage(data["slow-forward"])  # type: ignore[operator]
    path = tmp_path / "drive.json"
    path.write_text(json.dumps(data))
    with pytest.raises(RecordingError) as caught:
        import_file(path)
    assert says in str(caught.value)


@pytest.mark.parametrize("content", ["[]", "{}", '{"slow-forward": []}', '{"other": 3}', "{" * 3000])
def test_json_without_tests_is_refused(tmp_path: Path, content: str) -> None:
    path = tmp_path / "drive.json"
    path.write_text(content)
    with pytest.raises(RecordingError):
        import_file(path)
