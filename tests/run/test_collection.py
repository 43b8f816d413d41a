"""Collecting the tests is quick: what takes long to import is imported by the tests that use it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

# Each takes from 0.1 s to 1.5 s, in every process that collects.
HEAVY = ["cantools", "fastapi", "matplotlib", "mujoco", "nicegui", "playwright", "plotly", "yourdfpy"]
HEAVY += ["rosbags.rosbag1", "rosbags.rosbag2"]
HEAVY += [f"scipy.{name}" for name in ("io", "linalg", "optimize", "signal", "special", "stats")]

PROGRAM = """
import pytest, sys
code = pytest.main(["--collect-only", "-qq"])
print("imported:", *(name for name in sys.argv[1:] if name in sys.modules))
sys.exit(code)
"""


def test_no_module_imports_what_is_heavy_before_a_test_runs(root: Path) -> None:
    alone = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    command = [sys.executable, "-c", PROGRAM, *HEAVY]
    done = subprocess.run(command, cwd=root, env=alone, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    assert done.stdout.splitlines()[-1].strip() == "imported:"
