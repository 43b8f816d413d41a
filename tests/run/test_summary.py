"""`./run test` says how many tests each part has and how long it took; pytest's own line is the last."""

from __future__ import annotations

import fcntl
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest


def test_the_summary_counts_tests_and_seconds_of_every_part(root: Path, tmp_path: Path) -> None:
    """It waits for the checks beside pytest, as long as they hold their lock, and shows what they said."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    environment["TRUING_TEST_CHECKS"] = str(tmp_path / "checks")
    environment["TRUING_TEST_BEGAN"] = str(time.time() - 100.0)
    command = [sys.executable, "-m", "pytest", "-n", "0", "tests/host/test_errors.py"]
    with (tmp_path / "checks.lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        running = subprocess.Popen(command, cwd=root, env=environment, stdout=subprocess.PIPE, text=True)
        assert running.stdout is not None
        shown = "".join(iter(lambda: running.stdout.read(1), "]"))  # the tests are done: [100%]
        with pytest.raises(subprocess.TimeoutExpired):
            running.wait(timeout=0.5)
        (tmp_path / "checks.log").write_text("lines 99.3 %\n")
        (tmp_path / "checks.parts").write_text("25\t160\tC tests\n3\t\tBudgets of the image\n")
    rest, _ = running.communicate(timeout=60)
    assert running.returncode == 0, shown + rest
    *before, first, second, tests_of_pytest, total, last = rest.splitlines()
    assert "lines 99.3 %" in before
    assert first.split() == ["25", "s", "160", "tests", "C", "tests"]
    assert second.split() == ["3", "s", "Budgets", "of", "the", "image"]
    own = re.fullmatch(r" *(\d+) s +(\d+) tests  Python and end-to-end tests \(pytest\)", tests_of_pytest)
    assert own is not None, tests_of_pytest
    assert int(own[1]) >= 100
    assert re.search(rf"\b{own[2]} passed in ", last)
    seconds, _, tests, *_ = total.split()
    assert int(seconds) >= int(own[1])
    assert int(tests) == 160 + int(own[2])
    assert total.endswith("tests  in all, side by side")
