"""Real recordings of other people's robots come out as those who prepared them know them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from truing.importers import Imported, ImportOptions, import_file
from truing.recording.reader import read_recording_set

pytestmark = pytest.mark.recordings

# A file, the set that was made from it by hand, and how many per cent less far the right side may go.
SETS = {
    "armada2508/data20200509-1153.json.gz": "frc_armada2508_2020__data20200509-1153",
    "frc2881/sysid_data20220227-150426.json.gz": "frc_frc2881_2022__sysid_data20220227-150426",
    "frc5024/MinibotCarpet20200124-1730.json.gz": "frc_frc5024_2020__MinibotCarpet20200124-1730",
    "frc5024/Piperservant20200206-1721.json.gz": "frc_frc5024_2020__Piperservant20200206-1721",
    "team4099/CharacterizationTestOutput.json.gz": "frc_team4099__CharacterizationTestOutput",
}


def raw(recordings: Path, name: str) -> Path:
    path = recordings / "raw" / name
    if not path.exists():
        pytest.skip(f"{path} is not there")
    return path


def text_of(imported: Imported, code: str) -> str:
    return "\n".join(str(finding) for finding in imported.findings if finding.code == code)


def lags_ms(imported: Imported) -> list[float]:
    said = [finding.text for finding in imported.findings if finding.code == "filtered_speed"]
    return [float(text.split("about ")[1].split(" ms")[0]) for text in said]


@pytest.mark.parametrize("file", SETS)
def test_a_sysid_file_gives_the_runs_that_were_made_from_it_by_hand(recordings: Path, file: str) -> None:
    imported = {run.name: run for run in import_file(raw(recordings, file)).runs}
    by_hand = read_recording_set(recordings / "real" / SETS[file])
    for run in by_hand:
        ours = imported[run.name]
        for name, values in run.columns.items():
            # The prepared files hold six significant digits, from a start at zero.
            allowed = 6e-6 * np.maximum(np.abs(values), 1.0)
            assert ours.columns[name].shape == values.shape, (run.name, name)
            assert (np.abs(ours.columns[name] - values) <= allowed).all(), (run.name, name)


def test_microseconds_are_found_in_the_file_that_has_them_and_in_no_other(recordings: Path) -> None:
    for file in SETS:
        said = text_of(import_file(raw(recordings, file)), "time_unit")
        assert ("microseconds" in said) == file.startswith("team4099"), file


def test_motors_mounted_the_other_way_round_are_found_where_they_are(recordings: Path) -> None:
    sides = {"Minibot": "right", "Piperservant": "left"}
    for file in SETS:
        said = text_of(import_file(raw(recordings, file)), "opposite_sign")
        expected = next((side for name, side in sides.items() if name in file), "")
        assert said.split(" ")[0] == expected, file


def test_filters_of_60_and_of_160_to_200_ms_are_told_apart(recordings: Path) -> None:
    for name in ("armada2508", "Piperservant"):
        (file,) = [item for item in SETS if name in item]
        found = lags_ms(import_file(raw(recordings, file)))
        assert len(found) == 2, file
        assert found == pytest.approx([60.0, 60.0], abs=20.0), "to one sampling interval"
    for name in ("team4099", "frc2881"):
        (file,) = [item for item in SETS if name in item]
        found = lags_ms(import_file(raw(recordings, file)))
        assert len(found) == 2, file
        assert found == pytest.approx([180.0, 180.0], abs=40.0), file


def test_the_encoder_that_miscounts_is_found(recordings: Path) -> None:
    for file in SETS:
        said = text_of(import_file(raw(recordings, file)), "unequal_sides")
        assert ("one encoder miscounts" in said) == ("Minibot" in file), file


def test_half_of_the_5_ms_rows_repeat_the_reading_before(recordings: Path) -> None:
    said = text_of(
        import_file(raw(recordings, "frc2881/sysid_data20220227-150426.json.gz")), "repeated_samples"
    )
    assert said.count("50% of the rows repeat the one before") == 4


def test_rows_from_the_moment_before_are_found_at_the_start_of_every_test(recordings: Path) -> None:
    said = text_of(import_file(raw(recordings, "team4099/CharacterizationTestOutput.json.gz")), "stale_start")
    assert [line.split(":")[0] for line in said.splitlines()] == [
        "slow_forward",
        "slow_backward",
        "fast_forward",
        "fast_backward",
    ]


def test_the_data_log_equals_its_plain_conversion(recordings: Path, tmp_path: Path) -> None:
    imported = import_file(raw(recordings, "romi/FRC_20250321_153530.wpilog"))
    mapping = tmp_path / "mapping.toml"
    sides = ("left", "right")
    volts = "".join(f'effort_{s} = {{ column = "applied_V", scale = {1 / 12} }}\n' for s in sides)
    motion = "".join(f'pos_{s}_m = "{s}_pos"\nvel_{s}_mps = "{s}_vel"\n' for s in sides)
    time = 't_s = { column = "t_s", scale = 1 }\n'
    mapping.write_text(f'[columns]\n{time}{volts}{motion}[split]\ncolumn = "test"\nskip = ["none"]\n')
    plain = import_file(raw(recordings, "romi/romi_sysid.csv"), ImportOptions(mapping=mapping))
    assert [run.name for run in plain.runs] == [run.name for run in imported.runs]
    for one, other in zip(imported.runs, plain.runs, strict=True):
        # The conversion has the time of the voltage, which its program writes after the positions.
        np.testing.assert_allclose(one.t_s, other.t_s, atol=5e-3)
        for name in set(one.columns) - {"t_s"}:
            np.testing.assert_allclose(one.columns[name], other.columns[name], atol=1e-12, err_msg=name)
    assert "both sides share the voltage" in text_of(imported, "one_voltage")
    assert "lie below 1e-100" in text_of(imported, "denormal")


def test_a_micromouse_is_read_through_a_mapping_and_its_reversed_motor_is_found(
    recordings: Path, tmp_path: Path
) -> None:
    mapping = tmp_path / "mouse.toml"
    # Mode 4 stands for command 100 of 255 in these files; the right wheel does not move.
    mapping.write_text(
        '[columns]\nt_s = { column = "time", scale = 1e-3 }\nticks_left = "leftEncoder"\n'
        'ticks_right = "rightEncoder"\n'
        + "".join(
            f'effort_{s} = {{ column = "{s}Mode", scale = {100 / 255 / 4} }}\n' for s in ("left", "right")
        )
    )
    imported = import_file(raw(recordings, "micromouse/encoders3.csv"), ImportOptions(mapping=mapping))
    (run,) = imported.runs
    assert run.rate_hz == pytest.approx(200.0)
    assert run.columns["effort_left"].min() == pytest.approx(-100 / 255)
    assert "left drive and motion have opposite signs" in text_of(imported, "opposite_sign")
    assert (run.columns["ticks_right"] == 0).all()


def test_a_speed_map_at_one_row_a_second_keeps_its_seconds(recordings: Path, tmp_path: Path) -> None:
    mapping = tmp_path / "mouse.toml"
    columns = "".join(
        f'effort_{s} = {{ column = "motorCommand", scale = {1 / 255} }}\n'
        f'vel_{s}_mps = {{ column = "{s}SpeedRpm", scale = {0.016 * 2 * np.pi / 60} }}\n'
        for s in ("left", "right")
    )
    for file, scale in (("wheelSpeedCalibration5.csv", 1.0), ("wheelSpeedCalibration4.csv", 1e-3)):
        mapping.write_text(f'[columns]\nt_s = {{ column = "time", scale = {scale} }}\n{columns}')
        imported = import_file(raw(recordings, f"micromouse/{file}"), ImportOptions(mapping=mapping))
        assert imported.runs[0].rate_hz == pytest.approx(1.0, rel=0.01), file
        assert text_of(imported, "time_unit") == "", file


def test_a_positioning_system_from_a_mat_file_is_read_through_a_mapping(
    recordings: Path, tmp_path: Path
) -> None:
    mapping = tmp_path / "emps.toml"
    sides = ("left", "right")
    mapping.write_text(
        '[columns]\nt_s = { column = "t", scale = 1 }\n'
        + "".join(f'effort_{s} = {{ column = "vir", scale = 0.1 }}\npos_{s}_m = "qm"\n' for s in sides)
    )
    (run,) = import_file(raw(recordings, "emps/DATA_EMPS.mat"), ImportOptions(mapping=mapping)).runs
    assert run.rate_hz == pytest.approx(1000.0, rel=1e-4)
    assert len(run) == 24841
