"""What `truing export --into` and `--check` do and show."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truing.cli.app import App

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from truing.exporters import ExportOptions
    from truing.exporters.carried import Check
    from truing.exporters.into import PatchedFile
    from truing.exporters.recorded import Task
    from truing.model.robot_model import RobotModel
    from truing.recording.run import RecordingSet

CANNOT = "cannot hold it"


def read_recordings(runs: Path, model: RobotModel) -> RecordingSet:
    """The recordings, with the model's geometry where they have none."""
    from truing.importers import read_runs

    recordings = read_runs(runs)
    return recordings if recordings.robot is not None else recordings.with_geometry(model.robot)


@dataclass(frozen=True)
class Wish:
    """What the user asked of `--into`."""

    path: Path
    out: Path | None
    runs: Path | None
    keep: str | None
    joints: str | None
    is_refined: bool


def put_into(app: App, model: RobotModel, wish: Wish, options: ExportOptions) -> dict[str, Any]:
    """Patch a user's file: say what changes, show it, check it on recordings, write it."""
    from truing.exporters.into import patched
    from truing.exporters.recorded import tasks

    keep, joints = wish.keep, _pair(wish.joints)
    found: dict[str, Any] = {}
    judges = [] if wish.runs is None else tasks(read_recordings(wish.runs, model))
    for task in judges:
        if task.left_out:
            app.say(f"note: {task.left_out}")
    if wish.is_refined:
        model, keep, judges, found["refined"] = _refined(app, model, wish, options, judges)
    made = patched(wish.path, model, options, keep=keep, joints=joints)
    app.say(made.diff().rstrip("\n"))
    for line in made.lines:
        app.say(f"note: {line}")
    found |= {"file": str(wish.path), "kind": made.kind, "joints": list(made.joints)}
    found |= {"kept": made.patch.kept, "notes": list(made.lines), "diff": made.diff()}
    if wish.runs is not None:
        found |= _checked(app, made, wish, judges)
    written, backup = made.write(wish.out)
    found |= {"written": str(written), "backup": None if backup is None else str(backup)}
    app.say(f"written: {written}" + ("" if backup is None else f" (as it was: {backup})"))
    return found


def _refined(
    app: App, model: RobotModel, wish: Wish, options: ExportOptions, all_tasks: list[Task]
) -> tuple[RobotModel, str, list[Task], dict[str, Any]]:
    """The model fitted through the user's file, what was kept, and the runs that judge."""
    from truing.exporters.refine import divided, refine

    fitted, judges = divided(all_tasks)
    joints = _pair(wish.joints)
    with app.progress("fitting through your file") as progress:
        found = refine(wish.path, model, fitted, options, keep=wish.keep, joints=joints, progress=progress)
    runs = f"{len(fitted)} runs" if len(fitted) != 1 else "1 run"
    app.say(f"fitted to {runs} through {wish.path}: {_mm(found.before_mps)} -> {_mm(found.after_mps)}")
    for line in found.lines():
        app.say(f"  {line}")
    refined = {"runs": len(fitted), "before_mps": found.before_mps, "after_mps": found.after_mps}
    return found.model, found.keep, judges or fitted, refined | {"model": found.model.to_toml()}


def _checked(app: App, made: PatchedFile, wish: Wish, judges: list[Task]) -> dict[str, Any]:
    """Errors before and after in the program that runs the file; worse is refused."""
    from truing.errors import OutputError

    errors = made.errors_mps(judges)
    if errors is None:
        app.say(f"not checked: nothing that is installed here drives a robot from {made.kind.upper()}")
        return {}
    before, after = errors
    own_mps = _own_error(judges, made.model)
    names = ", ".join(task.name for task in judges)
    where = f"{wish.runs}" + (f" (left out: {names})" if wish.is_refined else "")
    app.say(
        f"checked in MuJoCo on {where}: {_mm(before)} before, {_mm(after)} after; "
        f"truing's own simulation of two wheels: {_mm(own_mps)}"
    )
    if after > before:
        raise OutputError(
            wish.out or wish.path,
            f"is not written: it would be worse on {where}, {_mm(after)} instead of {_mm(before)}",
            "Try --refine, look at what truing diagnose says of these runs, or leave --check away",
        )
    return {"judges": names, "before_mps": before, "after_mps": after, "own_mps": own_mps}


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
    for line in found.left_out:
        app.say(f"note: {line}")
    for one in found.formats:
        if not one.consumer:
            app.say(f"note: {one.kind}: not run: {one.why_not}")
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
