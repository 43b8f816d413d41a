"""`truing plan`: the run plans that come with truing, and checking one's own."""

from __future__ import annotations

import click

from truing.cli.app import App
from truing.cli.options import json_option


@click.group(no_args_is_help=True)
def command() -> None:
    """List, show and check run plans; nothing moves.

    \b
    Examples:
      truing plan list
      truing plan show paper/XI
      truing plan show my_plan.toml
    """


@command.command("list")
@json_option
def list_(app: App) -> None:
    """List the plans that come with truing.

    \b
    Example:
      truing plan list
    """
    from rich.table import Table

    from truing.plan import built_in_names, load_plan

    plans = [load_plan(name) for name in built_in_names()]
    app.emit([{"name": plan.name, "title": plan.title, "duration_s": plan.duration_s} for plan in plans])
    table = Table("plan", "seconds", "what it does")
    for plan in plans:
        table.add_row(plan.name, f"{plan.duration_s:.0f}", plan.title)
    app.show(table)


@command.command()
@click.argument("plan", metavar="PLAN")
@click.option("--toml", is_flag=True, help="Print the file itself, to start your own from.")
@json_option
def show(app: App, plan: str, toml: bool) -> None:
    """Check a plan and show its segments, the floor it needs and its top speed.

    \b
    Examples:
      truing plan show paper/XI
      truing plan show paper/XI --toml > my_plan.toml
    """
    from dataclasses import asdict

    from rich.table import Table

    from truing.floor import estimate_floor
    from truing.plan import BUILT_IN_FOLDER, Kind, load_plan

    loaded = load_plan(plan)
    if toml:
        file = BUILT_IN_FOLDER / f"{loaded.name}.toml"
        from pathlib import Path

        click.echo((file if file.is_file() else Path(plan)).read_text(encoding="utf-8"), nl=False)
        return
    need = estimate_floor(loaded)
    app.emit(loaded.to_dict() | {"floor": asdict(need)})
    app.say(loaded.title)
    table = Table("#", "seconds", "kind", "left or v", "right or omega")
    units = {Kind.EFFORT: ("%", 100.0), Kind.VELOCITY: ("m/s", 1.0), Kind.TWIST: ("m/s, rad/s", 1.0)}
    for number, segment in enumerate(loaded.segments, 1):
        unit, scale = units[segment.kind]
        table.add_row(
            str(number),
            f"{segment.duration_s:g}",
            f"{segment.kind.name.lower()} ({unit})",
            f"{segment.a * scale:g}",
            f"{segment.b * scale:g}",
        )
    app.show(table)
    app.say(need.sentence())
