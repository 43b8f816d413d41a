"""Recordings: what is accepted, what is refused and in which words, and nothing lost in a round trip."""

from __future__ import annotations

import errno
import json
import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from support.first_order_robot import BASELINE, COUNTS_PER_REV, RADIUS_M, TEST_XI, FirstOrderRobot
from truing.errors import BaselineError, FileError, IdentifyError, OutputError, RecordingError, TruingError
from truing.recording.baseline import read_baseline
from truing.recording.reader import read_recording_set, read_run
from truing.recording.run import Run, RunMetadata
from truing.recording.writer import next_run_path, replace_file, write_run

HEADER = "t_s,effort_left,effort_right,vel_left_mps,vel_right_mps"
MODEL = """[robot]
wheel_radius_m = 0.0635
wheelbase_m = 0.283
counts_per_rev = 2400
[wheel.left]
gain_mps = 1.45
time_constant_s = 0.35
[wheel.right]
gain_mps = 1.45
time_constant_s = 0.35
"""


def rows(count: int = 30) -> list[str]:
    return [f"{0.05 * k:.2f},0.3,0.3,{0.01 * k:.3f},{0.01 * k:.3f}" for k in range(count)]


def write(path: Path, lines: list[str], header: str = HEADER) -> Path:
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    return path


def refusal(path: Path) -> RecordingError:
    with pytest.raises(RecordingError) as caught:
        read_run(path)
    assert str(path) in caught.value.message, "an error must name the file"
    assert "\n" not in caught.value.message, "an error is one line"
    return caught.value


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "01_run.csv"


def test_times_in_whole_milliseconds_keep_their_rate() -> None:
    times = np.round(np.arange(91) / 30.0, 3)
    run = Run("ms", {"t_s": times, "effort_left": np.zeros(91), "vel_left": np.zeros(91)})
    assert run.rate_hz == 30.0


def test_a_plain_file_is_read_as_it_stands(file: Path) -> None:
    run = read_run(write(file, rows()))
    assert run.name == "01_run"
    assert len(run) == 30
    assert run.rate_hz == pytest.approx(20.0)
    assert run.speed("left").values[7] == 0.07
    assert run.speed("left").source == "vel"


@pytest.mark.parametrize("missing", ["t_s", "effort_left", "effort_right"])
def test_a_missing_required_column_is_named(file: Path, missing: str) -> None:
    error = refusal(write(file, rows(), HEADER.replace(missing, "other")))
    assert error.column == missing
    assert missing in error.message


def test_half_a_pair_of_motion_columns_names_the_other_half(file: Path) -> None:
    assert refusal(write(file, rows(), HEADER.replace("vel_right_mps", "other"))).column == "vel_right_mps"


def test_a_file_without_wheel_motion_says_which_columns_would_do(file: Path) -> None:
    header = HEADER.replace("vel_left_mps", "a").replace("vel_right_mps", "b")
    message = refusal(write(file, rows(), header)).message
    assert all(name in message for name in ("ticks_left", "pos_left_m", "vel_left_mps"))


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "NaN", "1e999"])
@pytest.mark.parametrize("column", HEADER.split(","))
def test_a_non_finite_value_is_named_by_column_and_row(file: Path, column: str, value: str) -> None:
    lines = rows()
    cells = lines[17].split(",")
    cells[HEADER.split(",").index(column)] = value
    lines[17] = ",".join(cells)
    error = refusal(write(file, lines))
    assert (error.column, error.row) == (column, 18)
    assert "line 19" in error.message


@pytest.mark.parametrize("value", ["", "  ", "fast", "1_000", "0x10", "1,5", "12.3.4"])
def test_a_cell_that_is_no_number_is_named(file: Path, value: str) -> None:
    lines = rows()
    lines[3] = f'0.15,"{value}",0.3,0.03,0.03'
    error = refusal(write(file, lines))
    assert (error.column, error.row) == ("effort_left", 4)


def test_time_that_runs_backwards_is_named_by_row(file: Path) -> None:
    lines = rows()
    lines[20] = lines[20].replace("1.00,", "0.90,", 1)
    error = refusal(write(file, lines))
    assert (error.column, error.row) == ("t_s", 21)
    assert "backwards" in error.message


