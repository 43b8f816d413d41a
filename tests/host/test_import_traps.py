"""Unit and sign traps in recordings of other programs are found, said, and put right only where certain."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from support.foreign_files import Drive, drive, drives, sysid_rows
from truing.importers import Imported, ImportOptions, import_file


def imported_with(folder: Path, change: Callable[[Drive, np.ndarray], Any], width: int = 10) -> Imported:
    """The four tests after `change` has been at each one's rows, shape (rows, width)."""
    data = {}
    for test in drives():
        rows = np.array(sysid_rows(test, width))
        change(test, rows)
        data[test.name] = rows.tolist()
    path = folder / "drive.json"
    path.write_text(json.dumps(data))
    return import_file(path)


def codes(imported: Imported) -> set[str]:
    return {finding.code for finding in imported.findings} - {"position_unit"}


def the(imported: Imported, code: str) -> Any:
    (finding,) = [item for item in imported.findings if item.code == code]
    return finding


def test_a_clean_file_raises_no_suspicion(tmp_path: Path) -> None:
    assert codes(imported_with(tmp_path, lambda test, rows: None)) == set()


@pytest.mark.parametrize(("scale", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds")])
@pytest.mark.parametrize("period_s", [0.001, 0.005, 0.02, 0.1])
def test_time_in_smaller_units_is_found_and_converted(
    tmp_path: Path, scale: float, unit: str, period_s: float
) -> None:
    tests = drives(period_s=period_s)
    path = tmp_path / "drive.json"
    path.write_text(json.dumps({test.name: sysid_rows(test, 10, scale) for test in tests}))
    imported = import_file(path)
    np.testing.assert_allclose(imported.runs[0].t_s, tests[0].t, atol=1e-9)
    finding = the(imported, "time_unit")
    assert unit in finding.text
    assert finding.corrected


def test_seconds_once_a_second_stay_seconds_where_wheels_can_tell(tmp_path: Path) -> None:
    slow = [drive(test.name, period_s=1.0, duration_s=40.0) for test in drives()]
    path = tmp_path / "drive.json"
    path.write_text(json.dumps({test.name: sysid_rows(test, 10) for test in slow}))
    assert import_file(path).runs[0].duration_s == pytest.approx(39.0)


def test_a_time_whose_scale_the_user_gave_is_never_changed(tmp_path: Path) -> None:
    truth = drive("fast-forward", period_s=1.0, duration_s=40.0)
    rows = "\n".join(f"{t},{u},{v}" for t, u, v in zip(truth.t, truth.volts, truth.speed, strict=True))
    (tmp_path / "log.csv").write_text("t,u,v\n" + rows)
    mapping = tmp_path / "log.mapping.toml"
    mapping.write_text(
        '[columns]\nt_s = { column = "t", scale = 10 }\neffort_left = "u"\neffort_right = "u"\n'
        'vel_left_mps = "v"\nvel_right_mps = "v"\n'
    )
    imported = import_file(tmp_path / "log.csv", ImportOptions(mapping=mapping))
    assert imported.runs[0].duration_s == pytest.approx(390.0)
    finding = the(imported, "time_unit")
    assert "rows come 10 s apart" in finding.text
    assert not finding.corrected


@pytest.mark.parametrize("with_command", [True, False])
def test_volts_without_sign_get_theirs_back(tmp_path: Path, with_command: bool) -> None:
    def change(test: Drive, rows: np.ndarray) -> None:
        columns = slice(3, 5) if with_command else slice(1, 3)
        rows[:, columns] = np.abs(rows[:, columns])

    imported = imported_with(tmp_path, change, width=10 if with_command else 9)
    for run, truth in zip(imported.runs, drives(), strict=True):
        moving = np.abs(truth.speed) > 0.0
        np.testing.assert_allclose(run.columns["effort_left"][moving], truth.volts[moving] / 12.0, atol=1e-12)
    found = [finding for finding in imported.findings if finding.code == "unsigned_drive"]
    assert len(found) == 2
    assert all(finding.corrected for finding in found)
    assert ("the command" if with_command else "the way the wheel turns") in found[0].text


def test_one_motor_mounted_the_other_way_round_is_turned_round(tmp_path: Path) -> None:
    def change(test: Drive, rows: np.ndarray) -> None:
        rows[:, 4] *= -1.0

    imported = imported_with(tmp_path, change)
    for run in imported.runs:
        np.testing.assert_allclose(run.columns["effort_right"], run.columns["effort_left"], atol=1e-12)
    finding = the(imported, "opposite_sign")
    assert finding.text.startswith("right drive and motion have opposite signs")
    assert finding.corrected


def test_signs_that_agree_only_at_times_are_said_and_left(tmp_path: Path) -> None:
    def change(test: Drive, rows: np.ndarray) -> None:
        rows[::2, 3] *= -1.0

    imported = imported_with(tmp_path, change)
    assert not the(imported, "mixed_sign").corrected
    assert imported.runs[2].columns["effort_left"].min() < 0.0 < imported.runs[2].columns["effort_left"].max()


def test_rows_logged_faster_than_the_encoder_is_read_are_said(tmp_path: Path) -> None:
    def change(test: Drive, rows: np.ndarray) -> None:
        held = (np.arange(len(rows)) // 2) * 2
        rows[:, 5:9] = rows[held, 5:9]

    assert "repeated_samples" in codes(imported_with(tmp_path, change))


@pytest.mark.parametrize("filter_s", [0.06, 0.16])
def test_a_filtered_speed_is_said_with_its_lag(tmp_path: Path, filter_s: float) -> None:
    def change(test: Drive, rows: np.ndarray) -> None:
        # A mean over the last 2 * filter_s seconds lags by half its length.
        taps = round(2.0 * filter_s / 0.02)
        padded = np.concatenate((np.zeros(taps), test.speed))
        rows[:, 7] = np.convolve(padded, np.full(taps, 1.0 / taps), "full")[taps : taps + len(rows)]

    finding = the(imported_with(tmp_path, change), "filtered_speed")
    assert finding.text.startswith("the reported left speed lags")
    said_ms = float(finding.text.split("about ")[1].split(" ms")[0])
    assert said_ms == pytest.approx(1e3 * filter_s, abs=25.0), "to about a sampling interval"


def test_a_speed_of_another_unit_than_the_position_is_said(tmp_path: Path) -> None:
    def change(test: Drive, rows: np.ndarray) -> None:
        rows[:, 8] *= 60.0

    imported = imported_with(tmp_path, change)
    finding = the(imported, "speed_unit")
    assert finding.text.startswith("right position moves 0.0167")
    assert finding.text.endswith("the units differ")
    assert codes(imported) == {"speed_unit"}


def test_first_rows_that_belong_to_the_test_before_are_said(tmp_path: Path) -> None:
    def change(test: Drive, rows: np.ndarray) -> None:
        rows[:2, 5:7] += 3.0

    found = [item for item in imported_with(tmp_path, change).findings if item.code == "stale_start"]
    assert [finding.test for finding in found] == [
        "slow_forward",
        "slow_backward",
        "fast_forward",
        "fast_backward",
    ]
    assert "jumps behind its row 2" in found[0].text


@pytest.mark.parametrize(
    ("shares", "says"),
    [
        ((0.6, 0.45, 0.6, 0.35), "from test to test: one encoder miscounts, the two motors differ"),
        (
            (0.6, 0.6, 0.6, 0.6),
            "the same each time, so that gearing, radius, counts per revolution or the two motors differ",
        ),
    ],
)
def test_one_side_going_less_far_is_said_and_its_likely_cause(
    tmp_path: Path, shares: tuple[float, ...], says: str
) -> None:
    names = [test.name for test in drives()]

    def change(test: Drive, rows: np.ndarray) -> None:
        rows[:, 6] *= shares[names.index(test.name)]
        rows[:, 8] *= shares[names.index(test.name)]

    imported = imported_with(tmp_path, change)
    assert codes(imported) == {"unequal_sides"}
    assert says in the(imported, "unequal_sides").text


def test_numbers_from_uninitialised_memory_are_said_and_taken_as_zero(tmp_path: Path) -> None:
    def change(test: Drive, rows: np.ndarray) -> None:
        rows[:3, 7:9] = 3.86e-312

    imported = imported_with(tmp_path, change)
    assert codes(imported) == {"denormal"}
    assert imported.runs[0].columns["vel_left_mps"][0] == 0.0


def test_what_was_found_stays_with_the_runs(tmp_path: Path) -> None:
    def change(test: Drive, rows: np.ndarray) -> None:
        rows[:, 4] *= -1.0

    metadata = imported_with(tmp_path, change).runs[0].metadata
    assert metadata is not None
    assert metadata.extra["imported_from"] == "drive.json"
    assert any("opposite signs" in text for text in metadata.extra["findings"])
