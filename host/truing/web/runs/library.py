"""Runs on disk: recorded by the view, the paper's tests, and files that a user has dropped onto a page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from truing.errors import PlanError, TruingError
from truing.plan import Plan, parse_plan
from truing.recording.baseline import Baseline, read_baseline
from truing.recording.run import Run
from truing.workspace import out_folder, recordings_folder

_MAX_SETS = 200


@dataclass(frozen=True, slots=True)
class FoundSet:
    """A recording set on disk."""

    name: str
    path: Path
    runs: tuple[Path, ...]


def find_sets(*more: Path) -> list[FoundSet]:
    """All recording sets in the standard folders and in `more`, sorted by name."""
    roots = [out_folder(), *more]
    shared = recordings_folder()
    if shared is not None:
        roots.append(shared / "real")
    found: dict[Path, FoundSet] = {}
    for root in roots:
        if not root.is_dir():
            continue
        for runs in sorted(root.glob("**/runs"))[:_MAX_SETS]:
            files = tuple(sorted(runs.glob("*.csv")))
            folder = runs.parent.resolve()
            if files and folder not in found:
                inside = runs.parent.relative_to(root)
                name = str(inside) if inside.parts else root.name
                found[folder] = FoundSet(name, folder, files)
    return sorted(found.values(), key=lambda one: one.name)


def baseline_of(run_path: Path) -> Baseline | None:
    """The baseline of the run's set, if there is a readable one."""
    path = run_path.parent.parent / "baseline.toml"
    if not path.is_file():
        return None
    try:
        return read_baseline(path)
    except TruingError:
        return None


def plan_of_run(run: Run) -> Plan | None:
    """The plan in the run's metadata."""
    content: dict[str, Any] = dict(run.metadata.plan) if run.metadata is not None else {}
    name = str(content.pop("name", run.name))
    if "segment" not in content:
        return None
    try:
        return parse_plan(content, name, f"{run.name}: plan")
    except PlanError:
        return None


def safe_name(name: str) -> str:
    """A file name without path separators or other special characters."""
    return "".join(c if c.isalnum() or c in "._-" else "_" for c in Path(name).name).lstrip(".")
