"""The `truing` command as a user runs it: as a process, or inside the test's own."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest


def truing(*arguments: str, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run it to its end; nobody sits at its terminal."""
    return subprocess.run(
        [sys.executable, "-m", "truing", *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=cwd,
        stdin=subprocess.DEVNULL,
        env=os.environ | environment,
    )


def truing_within(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """The same in this process, for tests of words, files and exit status.

    A process of its own spends a second on its imports; signals, pipes and start-up need one.
    """
    from truing.cli import main

    out, err, status = io.StringIO(), io.StringIO(), 0
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        for name, value in environment.items():
            patch.setenv(name, value)
        patch.setattr(sys, "stdin", io.StringIO())
        try:
            main(arguments)
        except SystemExit as ended:
            status = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    return subprocess.CompletedProcess(arguments, status, out.getvalue(), err.getvalue())
