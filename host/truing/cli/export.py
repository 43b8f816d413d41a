"""`truing export`: a model becomes the file of a simulator or a controller, runs those of a dashboard."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from truing.cli.app import App
from truing.cli.export_check import Wish, check_formats, put_into
from truing.cli.options import POSITIVE, json_option

if TYPE_CHECKING:
    from truing.exporters import ExportOptions
    from truing.model.robot_model import RobotModel

# Kind, and what it is; a test keeps this equal to the exporters, which take time to import.
KINDS: dict[str, str] = {
    "toml": "the whole model; also a baseline.toml for truing diagnose",
    "mat": "every parameter as a MATLAB structure: model.left.gain_mps, ...",
    "c": "one C file with robot_step(robot, seconds, efforts), needs no library but libm",
    "c-header": "parameters of the board: feedforward ks, kv, ka and the geometry",
    "python": "one file with simulate(times, efforts), needs no package",
    "simulink": "state space A, B, C, D, Ts and delay (.mat) with a script (.m)",
    "urdf": "joint damping, friction, limits and inertia",
    "sdf": "joint damping, friction, limits and inertia for Gazebo",
    "mjcf": "damping, frictionloss, armature and actuators for MuJoCo",
    "ros2-control": "diff_drive_controller parameters: geometry, speed and acceleration limits",
    "wpilib": "feedforward gains kS, kV, kA",
    "fmu": "FMI 2.0 co-simulation unit for Linux on x86-64, with its C sources",
}

# What is made of recordings instead of a model.
OF_RUNS = {"mcap": "a file per run for Foxglove (and `truing import`); the argument is a set or a file"}


class _Command(click.Command):
    """A command whose help lists the kinds below its options."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        with formatter.section("Kinds"):
            formatter.write_dl(
                [
                    *KINDS.items(),
                    ("all", "every one of these that the model has enough for"),
                    *OF_RUNS.items(),
                ]
            )


