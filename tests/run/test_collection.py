"""Collecting the tests is quick: what takes long to import is imported by the tests that use it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

# Each takes from 0.1 s to 1.5 s, in every process that collects.
HEAVY = ["cantools", "fastapi", "matplotlib", "mujoco", "nicegui", "playwright", "yourdfpy"]
HEAVY += ["rosbags.rosbag1", "rosbags.rosbag2"]
HEAVY += [f"scipy.{name}" for name in ("io", "linalg", "optimize", "signal", "special", "stats")]


def test_no_module_imports_what_is_heavy_before_a_test_runs(imported_at_collection: frozenset[str]) -> None:
    """Of the tests that were collected in this process: all, where all are run."""
    assert "hypothesis" in imported_at_collection
    assert not imported_at_collection.intersection(HEAVY)


def test_tests_of_a_group_run_in_one_process(tmp_path: Path) -> None:
    """pytest-xdist 3.8 leaves groups unheeded, without a word, from pytest 9.2 on."""
    module = """
import os, pathlib, pytest

@pytest.mark.xdist_group("one")
@pytest.mark.parametrize("number", range(6))
def test_a_worker_is_noted(number):
    (pathlib.Path(__file__).parent / f"{number}.worker").write_text(os.environ["PYTEST_XDIST_WORKER"])
"""
    (tmp_path / "test_group.py").write_text(module)
    alone = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    command = [sys.executable, "-m", "pytest", "-q", "-n", "2", "--dist=loadgroup", "-c", os.devnull]
    command += ["--rootdir", str(tmp_path), str(tmp_path / "test_group.py")]
    done = subprocess.run(command, cwd=tmp_path, env=alone, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    assert len({file.read_text() for file in tmp_path.glob("*.worker")}) == 1
