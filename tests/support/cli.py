"""The `truing` command as a user runs it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


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
