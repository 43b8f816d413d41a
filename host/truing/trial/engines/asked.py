"""What one trial in an engine is asked to be."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from truing.trial.concealed import Asked
from truing.trial.engines.driving import Mode


@dataclass(frozen=True)
class EngineAsked(Asked):
    """A trial in an engine; `mode` and `rate_hz` are drawn where None."""

    engine: str = "mujoco"
    mode: Mode | None = None
    rate_hz: int | None = None

    def command(self, folder: Path) -> list[str]:
        """What starts the process that makes it."""
        module = "truing.trial.engines.sealed_process"
        command = [sys.executable, "-m", module, self.engine, self.effect, str(self.seed), str(folder)]
        if self.weak is not None:
            command += ["--strength", "weak" if self.weak else "full"]
        if self.mode is not None:
            command += ["--mode", self.mode]
        if self.rate_hz is not None:
            command += ["--rate", str(self.rate_hz)]
        return command
