"""What the command line prints where the console's encoding lacks a sign, as on Windows' pipes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from truing.cli.plain_console import plain


@pytest.mark.parametrize("encoding", ["cp1252", "cp437", "latin-1"])
def test_tables_and_courses_are_printed_in_any_encoding(root: Path, tmp_path: Path, encoding: str) -> None:
    """Python ended the command at the first sign that it could not encode."""
    file = root / "tests/host/ugly/mocap_gaps.csv"
    out = tmp_path / "robot"
    said = ""
    for arguments in (
        ["import", str(file), "--out", str(out), "--yes"],
        ["identify", str(out), "--counts-per-rev", "1440", "--wheel-radius", "0.03"],
    ):
        done = subprocess.run(
            [sys.executable, "-m", "truing", *arguments],
            env={**os.environ, "PYTHONIOENCODING": encoding},
            capture_output=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr.decode(encoding)
        said += done.stdout.decode(encoding)
    # Code page 437 has the letter.
    assert ("τ up" if encoding == "cp437" else "tau up") in said
    assert "?" not in said


def test_signs_become_words_and_letters_lose_their_accents() -> None:
    assert plain("τ up → 35 °") == "tau up -> 35 deg"
    assert plain("Armstrong-Hélouvry, Åström") == "Armstrong-Helouvry, Astrom"
    assert plain("▁▄█") == "_-#"
    assert plain("│─┼") == "|--"