def test_two_rows_at_the_same_time_are_no_error(file: Path) -> None:
    lines = rows()
    lines[20] = lines[20].replace("1.00,", "0.95,", 1)
    assert len(read_run(write(file, lines))) == 30


def test_time_that_stands_still_is_an_error(file: Path) -> None:
    assert refusal(write(file, ["1.0,0.3,0.3,0,0"] * 30)).column == "t_s"


def test_nineteen_rows_are_too_few_and_twenty_are_enough(file: Path) -> None:
    assert "only 19 rows" in refusal(write(file, rows(19))).message
    assert len(read_run(write(file, rows(20)))) == 20


def test_a_header_alone_is_too_few_rows(file: Path) -> None:
    assert "only 0 rows" in refusal(write(file, [])).message


@pytest.mark.parametrize("cut", ["0.50,0.3,0.3,0.1", "0.50,0.3,0.3,0.1,0.1,7", "0.50"])
def test_a_ragged_row_is_named(file: Path, cut: str) -> None:
    lines = rows()
    lines[10] = cut
    error = refusal(write(file, lines))
    assert error.row == 11
    assert "cells where the header has 5" in error.message


def test_an_empty_line_between_rows_is_named_and_one_at_the_end_is_not(file: Path) -> None:
    lines = rows()
    assert len(read_run(write(file, [*lines, "", ""]))) == 30
    lines.insert(5, "")
    assert refusal(write(file, lines)).row == 6


@pytest.mark.parametrize("data", [b"", b"\n\n  \n", b",,\n", b"\xef\xbb\xbf"])
def test_an_empty_file_is_called_empty(file: Path, data: bytes) -> None:
    file.write_bytes(data)
    assert "the file is empty" in refusal(file).message


def test_bytes_that_are_not_text_are_located(file: Path) -> None:
    write(file, rows())
    data = bytearray(file.read_bytes())
    data[len(HEADER) + 5] = 0xFF
    file.write_bytes(data)
    assert "line 2" in refusal(file).message


def test_utf_16_is_refused_and_utf_8_with_a_mark_is_read(file: Path) -> None:
    text = "\n".join([HEADER, *rows()])
    file.write_bytes(text.encode("utf-16"))
    refusal(file)
    file.write_bytes(text.encode("utf-8-sig"))
    assert len(read_run(file)) == 30


def test_windows_line_ends_are_read(file: Path) -> None:
    file.write_bytes("\r\n".join([HEADER, *rows(), ""]).encode())
    assert len(read_run(file)) == 30


def test_a_column_named_twice_is_refused(file: Path) -> None:
    header = HEADER.replace("vel_right_mps", "effort_left")
    assert refusal(write(file, rows(), header)).column == "effort_left"


def test_semicolons_are_recognised(file: Path) -> None:
    write(file, [line.replace(",", ";") for line in rows()], HEADER.replace(",", ";"))
    assert "comma" in refusal(file).message


def test_an_unknown_mode_is_named(file: Path) -> None:
    lines = [line + (",turbo" if k == 12 else ",effort") for k, line in enumerate(rows())]
    error = refusal(write(file, lines, HEADER + ",mode"))
    assert (error.column, error.row) == ("mode", 13)


def test_unknown_columns_are_kept_whatever_they_hold(file: Path) -> None:
    lines = [f"{line},{k},note {k},nan" for k, line in enumerate(rows())]
    run = read_run(write(file, lines, HEADER + ",lap,remark,maybe"))
    assert run.columns["lap"][9] == 9.0
    assert run.text_columns["remark"][9] == "note 9"
    assert np.isnan(run.columns["maybe"]).all()


def test_a_gap_is_a_gap_and_not_an_error(file: Path) -> None:
    lines = rows()
    lines[15:] = [f"{0.05 * k + 3.0:.2f},0.3,0.3,0.1,0.1" for k in range(15, 30)]
    assert read_run(write(file, lines)).gaps().tolist() == [15]


