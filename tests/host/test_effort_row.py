"""Which row an effort belongs to: said by the user, estimated from the recordings, never on healthy ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from support.synthetic_wheel import Truth, baseline, record, staircase
from truing.errors import FileError
from truing.identify.effort_row import EffortRow, effort_row
from truing.identify.identification import identify_set
from truing.identify.model_ladder import fit_models
from truing.importers import ImportOptions, import_file
from truing.recording.effort_convention import shifted
from truing.recording.reader import read_recording_set
from truing.recording.run import WHEELS, RecordingSet, Run
from truing.recording.writer import write_run
from truing.workspace import recordings_folder

RATE_HZ = 50.0
PLAIN = Truth()


def run(truth: Truth = PLAIN, seed: int = 0) -> Run:
    """Steps on the rows, so that no row holds a mean of two levels."""
    steps = [(round(start * RATE_HZ) / RATE_HZ, level) for start, level in staircase(seed, 8.0)]
    return record(truth, steps, rate_hz=RATE_HZ, duration_s=8.0, seed=seed, fine_s=1e-3)


def as_set(*runs: Run) -> RecordingSet:
    named = tuple(replace(one, name=f"{number:02d}") for number, one in enumerate(runs))
    return RecordingSet("a robot", named, baseline())


def moved(one: Run, rows: int) -> Run:
    """Efforts that stand so many rows further down."""
    columns = dict(one.columns)
    for wheel in WHEELS:
        effort = columns[f"effort_{wheel}"]
        index = np.clip(np.arange(len(effort)) - rows, 0, len(effort) - 1)
        columns[f"effort_{wheel}"] = effort[index]
    return replace(one, columns=columns)


def estimated(*runs: Run) -> EffortRow:
    found = effort_row(as_set(*runs))
    assert found is not None
    return found


@pytest.mark.parametrize("delay_s", [0.0, 0.004, 0.012, 0.06])
def test_healthy_recordings_are_not_questioned(delay_s: float) -> None:
    found = estimated(run(Truth(delay=delay_s)), run(Truth(delay=delay_s), 1))
    assert found.offset_rows == pytest.approx(delay_s * RATE_HZ, abs=0.1)
    assert found.sentence() == ""


def test_efforts_that_act_after_their_row_are_found() -> None:
    found = estimated(moved(run(), -1), moved(run(seed=1), -1))
    assert found.offset_rows == pytest.approx(1.0, abs=0.1)
    assert "in the interval after" in found.sentence()
    assert 'effort = "after"' in found.advice()


def test_motion_before_its_effort_is_found() -> None:
    found = estimated(moved(run(), 1), moved(run(seed=1), 1))
    assert found.is_early
    assert "before its effort" in found.sentence()


def test_efforts_that_are_means_over_their_interval_are_not_questioned() -> None:
    # Steps inside intervals leave means between two levels: no interval ahead of its row can hold them.
    one = record(Truth(delay=0.02), staircase(0, 8.0), rate_hz=RATE_HZ, duration_s=8.0, fine_s=1e-3)
    assert effort_row(as_set(one)) is None


def test_fit_and_identify_report_it() -> None:
    recordings = as_set(moved(run(), -1), moved(run(seed=1), -1))
    assert any("in the interval after" in note for note in fit_models(recordings).notes)
    (finding,) = [each for each in identify_set(recordings).findings if each.topic == "effort_row"]
    assert 'effort = "after"' in finding.text


def test_a_set_that_says_after_is_read_as_it_means(tmp_path: Path) -> None:
    for number, one in enumerate((run(), run(seed=1))):
        write_run(moved(one, -1), tmp_path / "runs" / f"{number:02d}.csv")
    as_it_stands = read_recording_set(tmp_path)
    (tmp_path / "recording.toml").write_text('effort = "after"\n')
    for path in (tmp_path, tmp_path / "runs", tmp_path / "runs" / "00.csv"):
        read = read_recording_set(path).runs[0]
        raw = as_it_stands.runs[0].effort("left")
        np.testing.assert_array_equal(read.effort("left"), np.concatenate((raw[:1], raw[:-1])))
        np.testing.assert_array_equal(read.columns["ticks_left"], as_it_stands.runs[0].columns["ticks_left"])
    found = effort_row(replace(read_recording_set(tmp_path), baseline=baseline()))
    assert found is not None
    assert found.sentence() == ""


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('effort = "later"', '"before" or "after"'),
        ("efforts = 1", "unknown key"),
        ("effort =", "cannot be read"),
    ],
)
def test_a_wrong_setting_is_explained(tmp_path: Path, text: str, says: str) -> None:
    write_run(run(), tmp_path / "runs" / "00.csv")
    (tmp_path / "recording.toml").write_text(text)
    with pytest.raises(FileError, match=says):
        read_recording_set(tmp_path)


def test_a_mapping_may_say_after(tmp_path: Path) -> None:
    one = run()
    names = ("t_s", "effort_left", "effort_right", "pos_left_m", "pos_right_m")
    travel = one.columns["ticks_left"] * 1e-3
    rows = zip(one.t_s, one.effort("left"), one.effort("right"), travel, travel, strict=True)
    lines = [",".join(f"{value:.9g}" for value in row) for row in rows]
    (tmp_path / "log.csv").write_text("\n".join(["a,b,c,d,e", *lines]) + "\n")
    columns = "".join(f'{name} = "{letter}"\n' for name, letter in zip(names, "abcde", strict=True))
    read = {}
    for acts in ("before", "after"):
        mapping = tmp_path / f"{acts}.toml"
        mapping.write_text(f'effort = "{acts}"\n[columns]\n{columns}')
        read[acts] = import_file(tmp_path / "log.csv", ImportOptions(mapping=mapping)).runs[0].effort("left")
    np.testing.assert_allclose(read["after"], shifted(read["before"]))
    (tmp_path / "wrong.toml").write_text(f'effort = "next"\n[columns]\n{columns}')
    with pytest.raises(FileError, match='"before" or "after"'):
        import_file(tmp_path / "log.csv", ImportOptions(mapping=tmp_path / "wrong.toml"))


@pytest.mark.skipif(recordings_folder() is None, reason="no real recordings here")
def test_a_drive_that_acts_after_its_row_is_found_on_a_real_axis() -> None:
    from scipy.io import loadmat

    folder = recordings_folder()
    assert folder is not None
    held = loadmat(folder / "raw" / "emps" / "DATA_EMPS.mat")
    every = 10  # 100 Hz
    position, drive = (held[name].ravel()[::every].astype(float) for name in ("qm", "vir"))
    still = np.zeros(len(position))
    columns = {
        "t_s": 0.01 * np.arange(len(position)),
        "pos_left_m": position,
        "pos_right_m": still,
    }
    after = Run("00", columns | {"effort_left": 0.1 * drive, "effort_right": still})
    before = Run("00", columns | {"effort_left": shifted(0.1 * drive), "effort_right": still})
    assert "in the interval after" in estimated(after).sentence()
    assert estimated(before).sentence() == ""
