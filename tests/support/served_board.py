"""A virtual board in a process of its own, as `truing board` starts it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from types import TracebackType


class ServedBoard:
    """`truing board` on a free TCP port and on a pseudo-terminal with a known name; on CAN where asked."""

    def __init__(self, folder: Path, speed: str = "1", can: Path | None = None) -> None:
        self.link = folder / "robot"
        command = [sys.executable, "-m", "truing", "board", "--json", "--tcp", "0", "--link", str(self.link)]
        command += [] if can is None else ["--can", str(can)]
        self.process = subprocess.Popen(
            [*command, "--speed", speed], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        assert self.process.stdout is not None
        said = ""
        while not said.rstrip().endswith("}"):
            line = self.process.stdout.readline()
            assert line, f"the board did not start: {said}"
            said += line
        self.tcp, self.pty, *_ = json.loads(said)["ports"]

    def __enter__(self) -> ServedBoard:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()

    def kill(self) -> None:
        """End it as a pulled cable would: at once."""
        self.process.kill()
        self.process.wait(10)
        if self.process.stdout is not None:
            self.process.stdout.close()

    def truing(self, *arguments: str) -> list[str]:
        """The command line that talks to this board through TCP."""
        return [sys.executable, "-m", "truing", "--port", self.tcp, *arguments]
