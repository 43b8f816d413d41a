"""`truing params` against a served board: list, set, diff, save, load, with files and without."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from support.served_board import ServedBoard
from truing_protocol import PARAMETERS


@pytest.fixture
def board(image: Path, native_library: Path, tmp_path: Path) -> Iterator[ServedBoard]:
    with ServedBoard(tmp_path) as served:
        yield served


def params(board: ServedBoard, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = board.truing("params", *arguments)
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def result(board: ServedBoard, *arguments: str) -> Any:
    done = params(board, *arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_change_shows_as_a_difference_until_it_is_saved_and_load_takes_it_back(board: ServedBoard) -> None:
    result(board, "set", "wheelbase_m", "0.29")
    assert result(board, "diff") == {"wheelbase_m": {"live": 0.29, "stored": 0.283}}
    assert result(board, "list")["wheelbase_m"]["stored"] is None
    shown = params(board, "list").stdout
    assert "0.29 *" in shown
    assert "the store holds no set" in shown
    saved = result(board, "save")
    assert (saved["sequence"], saved["written"]) == (1, True)
    assert saved["stall_s"] == pytest.approx(0.25, abs=0.01)
    assert result(board, "diff") == {}
    assert result(board, "list")["wheelbase_m"]["stored"] == 0.29
    assert "nothing to save" in params(board, "save").stdout
    result(board, "set", "wheelbase_m", "0.31")
    assert result(board, "load") == {"wheelbase_m": {"now": 0.29, "before": 0.31}}
    assert result(board, "defaults") == {"wheelbase_m": {"now": 0.283, "before": 0.29}}
    assert f"holds set 1 with {len(PARAMETERS)} of these parameters" in params(board, "list").stdout


def test_a_file_keeps_a_copy_shows_differences_and_brings_the_values_back(
    board: ServedBoard, tmp_path: Path
) -> None:
    mine = tmp_path / "mine.toml"
    result(board, "set", "wheelbase_m", "0.29")
    result(board, "set", "log_rate_hz", "50")
    params(board, "save", "--file", str(mine))
    result(board, "defaults")
    difference = {"wheelbase_m": {"live": 0.283, "file": 0.29}, "log_rate_hz": {"live": 20, "file": 50}}
    assert result(board, "diff", "--file", str(mine)) == difference
    done = params(board, "load", "--file", str(mine))
    assert "0.29" in done.stdout
    assert "truing params save" in done.stdout
    assert result(board, "diff", "--file", str(mine)) == {}


def test_a_bad_file_changes_nothing(board: ServedBoard, tmp_path: Path) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text("[parameters]\nwheelbase_m = 0.29\nlog_rate_hz = 5000\n")
    done = params(board, "load", "--file", str(bad))
    assert done.returncode == 2
    assert "log_rate_hz = 5000 lies outside 1 to 200 Hz" in done.stderr
    assert "Traceback" not in done.stderr
    assert result(board, "get", "wheelbase_m") == {"wheelbase_m": 0.283}
