"""`truing diagnose`: where a simulation differs from recordings, and which physics it leaves out."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from truing.cli.app import App, pass_app
from truing.cli.options import axis_option, geometry_options

if TYPE_CHECKING:
    from truing.diagnose.present.text import Section
    from truing.recording.axis import Motion
    from truing.recording.baseline import RobotGeometry
    from truing.recording.run import Wheel


@click.command()
@click.argument("runs", metavar="RUNS", type=click.Path(path_type=Path))
@click.option(
    "--model",
    metavar="BASELINE.TOML",
    type=click.Path(path_type=Path),
    help="What the simulation models and its parameters.  [default: the baseline.toml beside the runs, else "
    "the first-order model that fits them best]",
)
@click.option(
    "--sim-runs",
    metavar="DIR",
    type=click.Path(path_type=Path),
    help="Output of another simulator: CSV files of the same names, rows and efforts.",
)
@click.option(
    "--json", "json_path", metavar="FILE", type=click.Path(dir_okay=False, path_type=Path),
    help="Write the verdict with all figures (docs/DATA_FORMAT.md).",
)  # fmt: skip
@click.option(
    "--report", "report_path", metavar="FILE", type=click.Path(dir_okay=False, path_type=Path),
    help="Write one HTML page that opens anywhere.",
)  # fmt: skip
@click.option(
    "--export",
    "exports",
    metavar="KIND:FILE",
    multiple=True,
    help="Write the corrected model (toml, mjcf, fmu, ...; see `truing export`) or, as params, values for "
    "the board.",
)
@click.option(
    "--next-run", "next_run", metavar="FILE", type=click.Path(dir_okay=False, path_type=Path),
    help="Write the run that would resolve an ambiguous verdict, for `truing run`.",
)  # fmt: skip
@click.option(
    "--floor", "floor_m", metavar="METRES", type=click.FloatRange(min=0.1),
    help="How far the next run may go.  [default: as far as the recorded runs went]",
)  # fmt: skip
@click.option(
    "--commanded",
    is_flag=True,
    help="Judge the pose (truth, else odometry) against what the efforts command, and no wheel.",
)
@click.option("--wheel", type=click.Choice(["left", "right"]), help="Judge this wheel alone.")
@click.option(
    "--accept",
    metavar="EFFECT+EFFECT",
    help="Take these effects for the model, whatever the verdict: names of the ranking, or parts of them.",
)
@click.option(
    "--measured",
    metavar="NAME=VALUE",
    multiple=True,
    help="A number of [robot] as measured by hand (wheel_radius_m, wheelbase_m, counts_per_rev): takes the "
    "baseline's place, and its error is ruled out.",
)
@click.option(
    "--learn",
    is_flag=True,
    help="Learn a correction for what the model leaves: shapes of one variable each, kept only if they lower "
    "the error on runs left out. Takes about 10 s more.",
)
@click.option(
    "--skeleton", "skeleton_path", metavar="FILE", type=click.Path(dir_okay=False, path_type=Path),
    help="Write the strongest learned shape as a new file of the catalogue (with --learn).",
)  # fmt: skip
@click.option("--wheels-only", is_flag=True, help="Ignore the external pose (truth_*).")
@axis_option
@geometry_options
@click.option("--jobs", type=click.IntRange(min=1), help="Threads.  [default: one for each processor]")
@pass_app
def command(
    app: App,
    runs: Path,
    model: Path | None,
    sim_runs: Path | None,
    json_path: Path | None,
    report_path: Path | None,
    exports: tuple[str, ...],
    next_run: Path | None,
    floor_m: float | None,
    commanded: bool,
    wheel: Wheel | None,
    accept: str | None,
    measured: tuple[str, ...],
    learn: bool,
    skeleton_path: Path | None,
    wheels_only: bool,
    axis: Motion | None,
    jobs: int | None,
    geometry: RobotGeometry,
) -> None:
    """Say where the simulation of BASELINE.TOML differs from RUNS, which physics it leaves out, and with what
    confidence; or that its parameters are wrong; or that no effect of the catalogue explains the mismatch.

    RUNS is a recording set, a folder of CSV files, one CSV file, or a file of another program
    (`truing import --help` lists them). The exit status is 0 whatever the verdict, 2 for bad input.

    \b
    Examples:
      truing diagnose my_robot
      truing diagnose my_robot --model baseline.toml --json verdict.json --report verdict.html
      truing diagnose my_robot --sim-runs gazebo_output
      truing diagnose my_robot --commanded
      truing diagnose my_robot --export toml:model.toml --export params:board.toml
      truing diagnose my_robot --accept friction+asymmetry --export mjcf:robot.xml
      truing diagnose my_robot --measured counts_per_rev=2400
      truing diagnose my_robot --learn --report verdict.html --export toml:model.toml
      truing diagnose my_robot --next-run next.toml && truing run next.toml --set my_robot
    """
    # Set before numpy is loaded: the matrices here are small, and threads of their own only get in the way.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with _one_line_errors():
        from truing.diagnose.diagnosis_input import Options, read_input, with_what_to_compare
        from truing.diagnose.engine import diagnose
        from truing.diagnose.measured import parse_measured
        from truing.diagnose.present.exports import parse_exports, write_exports
        from truing.diagnose.present.text import sections
        from truing.diagnose.simulation.warm import compile_once
        from truing.recording.geometry import with_axis, with_given_geometry
        from truing.recording.writer import check_output, replace_file

        wanted = parse_exports(exports)
        for path in (json_path, report_path, next_run, skeleton_path, *(export.path for export in wanted)):
            if path is not None:
                check_output(path)
        if commanded and (wheels_only or wheel is not None or sim_runs is not None):
            raise click.UsageError("--commanded goes without --wheel, --wheels-only and --sim-runs")
        accepted = () if accept is None else tuple(name.strip() for name in accept.split("+"))
        known = parse_measured(measured)
        found = with_given_geometry(with_axis(read_input(runs, model), axis), geometry)
        options = Options(sim_runs, wheels_only, jobs, floor_m, commanded, wheel, accepted, known, learn)
        options = options.suiting(found)
        recordings = with_what_to_compare(found, options, app.note)
        compile_once(app.note, wheels=len(recordings.wheels))
        with app.progress("diagnosing") as progress:
            diagnosis = diagnose(recordings, options, progress)
        board = recordings.is_from_board or not app.is_virtual
        say_sections(app, sections(diagnosis, board=board, axis=recordings.axis))
        if json_path is not None:
            text = json.dumps(diagnosis.to_json(), indent=2, allow_nan=False) + "\n"
            replace_file(json_path, text.encode("utf-8"))
            app.say(f"written: {json_path}")
        if report_path is not None:
            from truing.diagnose.present.page import save_report

            save_report(recordings, diagnosis, report_path, board=board)
            app.say(f"written: {report_path}")
        for line in write_exports(wanted, recordings, diagnosis, options.wheel) if wanted else []:
            has_path = line.startswith("written")
            app.say(line if recordings.axis is None or has_path else recordings.axis.text(line))
        if skeleton_path is not None:
            from truing.diagnose.learned.skeleton import write_skeleton

            write_skeleton(diagnosis.learned, skeleton_path)
            app.say(f"written: {skeleton_path}")
        if next_run is not None and diagnosis.next_experiment is not None:
            replace_file(next_run, diagnosis.next_experiment.plan.to_toml().encode("utf-8"))
            app.say(f"written: {next_run}")
        elif next_run is not None:
            app.say(f"not written: {next_run} (no ambiguity is left)")
    app.emit(diagnosis.to_json())


@contextmanager
def _one_line_errors() -> Iterator[None]:
    """Put the next step into the message: other programs read one line."""
    from truing.errors import TruingError

    try:
        yield
    except TruingError as error:
        if error.next_step:
            error.message, error.next_step = f"{error.message}. {error.next_step}", ""
        raise


def say_sections(app: App, sections: Iterable[Section]) -> None:
    """Print a diagnosis, wrapped at one width."""
    from truing.diagnose.present.text import wrapped

    for line in wrapped(sections):
        app.say(line)
