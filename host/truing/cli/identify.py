"""`truing identify`: gains, time constants and first-order models of recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from truing.cli.app import App
from truing.cli.options import axis_option, geometry_options, json_option

if TYPE_CHECKING:
    from truing.identify.identification import Identification
    from truing.recording.axis import Motion
    from truing.recording.baseline import RobotGeometry


@click.command()
@click.argument("runs", metavar="RUNS", type=click.Path(path_type=Path))
@click.option(
    "--model",
    metavar="BASELINE.TOML",
    type=click.Path(path_type=Path),
    help="Geometry that turns counts into metres.  [default: the baseline.toml beside the runs, if any]",
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for report.html, a PNG of each run, and the tables as CSV and JSON.",
)
@click.option(
    "--write-baseline", metavar="FILE", type=click.Path(dir_okay=False, path_type=Path),
    help="Write gains, time constants and geometry as a baseline.toml.",
)  # fmt: skip
@click.option("--shapes", is_flag=True, help="Also print dead time, overshoot and ripple of every step.")
@axis_option
@geometry_options
@json_option
def command(
    app: App,
    runs: Path,
    model: Path | None,
    out: Path | None,
    write_baseline: Path | None,
    shapes: bool,
    axis: Motion | None,
    geometry: RobotGeometry,
) -> None:
    """Print gain and time constants of RUNS: a recording set, a folder of CSV files, one CSV file,
    or a file of another program (`truing import --help` lists them).

    Steps give a gain and a time constant each; a first-order model is fitted to all runs
    together by free-run simulation. What cannot be determined says why.

    \b
    Examples:
      truing identify out/recordings/virtual
      truing identify my_robot --model baseline.toml --out out/my_robot
      truing identify run.csv --counts-per-rev 2400 --wheel-radius 0.035 --write-baseline baseline.toml
      truing identify my_robot/runs/01_step.csv --json
      truing identify sysid_data.json
      truing identify arm.json --axis rotation
    """
    from truing.extras import require
    from truing.identify.identification import identify_set
    from truing.importers import read_runs
    from truing.recording.geometry import with_axis
    from truing.recording.writer import check_output

    if out is not None:
        require("plots")
        check_output(out, folder=True)
    if write_baseline is not None:
        check_output(write_baseline)
    recordings = with_axis(read_runs(runs, model, geometry=geometry), axis)
    with app.progress("identifying") as progress:
        result = identify_set(recordings, progress)
    if write_baseline is not None:
        result.robot_model().save(write_baseline)  # first: a closed pipe ends the printing
    app.emit(result.to_json())
    show(app, result, str(runs), shapes=shapes)
    if write_baseline is not None:
        app.say(f"written: {write_baseline}")
    if out is not None:
        from truing.report.identification_files import save_identification

        with app.progress("drawing") as progress:
            for path in save_identification(recordings, result, out, progress):
                app.say(f"written: {path}")


def show(app: App, result: Identification, runs: str = "RUNS", *, shapes: bool = False) -> None:
    """Print three lines, findings and tables.

    Parameters
    ----------
    runs : the path that the user gave.
    shapes : also the table of dead times, overshoots and ripple.
    """
    from truing.identify.summary import identified_lines
    from truing.identify.tables import finding_lines, result_tables, unstepped

    for line in identified_lines(result, runs):
        app.say(line)
    app.say()
    for line in finding_lines(result):
        app.say(line)
    for table in result_tables(result, shapes=shapes):
        app.show(table.to_rich())
    for line in unstepped(result):
        app.say(line)
