"""WPILib data logs are cut into the tests of their SysId routine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from support.foreign_files import WpilogWriter, drives, write_wpilog
from truing.errors import RecordingError
from truing.importers import import_file


def test_a_log_gives_one_run_per_test_and_leaves_the_idle_time_out(tmp_path: Path) -> None:
    imported = import_file(write_wpilog(tmp_path / "robot.wpilog"))
    assert [run.name[3:] for run in imported.runs] == [
        "quasistatic_forward",
        "quasistatic_reverse",
        "dynamic_forward",
        "dynamic_reverse",
    ]
    for run, truth in zip(imported.runs, drives(), strict=True):
        assert len(run) == len(truth.t)
        np.testing.assert_allclose(run.t_s, truth.t, atol=2e-6)
        np.testing.assert_allclose(run.columns["effort_right"], truth.volts / 12.0, atol=1e-12)
        np.testing.assert_allclose(run.columns["vel_left_mps"], truth.speed, atol=1e-12)
        np.testing.assert_allclose(run.columns["pos_right_m"], truth.travel, atol=1e-12)
    assert [finding.code for finding in imported.findings] == ["position_unit"]


def test_a_log_that_lost_power_is_read_to_its_last_whole_record_and_that_is_said(tmp_path: Path) -> None:
    path = write_wpilog(tmp_path / "robot.wpilog")
    data = path.read_bytes()
    path.write_bytes(data[: int(0.8 * len(data)) + 1])
    imported = import_file(path)
    assert len(imported.runs) == 4
    assert len(imported.runs[3]) < len(drives()[3].t)
    assert "cut_off" in [finding.code for finding in imported.findings]


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"WPILOG\x00\x01", "does not begin with a whole WPILOG header"),
        (b"WPILOG\x00\x02\x00\x00\x00\x00", "data log version 2.0"),
        (b"WPILOG\x00\x01\x00\x00\x00\x00", "no channel tells which SysId test runs"),
        (b"WPILOG\x00\x01\x00\x00\x00\x00" + b"\x00\x00\x03\x00\x00\x01\x00", "start record at byte 12"),
    ],
)
def test_a_damaged_log_is_refused_by_name(tmp_path: Path, data: bytes, says: str) -> None:
    path = tmp_path / "robot.wpilog"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=r"robot\.wpilog") as caught:
        import_file(path)
    assert says in str(caught.value)


def test_any_bytes_after_the_header_give_a_clear_error(tmp_path: Path) -> None:
    noise = np.random.default_rng(1)
    path = tmp_path / "robot.wpilog"
    for _ in range(200):
        size = int(noise.integers(1, 400))
        path.write_bytes(b"WPILOG\x00\x01\x00\x00\x00\x00" + noise.bytes(size))
        with pytest.raises(RecordingError):
            import_file(path)


def test_missing_channels_are_named_beside_those_that_are_there(tmp_path: Path) -> None:
    log = WpilogWriter()
    state, volts = log.start("state", "string"), log.start("leftVoltage", "double")
    log.string(state, 1000, "dynamic-forward")
    log.double(volts, 1000, 1.0)
    path = tmp_path / "robot.wpilog"
    path.write_bytes(log.data)
    with pytest.raises(RecordingError, match="right volts, position or velocity of both sides") as caught:
        import_file(path)
    assert "leftVoltage" in str(caught.value)


def test_a_second_channel_that_could_be_meant_is_said(tmp_path: Path) -> None:
    log = WpilogWriter()
    state = log.start("state", "string")
    names = ("leftVoltage", "rightVoltage", "leftVelocity", "rightVelocity", "turret/leftVelocity")
    entries = [log.start(name, "double") for name in names]
    log.string(state, 0, "dynamic-forward")
    for row in range(50):
        for entry in entries:
            log.double(entry, 20_000 * row, 1.0 + entry)
    path = tmp_path / "robot.wpilog"
    path.write_bytes(log.data)
    imported = import_file(path)
    (finding,) = [item for item in imported.findings if item.code == "several_channels"]
    assert "'leftVelocity'" in finding.text
    assert "'turret/leftVelocity'" in finding.text
    assert imported.runs[0].columns["vel_left_mps"][0] == 1.0 + entries[2]
