"""Resident memory of a process and of the helpers that it started."""

from __future__ import annotations

from pathlib import Path


def resident_mb(pid: int) -> float:
    """Resident set of one process."""
    for line in Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024.0
    raise RuntimeError(f"process {pid} is gone")


def helpers_mb(pid: int) -> float:
    """Resident sets of the processes that a process started, by its threads."""
    found = 0.0
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in (task / "children").read_text().split():
            found += resident_mb(int(child))
    return found
