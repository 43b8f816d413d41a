"""`truing plot`: pictures of recordings."""

from __future__ import annotations

from pathlib import Path

import click

from truing.cli.app import App
from truing.cli.options import json_option


@click.command()
@click.argument("runs", metavar="RUN", type=click.Path(path_type=Path))
@click.option(
    "--model",
    metavar="BASELINE.TOML",
    type=click.Path(path_type=Path),
    help="Geometry of the robot.  [default: the baseline.toml beside the run]",
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for the pictures.  [default: out/plots/NAME in the project]",
)
@json_option
def command(app: App, runs: Path, model: Path | None, out: Path | None) -> None:
    """Draw RUN (or every run of a recording set): wheel speeds, efforts and path.

    Each run becomes a PNG, and all together one HTML page with interactive plots that needs no network.

    \b
    Examples:
      truing plot out/recordings/virtual/runs/01_paper_XI.csv
      truing plot my_robot --out out/pictures
    """
    from truing.extras import require
    from truing.identify.identification import identify_set
    from truing.importers import read_runs
    from truing.report.plot import save_png
    from truing.report.run_page import save_report
    from truing.report.run_view import view_run
    from truing.workspace import out_folder

    require("plots")
    recordings = read_runs(runs, model)
    folder = out if out is not None else out_folder() / "plots" / recordings.name
    written = []
    with app.progress("drawing") as progress:
        result = identify_set(recordings, lambda share: progress(0.3 * share))
        for number, run in enumerate(recordings, start=1):
            view = view_run(run, recordings.robot, result.whole_fits)
            written.append(save_png(view, folder / f"{run.name}.png"))
            progress(0.3 + 0.6 * number / len(recordings))
        written.append(save_report(recordings, result, folder / "report.html"))
    app.emit({"written": [str(path) for path in written]})
    for path in written:
        app.say(f"written: {path}")