def test_a_folder_and_a_missing_file_are_no_recordings(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nothing.csv"):
        with pytest.raises(FileError, match=str(path)):
            read_run(path)


def test_runs_of_a_set_come_in_the_order_of_their_names(tmp_path: Path) -> None:
    (tmp_path / "runs").mkdir()
    for name in ("10_c", "02_b", "01_a"):
        write(tmp_path / "runs" / f"{name}.csv", rows())
    (tmp_path / "runs" / "notes.txt").write_text("not a run")
    (tmp_path / "baseline.toml").write_text(MODEL)
    recordings = read_recording_set(tmp_path)
    assert [run.name for run in recordings] == ["01_a", "02_b", "10_c"]
    assert recordings.baseline is not None
    assert [run.name for run in read_recording_set(tmp_path / "runs")] == ["01_a", "02_b", "10_c"]
    single = read_recording_set(tmp_path / "runs" / "02_b.csv")
    assert [run.name for run in single] == ["02_b"]
    assert single.baseline is not None, "the baseline beside a set serves its single files too"


def test_a_folder_without_runs_says_what_a_set_looks_like(tmp_path: Path) -> None:
    with pytest.raises(FileError) as caught:
        read_recording_set(tmp_path)
    assert "runs/01_" in caught.value.next_step


def test_speed_comes_from_counts_then_reported_speed_then_positions() -> None:
    run = FirstOrderRobot().drive(TEST_XI, columns=("ticks", "vel", "pos"))
    assert run.speed("left", BASELINE).source == "ticks"
    assert run.speed("left", None).source == "vel"
    positions = {name: values for name, values in run.columns.items() if "vel" not in name}
    assert replace(run, columns=positions).speed("left", None).source == "pos"


def test_speed_from_counts_is_the_mean_over_each_interval() -> None:
    run = FirstOrderRobot().drive(TEST_XI, columns=("ticks", "vel"))
    from_counts = run.speed("left", BASELINE).values
    one_count = 2.0 * math.pi * RADIUS_M / COUNTS_PER_REV / 0.05
    assert np.abs(from_counts - run.columns["vel_left_mps"])[1:].max() <= one_count


def test_counts_without_geometry_ask_for_a_model() -> None:
    run = FirstOrderRobot().drive(TEST_XI, columns=("ticks",))
    with pytest.raises(IdentifyError) as caught:
        run.speed("left", None)
    assert "--model" in caught.value.next_step


def test_rows_at_the_same_time_share_a_speed() -> None:
    t_s = np.array([0.0, 0.1, 0.1, 0.2])
    travel = np.array([0.0, 0.01, 0.02, 0.05])
    zeros = np.zeros(4)
    columns = {"t_s": t_s, "effort_left": zeros, "effort_right": zeros}
    columns |= {"pos_left_m": travel, "pos_right_m": travel}
    assert Run("x", columns).speed("left").values == pytest.approx([0.2, 0.2, 0.2, 0.3])


def test_a_run_is_read_back_exactly_as_it_was_written(tmp_path: Path) -> None:
    run = FirstOrderRobot(disturbance=0.01).drive(TEST_XI, columns=("ticks", "cmd", "vel", "pos"))
    columns = run.columns | {"lap": np.full(len(run), np.pi)}
    metadata = RunMetadata(
        firmware={"version": "0.1.0", "schema_hash": "0badcafe"},
        parameters={"kp_left": 0.3},
        plan={"name": "paper/XI", "segments": [{"duration_s": 2.0}]},
        seed=7,
        pause_before_s=1.5,
        extra={"recorded_by": "Zoë"},
    )
    text = {"remark": tuple(f'says "{k}", then\tgoes' for k in range(len(run)))}
    order = (*run.order, "lap", "remark")
    run = replace(run, columns=columns, text_columns=text, order=order, metadata=metadata)
    path = write_run(run, tmp_path / "runs" / "01_x.csv")
    back = read_run(path)
    assert back.order == run.order
    assert back.mode == run.mode
    assert back.text_columns == run.text_columns
    assert back.metadata == metadata
    for name, values in columns.items():
        assert np.array_equal(back.columns[name], values), name


def test_counts_are_written_as_whole_numbers(tmp_path: Path) -> None:
    run = FirstOrderRobot().drive(TEST_XI)
    text = write_run(run, tmp_path / "a.csv").read_text()
    ticks = text.splitlines()[0].split(",").index("ticks_left")
    assert all("." not in line.split(",")[ticks] for line in text.splitlines()[1:])


def test_a_run_without_metadata_is_read_and_damaged_metadata_is_a_warning(tmp_path: Path) -> None:
    run = FirstOrderRobot().drive(TEST_XI)
    path = write_run(run, tmp_path / "01_x.csv")
    assert read_run(path).metadata is None
    for damage in ("{", "[]", '{"seed": "seven"}', '{"parameters": 5}', '{"plan": []}'):
        (tmp_path / "01_x.meta.json").write_text(damage)
        back = read_run(path)
        assert back.metadata is None
        assert "01_x.meta.json" in back.warnings[0]


def test_metadata_says_how_the_run_came_about(tmp_path: Path) -> None:
    run = replace(FirstOrderRobot().drive(TEST_XI), metadata=RunMetadata(seed=3, pause_before_s=0.25))
    write_run(run, tmp_path / "01_x.csv")
    tree = json.loads((tmp_path / "01_x.meta.json").read_text())
    assert set(tree) >= {"schema", "firmware", "parameters", "plan", "seed", "pause_before_s"}


def test_a_full_disk_leaves_the_old_file_and_no_rubbish(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "01_x.csv"
    path.write_text("old")

    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError) as caught:
        replace_file(path, b"new")
    assert "space" in caught.value.message
    assert path.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["01_x.csv"]


def test_a_file_in_the_way_of_a_folder_is_said(tmp_path: Path) -> None:
    (tmp_path / "runs").write_text("")
    with pytest.raises(OutputError, match="runs"):
        replace_file(tmp_path / "runs" / "01_x.csv", b"")


def test_the_next_run_gets_the_next_number(tmp_path: Path) -> None:
    assert next_run_path(tmp_path, "paper/XI").name == "01_paper_XI.csv"
    (tmp_path / "runs").mkdir()
    for name in ("01_a.csv", "09_b.csv", "notes.csv"):
        (tmp_path / "runs" / name).touch()
    assert next_run_path(tmp_path, "step").name == "10_step.csv"


def test_a_hundred_thousand_rows_are_read_within_half_a_second_of_computing(tmp_path: Path) -> None:
    import time

    n = 100_000
    k = np.arange(n, dtype=float)
    columns = {"t_s": k / 2000.0}
    for name in ("effort_left", "effort_right", "vel_left_mps", "vel_right_mps", "battery_v"):
        columns[name] = np.sin(k / 100.0) * 0.5
    path = write_run(Run("fast", columns), tmp_path / "fast.csv")
    start = time.process_time()
    assert len(read_run(path)) == n
    assert time.process_time() - start < 0.5


def test_a_baseline_is_read_with_its_geometry_and_effects(tmp_path: Path) -> None:
    path = tmp_path / "baseline.toml"
    path.write_text(MODEL + "[log]\nrate_hz = 20\n[effect.coulomb_friction]\nleft = 0.04\nright = 0.05\n")
    baseline = read_baseline(path)
    assert baseline.wheelbase_m == 0.283
    assert baseline.metres_per_count == pytest.approx(2.0 * math.pi * 0.0635 / 2400)
    assert baseline.log_rate_hz == 20
    assert baseline.effects["coulomb_friction"]["right"] == 0.05


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (("[wheel.right]", "[wheel.other]"), "wheel.right"),
        (("gain_mps = 1.45", "gain_mps = -1"), "gain_mps"),
        (("gain_mps = 1.45", "gain_mps = nan"), "gain_mps"),
        (("gain_mps = 1.45", "gain_mps = true"), "gain_mps"),
        (("gain_mps = 1.45\n", ""), "gain_mps"),
        (("wheel_radius_m = 0.0635", 'wheel_radius_m = "small"'), "wheel_radius_m"),
        (("[robot]", "[robot"), "TOML"),
    ],
)
def test_a_bad_baseline_names_the_key(tmp_path: Path, change: tuple[str, str], word: str) -> None:
    path = tmp_path / "baseline.toml"
    path.write_text(MODEL.replace(*change, 1))
    with pytest.raises(BaselineError, match=word) as caught:
        read_baseline(path)
    assert str(path) in caught.value.message


