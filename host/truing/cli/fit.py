"""`truing fit`: models of both wheels, judged by free-run simulation on runs that they never saw."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from truing.cli.app import App
from truing.cli.options import json_option

if TYPE_CHECKING:
    from rich.table import Table

    from truing.identify.model_ladder import SetModels, WheelModels


@click.command()
@click.argument("runs", metavar="RUNS", type=click.Path(path_type=Path))
@click.option(
    "--model",
    metavar="BASELINE.TOML",
    type=click.Path(path_type=Path),
    help="Geometry that turns counts into metres.  [default: the baseline.toml beside the runs]",
)
@click.option(
    "--more", is_flag=True, help="Also try breakaway, Stribeck, asymmetry, lags, filters, drag, supply."
)
@click.option(
    "--out", metavar="MODEL.TOML", type=click.Path(dir_okay=False, path_type=Path),
    help="Write the chosen models as a file that is a baseline too.",
)  # fmt: skip
@json_option
def command(app: App, runs: Path, model: Path | None, more: bool, out: Path | None) -> None:
    """Fit models to RUNS: a recording set, a folder of CSV files, one CSV file, or a file
    of another program (`truing import --help` lists them).

    A wheel's physics (gain, time constant, friction, delay), an ARX model and a state-space model are
    fitted to all runs together. Errors are of free-run simulation, in per cent of the 98th percentile
    of |speed|, on the fitted runs and on each run when it is left out; one-step errors say so.

    \b
    Examples:
      truing fit my_robot
      truing fit my_robot --more --out out/my_robot/model.toml
    """
    # Set before numpy is loaded: the matrices here are small, and a second thread for each of them only
    # gets in the way of the thread that fits the other wheel.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from truing.identify.model_ladder import fit_models
    from truing.importers import read_runs

    recordings = read_runs(runs, model)
    with app.progress("fitting") as progress:
        models = fit_models(recordings, richer=more, progress=progress)
    app.emit(models.to_json())
    app.show(_errors_table(models))
    for wheel in models.wheels:
        app.show(_parameters_table(wheel))
        for note in (*wheel.chosen.notes, *wheel.missing):
            app.say(f"! {wheel.wheel}: {note}")
    for side, reason in models.refused.items():
        app.say(f"! {side}: not fitted: {reason}")
    if out is not None:
        models.robot_model().save(out)
        app.say(f"written: {out}")


def _errors_table(models: SetModels) -> Table:
    from rich.table import Table

    table = Table(title=f"{models.name}: error, % of the 98th percentile of |speed|")
    table.add_column("wheel")
    table.add_column("model")
    for column in ("free run", "free run, left-out runs", "one step, left-out runs"):
        table.add_column(column, justify="right")
    for wheel in models.wheels:
        for step in wheel.steps:
            mark = " *" if step is wheel.chosen else ""
            held_out = "" if step.held_out is None else f"{step.held_out.percent:.2f}"
            free_run = f"{step.free_run.percent:.2f}"
            table.add_row(wheel.wheel, step.structure.name + mark, free_run, held_out, "")
        for name, fit in (("ARX", wheel.arx), ("state space", wheel.state_space)):
            if fit is None:
                continue
            one_step = 100.0 * fit.held_out_one_step.rms_mps / fit.free_run.scale_mps
            table.add_row(
                wheel.wheel,
                name,
                f"{fit.free_run.percent:.2f}",
                f"{fit.held_out_free_run.percent:.2f}",
                f"{one_step:.2f}",
            )
    return table


def _parameters_table(wheel: WheelModels) -> Table:
    from rich.table import Table

    table = Table(title=f"{wheel.wheel} wheel: {wheel.chosen.structure.name}")
    for column in ("parameter", "value", "95 % interval", "unit"):
        table.add_column(column, justify="left" if column in ("parameter", "unit") else "right")
    for name, quantity in wheel.chosen.parameters.items():
        if quantity.value is None:
            table.add_row(name, "unknown", quantity.reason or "", quantity.unit)
            continue
        low, high = quantity.ci95 or (float("nan"), float("nan"))
        table.add_row(name, f"{quantity.value:.4g}", f"{low:.4g} to {high:.4g}", quantity.unit)
    return table
