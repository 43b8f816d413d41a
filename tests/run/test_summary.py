"""`./run test` says how many tests each part has and how long it took; pytest's own line is the last."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from pathlib import Path


def test_the_summary_counts_tests_and_seconds_of_every_part(root: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    environment["TRUING_TEST_PARTS"] = "25\t160\tC tests\n3\t\tBudgets of the image\n"
    environment["TRUING_TEST_BEGAN"] = str(time.time() - 100.0)
    command = [sys.executable, "-m", "pytest", "-n", "0", "tests/host/test_errors.py"]
    done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout
    *_, first, second, pytest, total, last = done.stdout.splitlines()
    assert first.split() == ["25", "s", "160", "tests", "C", "tests"]
    assert second.split() == ["3", "s", "Budgets", "of", "the", "image"]
    own = re.fullmatch(r" *(\d+) s +(\d+) tests  Python and end-to-end tests \(pytest\)", pytest)
    assert own is not None, pytest
    assert int(own[1]) >= 100
    assert re.search(rf"\b{own[2]} passed in ", last)
    assert total.split() == [str(28 + int(own[1])), "s", str(160 + int(own[2])), "tests", "in", "all"]
