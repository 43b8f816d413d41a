"""`truing fit`: models of both wheels, judged by free-run simulation on runs that they never saw."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from truing.cli.app import App
from truing.cli.options import axis_option, geometry_options, json_option

if TYPE_CHECKING:
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
    "--more", is_flag=True, help="Also try breakaway, Stribeck, asymmetry, lags, filters, drag, supply."
)
@click.option(
    "--out", metavar="MODEL.TOML", type=click.Path(dir_okay=False, path_type=Path),
    help="Write the chosen models as a file that is a baseline too.",
)  # fmt: skip
@click.option(
    "--report", metavar="DIR", type=click.Path(file_okay=False, path_type=Path),
    help="Write report.html (interactive), fit.json, and every table as CSV and PNG.",
)  # fmt: skip
@axis_option
@geometry_options
@json_option
def command(
    app: App,
    runs: Path,
    model: Path | None,
    more: bool,
    out: Path | None,
    report: Path | None,
    axis: Motion | None,
    geometry: RobotGeometry,
) -> None:
    """Fit models to RUNS: a recording set, a folder of CSV files, one CSV file, or a file
    of another program (`truing import --help` lists them).

    A wheel's physics (gain, time constant, friction, delay), an ARX model and a state-space model are
    fitted to all runs together. Errors are of free-run simulation, in per cent of the 98th percentile
    of |speed|, on the fitted runs and on each run when it is left out; one-step errors say so.

    \b
    Examples:
      truing fit my_robot
      truing fit run.csv --counts-per-rev 2400 --wheel-radius 0.035
      truing fit motor.csv --axis rotation
      truing fit my_robot --more --out out/my_robot/model.toml
      truing fit my_robot --report out/my_robot/fit
    """
    # Set before numpy is loaded: the matrices here are small, and a second thread for each of them only
    # gets in the way of the thread that fits the other wheel.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from truing.extras import require
    from truing.identify.model_ladder import fit_models
    from truing.identify.model_tables import model_tables
    from truing.identify.summary import fitted_lines
    from truing.importers import read_runs
    from truing.recording.geometry import with_axis
    from truing.recording.writer import check_output

    for path, folder in ((out, False), (report, True)):
        if path is not None:
            check_output(path, folder=folder)
    if report is not None:
        require("plots")
    recordings = with_axis(read_runs(runs, model, geometry=geometry), axis)
    with app.progress("fitting") as progress:
        models = fit_models(recordings, richer=more, progress=progress)
    if out is not None:
        models.robot_model().save(out)  # first: a closed pipe ends the printing
    app.emit(models.to_json())
    for line in fitted_lines(models, str(runs)):
        app.say(line)
    app.say()
    for table in model_tables(models):
        app.show(table.to_rich())
    if out is not None:
        app.say(f"written: {out}")
        for side, reason in models.refused.items():
            app.say(f"note: the {side} wheel in it is a copy of the other one, not fitted: {reason}")
    if report is not None:
        from truing.report.fit_page import save_fit

        with app.progress("writing") as progress:
            written = save_fit(recordings, models, report, progress)
        app.say(f"written: {written[0]} and {len(written) - 1} files beside it")
