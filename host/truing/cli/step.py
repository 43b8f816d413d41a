"""`truing step`: one quick step, driven and identified."""

from __future__ import annotations

from pathlib import Path

import click

from truing.cli.app import App
from truing.cli.options import board_options


@click.command()
@click.option(
    "--effort", type=click.FloatRange(-1.0, 1.0), help="Height of the step as a share of the supply."
)
@click.option(
    "--velocity", type=click.FloatRange(-10.0, 10.0), help="Height of the step in m/s, in velocity mode."
)
@click.option("--duration", type=click.FloatRange(0.1, 60.0), default=2.0, show_default=True, help="Seconds.")
@click.option("--wheel", type=click.Choice(["both", "left", "right"]), default="both", show_default=True)
@click.option("--rate", type=click.IntRange(1, 200), default=20, show_default=True, help="Log rate, Hz.")
@click.option(
    "--set",
    "folder",
    type=click.Path(file_okay=False, path_type=Path),
    help="Recording set to add the run to.  [default: out/recordings/BOARD]",
)
@click.option("--yes", is_flag=True, help="Do not ask before a real robot moves.")
@board_options
def command(
    app: App,
    effort: float | None,
    velocity: float | None,
    duration: float,
    wheel: str,
    rate: int,
    folder: Path | None,
    yes: bool,
) -> None:
    """Drive one step from rest and back to rest, and print its gain and time constants.

    \b
    Examples:
      truing step --effort 0.4 --duration 2
      truing --port /dev/ttyUSB0 step --velocity 0.3 --wheel left
    """
    from truing.cli.driving import drive_and_save
    from truing.identify.identification import identify_set
    from truing.identify.tables import result_tables
    from truing.plan import Kind, Plan, Segment
    from truing.recording.reader import read_recording_set

    if (effort is None) == (velocity is None):
        raise click.UsageError("give either --effort or --velocity, for example: truing step --effort 0.4")
    kind, height = (Kind.EFFORT, effort) if effort is not None else (Kind.VELOCITY, velocity)
    assert height is not None
    left, right = (height if wheel in ("both", side) else 0.0 for side in ("left", "right"))
    what = f"{height:.0%} effort" if kind is Kind.EFFORT else f"{height:g} m/s"
    rest = Segment(Kind.EFFORT, 1.0, 0.0, 0.0)
    plan = Plan(
        name="step",
        title=f"Step of {what}, {wheel}, {duration:g} s",
        segments=(rest, Segment(kind, duration, left, right), Segment(Kind.EFFORT, 1.5, 0.0, 0.0)),
        log_rate_hz=rate,
    )
    saved = drive_and_save(app, plan, folder, "step", ask=not yes)
    baseline = saved.path.parent.parent / "baseline.toml"
    result = identify_set(read_recording_set(saved.path, baseline))
    app.emit(saved.to_dict() | {"identification": result.to_json()})
    for table in result_tables(result):
        app.show(table.to_rich())
    app.say(f"written: {saved.path}")
