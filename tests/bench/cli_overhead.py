"""What `./run truing` costs over the command itself."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from bench.figure import Figure, median_seconds

ROUNDS = 15


def measure(root: Path) -> list[Figure]:
    """Time the same command with and without `./run` around it."""

    def seconds(*command: str | Path) -> float:
        return median_seconds(lambda: subprocess.run(command, check=True, capture_output=True), ROUNDS)

    python = seconds(sys.executable, "-c", "pass")
    alone = seconds(root / ".venv/bin/truing", "--help")
    through_run = seconds(root / "run", "truing", "--help")
    return [
        Figure(
            "./run over the command itself",
            1e3 * (through_run - alone),
            "ms",
            "less",
            bar=500,
            peer="starting Python",
            peer_value=1e3 * python,
        ),
        Figure("truing --help", 1e3 * alone, "ms", "less", peer="starting Python", peer_value=1e3 * python),
    ]
