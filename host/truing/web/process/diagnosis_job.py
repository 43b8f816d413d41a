"""The running diagnosis, if any: started, monitored and cancelled by the pages, in a process of its own."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from truing.errors import TruingError
from truing.web.runs.library import safe_name


@dataclass(frozen=True, slots=True)
class DiagnosisState:
    """State of the diagnosis.

    Attributes
    ----------
    stage : `none`, `running`, `done`, `failed` or `cancelled`.
    """

    stage: str = "none"
    runs: Path | None = None
    result: Path | None = None
    progress: float = 0.0
    problem: str = ""


class DiagnosisJob:
    """One diagnosis at a time.

    Parameters
    ----------
    folder : for the results.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.state = DiagnosisState()
        self._process: subprocess.Popen[bytes] | None = None

    def result_of(self, name: str) -> Path:
        """Path of the diagnosis of the set with this name."""
        return self.folder / f"{safe_name(name.replace('/', '-'))}.json"

    def start(self, runs: Path, name: str) -> None:
        """Start.

        Raises
        ------
        TruingError : another one is running.
        """
        if self.state.stage == "running":
            raise TruingError("a diagnosis is already running", "wait until it ends, or cancel it")
        result = self.result_of(name)
        self.state = DiagnosisState("running", runs, result)
        process = self._process = subprocess.Popen(
            [sys.executable, "-m", "truing.web.process.diagnosis_main", str(runs), str(result)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            # A process group of its own: it ends as a whole, and Ctrl-C reaches only the view.
            start_new_session=True,
        )
        threading.Thread(target=self._listen, args=(process,), name="diagnosis", daemon=True).start()

    def cancel(self) -> None:
        """End it now; results of an earlier one are kept."""
        process = self._process
        if process is None or self.state.stage != "running":
            return
        self.state = replace(self.state, stage="cancelled")
        _end(process)

    def close(self) -> None:
        """End it when the view ends."""
        if self._process is not None:
            _end(self._process)

    def _listen(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        last: dict[str, Any] = {}
        with process.stdout:
            for line in process.stdout:
                with contextlib.suppress(ValueError):
                    last = json.loads(line)
                    if self._process is process and self.state.stage == "running" and "progress" in last:
                        self.state = replace(self.state, progress=float(last["progress"]))
        process.wait()
        if self._process is not process or self.state.stage != "running":
            return
        if last.get("done"):
            self.state = replace(self.state, stage="done", progress=1.0)
        else:
            parts = (
                last.get("error", f"its process ended with status {process.returncode}"),
                last.get("next"),
            )
            self.state = replace(
                self.state, stage="failed", problem=". ".join(part for part in parts if part)
            )


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(5.0)
