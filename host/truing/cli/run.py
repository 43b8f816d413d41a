"""`truing run`: drives a plan and writes what the board logged."""

from __future__ import annotations

from pathlib import Path

import click

from truing.cli.app import App
from truing.cli.foxglove_options import foxglove_options
from truing.cli.options import board_options


@click.command()
@click.argument("plan", metavar="PLAN")
@click.option(
    "--set",
    "folder",
    type=click.Path(file_okay=False, path_type=Path),
    help="Recording set to add the run to.  [default: out/recordings/BOARD]",
)
@click.option("--name", help="What to call the run, after its number.  [default: the plan's name]")
@click.option("--yes", is_flag=True, help="Do not ask before a real robot moves.")
@foxglove_options
@board_options
def command(
    app: App,
    plan: str,
    folder: Path | None,
    name: str | None,
    yes: bool,
    foxglove: str | None,
    floor_map: Path | None,
) -> None:
    """Drive PLAN, fetch its log, and add it to a recording set as its next run.

    PLAN is the name of a plan that comes with truing (`truing plan list`) or a TOML file. Before anything
    moves, truing says how much floor the plan needs and how fast the robot will go. Ctrl-C stops the wheels.
    With --foxglove its signals, pose and faults can be watched in Foxglove while it drives.

    \b
    Examples:
      truing run paper/XI
      truing --port /dev/ttyUSB0 run my_plan.toml --set my_robot --foxglove
    """
    from truing.cli.driving import drive_and_save
    from truing.plan import load_plan

    loaded = load_plan(plan)
    label = name or loaded.name.replace("/", "_")
    serve = None if foxglove is None else (foxglove, floor_map)
    saved = drive_and_save(app, loaded, folder, label, ask=not yes, serve=serve)
    app.emit(saved.to_dict())
    app.say(
        f"log {saved.fetched.log.log_id}: {len(saved.run)} records at {saved.fetched.log.rate_hz} Hz, "
        f"{saved.fetched.report.bytes} bytes, digest {saved.fetched.report.crc32:08x} as on the board"
    )
    app.say(f"written: {saved.path}")
    app.say(f"  next: truing identify {saved.path.parent.parent}")
