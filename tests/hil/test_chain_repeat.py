"""The same image, plan and seed give the same run: trace, log and files, in any process."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from support.chain import Chain
from truing.board.drive import drive
from truing.plan import load_plan
from truing.recording.reader import read_recording_set

PROGRAM = """
import sys
from pathlib import Path
from support.chain import Chain
from truing.board.drive import drive
from truing.plan import load_plan
with Chain(Path(sys.argv[1]), seed=int(sys.argv[2])) as chain:
    device = chain.host()
    drive(device, load_plan("paper/XI"))
    device.read_log(device.log())
    print(chain.robot.trace_hash(), chain.robot.trace_count())
"""


def in_this_process(image: Path, seed: int) -> str:
    with Chain(image, seed=seed) as chain:
        device = chain.host()
        drive(device, load_plan("paper/XI"))
        device.read_log(device.log())
        return f"{chain.robot.trace_hash()} {chain.robot.trace_count()}"


def in_another_process(root: Path, image: Path, seed: int) -> str:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(image), str(seed)],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
        env={"PYTHONPATH": str(root / "tests"), "PYTHONHASHSEED": "random"},
    )
    return done.stdout.strip()


def test_two_runs_and_two_processes_have_one_trace_hash(
    root: Path, image: Path, native_library: Path
) -> None:
    hashes = {
        in_this_process(image, 5),
        in_this_process(image, 5),
        in_another_process(root, image, 5),
        in_another_process(root, image, 5),
    }
    assert len(hashes) == 1, hashes
    print(hashes)


def test_another_seed_gives_another_trace(image: Path, native_library: Path) -> None:
    assert in_this_process(image, 5) != in_this_process(image, 6)


def test_the_same_seed_writes_the_same_files(
    root: Path, image: Path, native_library: Path, tmp_path: Path
) -> None:
    def files(name: str) -> dict[str, bytes]:
        folder = tmp_path / name
        subprocess.run(
            [sys.executable, "-m", "truing", "run", "paper/IX", "--set", str(folder), "--seed", "3"],
            check=True,
            capture_output=True,
            timeout=60,
            cwd=tmp_path,
        )
        return {
            str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()
        }

    first, second = files("first"), files("second")
    assert sorted(first) == ["baseline.toml", "runs/01_paper_IX.csv", "runs/01_paper_IX.meta.json"]
    assert first == second


def test_a_run_carries_everything_that_made_it(image: Path, native_library: Path, tmp_path: Path) -> None:
    for _ in range(2):
        subprocess.run(
            [
                sys.executable,
                "-m",
                "truing",
                "run",
                "paper/II",
                "--set",
                str(tmp_path / "set"),
                "--seed",
                "3",
            ],
            check=True,
            capture_output=True,
            timeout=60,
        )
    recordings = read_recording_set(tmp_path / "set")
    assert [run.name for run in recordings.runs] == ["01_paper_II", "02_paper_II"]
    assert recordings.baseline is not None
    assert recordings.baseline.metres_per_count == pytest.approx(0.0635 * 2 * 3.14159265 / 2400)
    metadata = recordings.runs[0].metadata
    assert metadata is not None
    assert metadata.firmware["version"]
    assert metadata.firmware["board_id"]
    assert len(metadata.firmware["schema_hash"]) == 8
    assert metadata.parameters["wheelbase_m"] == 0.283
    assert metadata.plan["name"] == "paper/II"
    assert metadata.plan["segment"][1] == {"duration_s": 2.0, "effort": [0.3, 0.0]}
    assert metadata.seed == 3
    assert metadata.pause_before_s is None  # the first run since the board was switched on
    assert metadata.extra["log"]["records"] == len(recordings.runs[0])
    json.dumps(metadata.extra)
