"""Runs from disk: those that the view recorded, the paper's tests, and any that a user drops in."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from truing.baseline import Baseline, read_baseline
from truing.errors import PlanError, TruingError
from truing.plan import Plan, parse_plan
from truing.recording import Run
from truing.recording_reader import read_run
from truing.workspace import out_folder, recordings_folder

_MOST_SETS = 200


@dataclass(frozen=True, slots=True)
class FoundSet:
    """A recording set on disk."""

    name: str
    path: Path
    runs: tuple[Path, ...]


def find_sets(*more: Path) -> list[FoundSet]:
    """Every recording set in the usual folders, and those in `more`, by name."""
    roots = [out_folder(), *more]
    shared = recordings_folder()
    if shared is not None:
        roots.append(shared / "real")
    found: dict[Path, FoundSet] = {}
    for root in roots:
        if not root.is_dir():
            continue
        for runs in sorted(root.glob("**/runs"))[:_MOST_SETS]:
            files = tuple(sorted(runs.glob("*.csv")))
            folder = runs.parent.resolve()
            if files and folder not in found:
                inside = runs.parent.relative_to(root)
                name = str(inside) if inside.parts else root.name
                found[folder] = FoundSet(name, folder, files)
    return sorted(found.values(), key=lambda one: one.name)


def baseline_of(run_path: Path) -> Baseline | None:
    """The baseline of the set that a run lies in, if there is a readable one."""
    path = run_path.parent.parent / "baseline.toml"
    if not path.is_file():
        return None
    try:
        return read_baseline(path)
    except TruingError:
        return None


def plan_of_run(run: Run) -> Plan | None:
    """The plan that the run's metadata tells of."""
    content: dict[str, Any] = dict(run.metadata.plan) if run.metadata is not None else {}
    name = str(content.pop("name", run.name))
    if "segment" not in content:
        return None
    try:
        return parse_plan(content, name, f"{run.name}: plan")
    except PlanError:
        return None


def safe_name(name: str) -> str:
    """A file's name with nothing in it that means a place."""
    return "".join(c if c.isalnum() or c in "._-" else "_" for c in Path(name).name).lstrip(".")


def save_dropped(folder: Path, name: str, data: bytes) -> Path:
    """Keep a run that was dropped onto the page, once it has been seen to be one.

    Raises
    ------
    TruingError : it is no run of the contract; the message names the place.
    """
    safe = safe_name(name) or "run.csv"
    path = folder / "runs" / (safe if safe.endswith((".csv", ".json")) else f"{safe}.csv")
    path.parent.mkdir(parents=True, exist_ok=True)
    before = path.read_bytes() if path.exists() else None
    path.write_bytes(data)
    try:
        if path.suffix == ".json":
            json.loads(data)
        else:
            read_run(path)
    except (TruingError, ValueError) as error:
        if before is None:
            path.unlink()
        else:
            path.write_bytes(before)
        if isinstance(error, TruingError):
            raise
        raise TruingError(f"{name}: is not JSON") from error
    return path
