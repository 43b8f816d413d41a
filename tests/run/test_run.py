"""`./run`: one way in, from any folder, that adds nothing to what the command says and little to its time."""

from __future__ import annotations

import fcntl
import subprocess
import time
from pathlib import Path

import pytest

# One of these tests holds the lock that the others would wait for.
pytestmark = pytest.mark.xdist_group("run")

PLAN = """
title = "A short hop"
[[segment]]
duration_s = 0.5
effort = [0.2, 0.2]
"""


@pytest.fixture(scope="module", autouse=True)
def _set_up(root: Path) -> None:
    """What was edited since the tests began is built before the first of these."""
    subprocess.run([root / "run", "setup"], check=True, capture_output=True, timeout=300)


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """A folder that is not the repository's, with a plan in it and blanks in its name."""
    folder = tmp_path / "some where"
    folder.mkdir()
    (folder / "hop.toml").write_text(PLAN, encoding="utf-8")
    return folder


def call(*command: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command without input and keep what it says."""
    closed = subprocess.DEVNULL
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=60, stdin=closed)


@pytest.mark.parametrize(
    "arguments",
    [
        ("--version",),
        ("plan", "show", "hop.toml"),
        ("plan", "show", "no such plan; echo $HOME *"),
        ("--no-such-option",),
        (),
    ],
)
def test_the_command_gets_its_arguments_and_gives_its_output_and_status_unchanged(
    root: Path, elsewhere: Path, arguments: tuple[str, ...]
) -> None:
    alone = call(root / ".venv/bin/truing", *arguments, cwd=elsewhere)
    through_run = call(root / "run", "truing", *arguments, cwd=elsewhere)
    assert (through_run.returncode, through_run.stdout, through_run.stderr) == (
        alone.returncode,
        alone.stdout,
        alone.stderr,
    )


def test_relative_paths_mean_the_callers_folder(root: Path, elsewhere: Path) -> None:
    assert "A short hop" in call(root / "run", "truing", "plan", "show", "./hop.toml", cwd=elsewhere).stdout


def test_it_works_through_a_link_to_it(root: Path, elsewhere: Path) -> None:
    (elsewhere / "go").symlink_to(root / "run")
    assert call("./go", "truing", "--version", cwd=elsewhere).returncode == 0


def test_it_costs_less_than_half_a_second(root: Path, elsewhere: Path) -> None:
    def fastest(*command: str | Path) -> float:
        spans = []
        for _ in range(5):
            begin = time.perf_counter()
            call(*command, cwd=elsewhere)
            spans.append(time.perf_counter() - begin)
        return min(spans)

    alone = fastest(root / ".venv/bin/truing", "--version")
    assert fastest(root / "run", "truing", "--version") - alone < 0.5


def test_without_arguments_it_shows_what_it_can_do(root: Path, elsewhere: Path) -> None:
    shown = call(root / "run", cwd=elsewhere)
    assert shown.returncode == 0
    for command in ("setup", "demo", "test", "bench", "truing"):
        assert f"./run {command}" in shown.stdout


def test_an_unknown_command_is_refused_by_name(root: Path, elsewhere: Path) -> None:
    refused = call(root / "run", "dmeo", cwd=elsewhere)
    assert refused.returncode == 2
    assert "dmeo" in refused.stderr
    assert refused.stdout == ""


def test_two_at_once_wait_for_each_other(root: Path, elsewhere: Path) -> None:
    with (root / ".cache/lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        waiting = subprocess.Popen(
            [root / "run", "truing", "--version"],
            cwd=elsewhere,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        with pytest.raises(subprocess.TimeoutExpired):
            waiting.wait(timeout=2.0)
    stdout, stderr = waiting.communicate(timeout=30)
    assert waiting.returncode == 0
    assert stdout.startswith("truing")
    assert "waiting" in stderr
