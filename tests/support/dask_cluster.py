"""A Dask cluster in processes of its own, as a user starts one: `dask scheduler`, `dask worker`."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
# Nothing is timed by it; it only ends a wait that would last for ever.
PATIENCE_S = 120.0


@dataclass
class Cluster:
    """A scheduler, and workers whose nurse starts them again when they die."""

    address: str
    scheduler: subprocess.Popen[bytes]
    nurse: subprocess.Popen[bytes]

    def kill_scheduler(self) -> None:
        self.scheduler.send_signal(signal.SIGKILL)

    def stop(self) -> None:
        for process in (self.nurse, self.scheduler):
            process.terminate()
        for process in (self.nurse, self.scheduler):
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait(20.0)


@contextmanager
def cluster_of_processes(folder: Path, workers: int = 1) -> Iterator[Cluster]:
    """Start it in a folder; one worker may die with a task, the second time the task is given up."""
    file, log_file = folder / "scheduler.json", folder / "log"
    environment = os.environ | {
        "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1",
        "PYTHONPATH": str(TESTS),
    }
    with log_file.open("wb") as log:

        def start(name: str, *arguments: str) -> subprocess.Popen[bytes]:
            command = [sys.executable, "-m", f"distributed.cli.{name}", "--no-dashboard", *arguments]
            return subprocess.Popen(command, cwd=folder, env=environment, stdout=log, stderr=log)

        scheduler = start(
            "dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file)
        )
        wait_for(lambda: file.exists() and file.read_text(encoding="utf-8").endswith("}"), log_file)
        of_workers = ("--nworkers", str(workers), "--nthreads", "1", "--local-directory", str(folder))
        nurse = start("dask_worker", "--scheduler-file", str(file), *of_workers)
        cluster = Cluster(json.loads(file.read_text(encoding="utf-8"))["address"], scheduler, nurse)
        try:
            yield cluster
        finally:
            cluster.stop()


def wait_for(condition: Callable[[], object], log: Path | None = None) -> None:
    """Wait until it holds; a test that waits in vain shows the log."""
    begin = time.monotonic()
    while not condition():
        assert time.monotonic() - begin < PATIENCE_S, "" if log is None else log.read_text(encoding="utf-8")
        time.sleep(0.02)