@click.command(cls=_Command, no_args_is_help=True)
@click.argument("model", metavar="MODEL.TOML", type=click.Path(path_type=Path))
@click.option("--to", "kind", metavar="KIND", type=click.Choice([*KINDS, "all", *OF_RUNS]), help="See below.")
@click.option(
    "--out", metavar="PATH", type=click.Path(path_type=Path), help="File, or folder to put it into."
)
@click.option(
    "--into",
    metavar="FILE",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Put the model into your own MJCF, URDF or SDF file instead; a backup stays beside it.",
)
@click.option(
    "--joints", metavar="LEFT,RIGHT", help="Wheel joints of that file, where their names do not tell."
)
@click.option(
    "--keep",
    type=click.Choice(["masses", "motors"]),
    help="What is right in that file, which fixes the scale of torque.  [default: what changes it less]",
)
@click.option(
    "--check",
    "runs",
    metavar="RUNS",
    type=click.Path(exists=True, path_type=Path),
    help="Recordings that the programs the files are for simulate again: error before and after.",
)
@click.option(
    "--refine",
    "is_refined",
    is_flag=True,
    help="With --into and --check: fit gains, time constant, friction, delay on RUNS through your own MJCF.",
)
@click.option("--wheel-radius", type=POSITIVE, help="Metres, where the model does not say.")
@click.option("--wheelbase", type=POSITIVE, help="Metres between the wheels, where the model does not say.")
@click.option(
    "--inertia",
    type=POSITIVE,
    help="Inertia of each axle with what it drives, kg m^2: the free scale of urdf, sdf and mjcf."
    "  [default: half of a robot of 5 kg]",
)
@click.option(
    "--nominal-voltage",
    type=POSITIVE,
    default=12.0,
    show_default=True,
    help="Volts at full effort, for wpilib.",
)
@click.option("--period", type=POSITIVE, help="Seconds between samples, for simulink.  [default: the log's]")
@json_option
def command(
    app: App,
    model: Path,
    kind: str | None,
    out: Path | None,
    into: Path | None,
    joints: str | None,
    keep: str | None,
    runs: Path | None,
    is_refined: bool,
    wheel_radius: float | None,
    wheelbase: float | None,
    inertia: float | None,
    nominal_voltage: float,
    period: float | None,
) -> None:
    """Write MODEL.TOML (from `truing fit --out`, or a baseline) as KIND, and say what KIND cannot hold.

    With --into it goes into your own robot's file instead, in the scale of your masses or motors, and the
    change is shown. With --check the programs that run the files simulate RUNS again. With --refine the
    numbers are fitted once more through your own file, of which a model of single wheels knows too little
    when the robot turns; every third run is left out and judges.

    \b
    Examples:
      truing export model.toml --to mjcf --out out/robot.xml
      truing export baseline.toml --to all --out out/robot
      truing export model.toml --check my_robot
      truing export model.toml --into my_robot.xml --check my_robot
      truing export model.toml --into my_robot.xml --check my_robot --refine
      truing export docs/example --to mcap --out out/mcap
    """
    from truing.exporters import ExportOptions, read_model

    if into is None and kind is None and runs is None:
        raise click.UsageError("one of --to KIND, --into FILE and --check RUNS is due")
    if into is not None and kind is not None:
        raise click.UsageError("--to makes a file of its own, --into changes yours: give one of them")
    if is_refined and (into is None or runs is None):
        raise click.UsageError("--refine needs --into FILE and --check RUNS")
    if kind is not None and out is None:
        raise click.UsageError("--to KIND wants --out PATH")
    if kind in OF_RUNS and out is not None:
        _export_runs(app, model, out, wheel_radius, wheelbase)
        return
    read, unused = read_model(model)
    options = ExportOptions(nominal_voltage, inertia, wheel_radius, wheelbase, period)
    found: dict[str, Any] = {"model": str(model), "notes": list(unused)}
    for note in unused:
        app.say(f"note: {note}")
    if into is not None:
        wish = Wish(into, out, runs, keep, joints, is_refined)
        found["into"] = put_into(app, read, wish, options)
    elif kind is not None and out is not None:
        name = _file_name(read.robot.name or model.stem)
        found["exports"] = _write(app, read, kind, out, name, options)
    if runs is not None and into is None:
        kinds = None if kind in (None, "all") else [str(kind)]
        found["check"] = check_formats(app, read, runs, kinds, options)
    app.emit(found)


def _write(
    app: App, read: RobotModel, kind: str, out: Path, name: str, options: ExportOptions
) -> list[dict[str, Any]]:
    """Write one kind, or all that the model has enough for."""
    from truing.errors import TruingError
    from truing.exporters import exporters, notes

    kinds = list(KINDS) if kind == "all" else [kind]
    results: list[dict[str, Any]] = []
    with app.progress("exporting") as progress:
        for number, one in enumerate(kinds, start=1):
            exporter = exporters()[one]
            folder = kind == "all" or out.is_dir() or not out.suffix
            path = out / f"{name}_{one}{exporter.SUFFIX}" if folder else out
            try:
                files = exporter.write(read, path, options)
                said = notes(one, read, options)
            except TruingError as error:
                if kind != "all":
                    raise
                files, said = (), (f"not written: {error.message}",)
            results.append({"kind": one, "files": [str(file) for file in files], "notes": list(said)})
            progress(number / len(kinds))
    for result in results:
        for file in result["files"]:
            app.say(f"written: {file}")
        for note in result["notes"]:
            app.say(f"note: {result['kind']}: {note}")
    return results


def _export_runs(
    app: App, runs: Path, out: Path, wheel_radius: float | None, wheelbase: float | None
) -> None:
    """Write recordings for Foxglove."""
    from truing.extras import require

    require("foxglove")
    from truing.foxglove.recording_file import write_set
    from truing.importers import read_runs
    from truing.recording.geometry import given_geometry

    files = write_set(read_runs(runs, geometry=given_geometry(None, wheel_radius, wheelbase)), out)
    app.emit({"runs": str(runs), "exports": [{"kind": "mcap", "files": [str(file) for file in files]}]})
    for file in files:
        app.say(f"written: {file}")


def _file_name(name: str) -> str:
    """A robot's name as the beginning of a file's."""
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in name)