def test_a_baseline_with_wheels_alone_is_enough(tmp_path: Path) -> None:
    path = tmp_path / "baseline.toml"
    path.write_text(MODEL[MODEL.index("[wheel.left]") :])
    assert read_baseline(path).robot is None


def test_every_error_is_a_truing_error() -> None:
    assert issubclass(RecordingError, TruingError)
    assert RecordingError("a.csv", "bad").exit_code == 2


def test_every_real_recording_is_read(recordings: Path) -> None:
    folders = sorted(path for path in (recordings / "real").iterdir() if path.is_dir())
    assert folders
    for folder in folders:
        for run in read_recording_set(folder):
            assert len(run) >= 20
            assert np.isfinite(run.speed("left").values).all()


def test_damaged_files_are_read_or_refused_and_never_crash(tmp_path: Path) -> None:
    rng = np.random.default_rng(2023)
    whole = write_run(FirstOrderRobot().drive(TEST_XI), tmp_path / "whole.csv").read_bytes()
    refused = agreed = 0
    for _ in range(300):
        data = bytearray(whole)
        for _ in range(int(rng.integers(1, 6))):
            place = int(rng.integers(len(data)))
            match rng.integers(3):
                case 0:
                    data[place] = int(rng.integers(256))
                case 1:
                    del data[place : place + int(rng.integers(1, 100))]
                case _:
                    data[place:place] = rng.choice([b"1e400", b",", b"\n", b'"', b"-", b"\x00"])
        file = tmp_path / "damaged.csv"
        file.write_bytes(bytes(data))
        quoted = tmp_path / "quoted.csv"
        quoted.write_bytes(bytes(data).replace(b"t_s", b'"t_s"', 1))
        found = reading_of(file)
        refused += isinstance(found, str)
        other = reading_of(quoted)
        agreed += found == other or (isinstance(found, str) and isinstance(other, str))
    assert 100 < refused < 300
    assert agreed == 300


