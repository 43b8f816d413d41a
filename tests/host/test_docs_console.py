"""The tutorial's commands print what it shows."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from support.console import Command, commands, difference, files
from truing.cli import group

TUTORIAL = Path(__file__).parents[2] / "docs/TUTORIAL.md"


def printed(command: Command) -> str:
    """Output of one command in the current folder; `truing` runs in this process."""
    name, *arguments = shlex.split(command.text)
    if name == "truing":
        done = CliRunner().invoke(group, arguments, catch_exceptions=False)
        assert done.exit_code == 0, f"{command}\n{done.output}"
        return done.output
    program = sys.executable if name == "python3" else name
    return subprocess.run(
        [program, *arguments], capture_output=True, text=True, check=True, timeout=60
    ).stdout


@pytest.mark.slow
def test_the_tutorial_shows_what_its_commands_print(
    image: Path, native_library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from truing.diagnose.simulation.warm import compile_once

    compile_once(print)  # says so where it does, which the page does not show
    monkeypatch.chdir(tmp_path)
    # How far a slow computer is, every few seconds, is not on the page.
    monkeypatch.setattr("truing.cli.app.PROGRESS_LINE_EVERY_S", float("inf"))
    monkeypatch.delenv("TRUING_PORT", raising=False)
    for name, text in files(TUTORIAL).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    shown = commands(TUTORIAL)
    assert len(shown) > 10
    for command in shown:
        output = printed(command)
        assert (wrong := difference(command.shown, output)) is None, f"{command}\n{wrong}\n\n{output}"


@pytest.mark.parametrize(
    ("shown", "output", "same"),
    [
        ("error 40.0 mm/s", "error 44.0\n  mm/s", True),
        ("error 40.0 mm/s", "error 60.0 mm/s", False),
        ("gain 0.020", "gain 0.030", True),
        ("named friction (99 % sure)", "named drag (99 % sure)", False),
        ("named ... sure", "named friction (98 % very sure", True),
        ("named ... sure", "named friction (98 % sure at all", False),
        ("...\nlast", "first\nlast", True),
        ("...\nlast", "first\n", False),
        ("first", "first\nsecond", False),
        ("", "anything", False),
        ("first\n...\nfirst", "first", False),
        ("3 of 4", "3 of many", False),
    ],
)
def test_a_page_differs_in_words_and_in_numbers_by_more_than_a_quarter(
    shown: str, output: str, same: bool
) -> None:
    assert (difference(shown, output) is None) == same
