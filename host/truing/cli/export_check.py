"""What `truing export --into` and `--check` do and show."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from truing.cli.app import App

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from truing.exporters import ExportOptions
    from truing.exporters.carried import Check
    from truing.exporters.recorded import Task
    from truing.model.robot_model import RobotModel
    from truing.recording.run import RecordingSet

CANNOT = "cannot hold it"


def read_recordings(runs: Path, model: RobotModel) -> RecordingSet:
    """The recordings, with the model's geometry where they have none."""
    from truing.importers import read_runs

    recordings = read_runs(runs)
    return recordings if recordings.robot is not None else recordings.with_geometry(model.robot)


def put_into(
    app: App,
    model: RobotModel,
    path: Path,
    out: Path | None,
    runs: Path | None,
    options: ExportOptions,
    *,
    keep: str | None,
    joints: str | None,
) -> dict[str, Any]:
    """Patch a user's file: say what changes, show it, check it on recordings, write it."""
    from truing.errors import OutputError
    from truing.exporters.into import patched
    from truing.exporters.recorded import tasks

    made = patched(path, model, options, keep=keep, joints=_pair(joints))
    app.say(made.diff().rstrip("\n"))
    for line in made.lines:
        app.say(f"note: {line}")
    found: dict[str, Any] = {"file": str(path), "kind": made.kind, "joints": list(made.joints)}
    found |= {"kept": made.patch.kept, "notes": list(made.lines), "diff": made.diff()}
    if runs is not None:
        errors = made.errors_mps(tasks(read_recordings(runs, model)))
        own_mps = _own_error(tasks(read_recordings(runs, model)), model)
        if errors is None:
            app.say(f"not checked: nothing that is installed here drives a robot from {made.kind.upper()}")
        else:
            before, after = errors
            found |= {"before_mps": before, "after_mps": after, "own_mps": own_mps}
            app.say(
                f"checked in MuJoCo: {_mm(before)} before, {_mm(after)} after, on {runs}; "
                f"truing's own simulation: {_mm(own_mps)}"
            )
            if after > before:
                raise OutputError(
                    out or path,
                    f"is not written: it would be worse on {runs}, {_mm(after)} instead of {_mm(before)}",
                    "Look at what truing diagnose says of these runs, or leave --check away",
                )
    written, backup = made.write(out)
    found |= {"written": str(written), "backup": None if backup is None else str(backup)}
    app.say(f"written: {written}" + ("" if backup is None else f" (as it was: {backup})"))
    return found


def _pair(joints: str | None) -> tuple[str, str] | None:
    from truing.errors import TruingError

    if joints is None:
        return None
    names = [name.strip() for name in joints.split(",")]
    if len(names) != 2:
        raise TruingError(f"--joints {joints}: it must be two names, LEFT,RIGHT")
    return names[0], names[1]


def _own_error(all_tasks: Sequence[Task], model: RobotModel) -> float:
    from truing.exporters.consumers import own
    from truing.exporters.recorded import error_mps

    return error_mps(all_tasks, own(model), model)


def check_formats(
    app: App, model: RobotModel, runs: Path, kinds: list[str] | None, options: ExportOptions
) -> dict[str, Any]:
    """Simulate recordings in each format's program and show what each carries."""
    from dataclasses import asdict

    from truing.exporters.carried import check
    from truing.exporters.consumers import CONSUMERS

    with app.progress("simulating") as progress:
        found = check(model, read_recordings(runs, model), kinds or list(CONSUMERS), options, progress)
    app.show(_table(found, str(runs)))
    app.say(f"truing's own simulation of the whole model: {_mm(found.own_mps)}")
    for one in found.formats:
        if not one.consumer:
            app.say(f"note: {one.kind}: nothing that is installed here runs it")
    return asdict(found)


def _table(found: Check, runs: str) -> Table:
    from rich.table import Table

    table = Table(title=f"Error on {runs}, mm/s, in the program that runs each format")
    terms = sorted({term for one in found.formats for term in one.terms})
    for name in ("Format", "Run by", "As given", "Corrected", *(f"Without {term}" for term in terms)):
        table.add_column(name, justify="left" if name in ("Format", "Run by") else "right")
    for one in found.formats:
        if one.consumer:
            cells = [_number(one.given_mps), _number(one.after_mps)]
            held = [one.terms[term] for term in terms]
            cells += [CANNOT if value is None else _number(value) for value in held]
            table.add_row(one.kind, one.consumer, *cells)
    return table


def _number(value: float | None) -> str:
    return "–" if value is None else f"{1e3 * value:.3g}"


def _mm(value: float) -> str:
    return f"{1e3 * value:.3g} mm/s"