@pytest.mark.parametrize(
    "row",
    [
        "{t},effort,0.1,0.1,1_0,2,nan,",
        "{t},effort,0.1,0.1,10, 2 ,nan,7",
        "{t}, velocity ,1e-1,+.1,10,2,inf,7",
        "{t},idle,0.1,0.1,10,2,nan,word",
        "{t},effort,0.1,0.1,10,2,1,#7",
        "{t},effort,0.1,0.1,10,2,1_0,7",
        "{t},effort,0.1,0.1,\u0661\u0660,2,1,7",
        "{t},effort,0.1,0.1,1e999,2,1,7",
        "{t},effort,0.1,0.1,10\x1f,2,1,7",
        "{t},sleep,0.1,0.1,10,2,1,7",
        "{t},effort,0.1,0.1,10,2,1,7,8",
        "{t},effort,0.1,0.1,10,2,1,7\n",
        "{t},effort,0.1,0.1,10,2,1,7\n   ",
        "",
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_numbers_are_the_same_parsed_as_a_block_and_cell_by_cell(tmp_path: Path, row: str, end: str) -> None:
    """A quote in the header makes the reader take the file cell by cell."""
    header = "t_s,mode,effort_left,effort_right,ticks_left,ticks_right,own,other"
    plain = "{t},effort,0.1,0.1,10,2,0.30000000000000004,-7e-3"
    lines = [header, *((row if k == 12 else plain).format(t=0.1 * k) for k in range(25)), ""]
    text = end.join(lines)
    file, quoted = tmp_path / "run.csv", tmp_path / "quoted" / "run.csv"
    quoted.parent.mkdir()
    file.write_text(text, encoding="utf-8", newline="")
    quoted.write_text(text.replace("t_s", '"t_s"', 1), encoding="utf-8", newline="")
    assert reading_of(file) == reading_of(quoted)


def reading_of(file: Path) -> object:
    """All that a run holds, or what is said of its file."""
    try:
        run = read_run(file)
    except RecordingError as error:
        return str(error).replace(str(file), "")
    columns = {name: column.tobytes() for name, column in run.columns.items()}
    return columns, run.order, run.mode, run.text_columns
