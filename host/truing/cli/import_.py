"""`truing import`: recordings of other programs become a recording set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from truing.cli.app import App
from truing.cli.options import POSITIVE, axis_option, json_option

if TYPE_CHECKING:
    from truing.importers import Imported
    from truing.importers.mapping import Mapping
    from truing.importers.proposal import Proposal
    from truing.recording.axis import Motion
    from truing.recording.run import Run


@click.command("import", no_args_is_help=True)
@click.argument(
    "files", metavar="FILE...", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path)
)
@click.option(
    "--out", metavar="SET", required=True, type=click.Path(path_type=Path), help="Folder to write the set to."
)
@click.option(
    "--mapping",
    metavar="TOML",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Which column is which (CSV, .mat, MCAP); else NAME.mapping.toml or mapping.toml beside FILE.",
)
@click.option(
    "--metres-per-unit", type=POSITIVE, help="Wheel travel at the rim per unit of the file's positions."
)
@click.option(
    "--nominal-voltage",
    type=POSITIVE,
    default=12.0,
    show_default=True,
    help="Volts that count as full effort.",
)
@click.option(
    "--wheelbase", type=POSITIVE, help="Metres between the wheels, where only body speeds are commanded."
)
@click.option(
    "--full-speed", type=POSITIVE, help="Wheel speed (m/s) of full effort, where speeds are commanded."
)
@click.option("--full-effort", type=POSITIVE, help="A table's number for full effort (255, 1023, ...).")
@click.option(
    "--wheel-radius",
    metavar="METRES",
    type=POSITIVE,
    help="Turns a table's rpm or rad/s into speeds at the rim.",
)
@click.option(
    "--set",
    "edits",
    metavar="NAME=EXPRESSION",
    multiple=True,
    help="Change the proposed mapping: vel_left_mps='v - w*b/2', b=0.23, acts=after, from_s=2, to_s=30, "
    "rate_hz=50.",
)
@click.option(
    "--preview", metavar="FILE", type=click.Path(dir_okay=False, path_type=Path),
    help="Draw the first run of a table as .html or .png.",
)  # fmt: skip
@click.option(
    "--pose",
    metavar="FILE",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="A table of the pose from outside (time, x, y, heading) on the same clock.",
)
@click.option("--spins", is_flag=True, help="Keep tests of a SysId file that turn the robot on the spot.")
@click.option("--yes", is_flag=True, help="Take the proposed mapping without a question.")
@axis_option
@json_option
def command(
    app: App,
    files: tuple[Path, ...],
    out: Path,
    mapping: Path | None,
    metres_per_unit: float | None,
    nominal_voltage: float,
    wheelbase: float | None,
    full_speed: float | None,
    axis: Motion | None,
    full_effort: float | None,
    wheel_radius: float | None,
    edits: tuple[str, ...],
    preview: Path | None,
    pose: Path | None,
    spins: bool,
    yes: bool,
) -> None:
    """Turn recordings of other programs into a set of runs, and say what looks wrong with them.

    Reads WPILib SysId JSON (2020 and newer, .json or .json.gz), WPILib .wpilog, ROS 1 and 2 bags
    (JointState, Odometry, Twist), MCAP, MATLAB .mat, and any table of text. Where a table has no mapping
    file, one is proposed, shown with a preview and asked about once; not at a terminal it is printed, and the
    exit status is 2 unless --yes takes it. The mapping is kept in SET/mapping.toml:

    \b
      effort = "after"       # optional: a row's effort acts in the interval after it
      [columns]
      t_s = { column = "time", scale = 1e-3 }      # milliseconds
      effort_left = { column = "pwmLeft", scale = 0.00392 }
      effort_right = { column = "pwmRight", scale = 0.00392 }
      ticks_left = "leftEncoder"
      ticks_right = "rightEncoder"
      [split]                                      # optional: a run per stretch of a column
      column = "test"
      skip = ["none"]

    \b
    Examples:
      truing import sysid_data.json --out out/sets/drive
      truing import bag_folder --out out/sets/bag --wheelbase 0.35 --metres-per-unit 0.05
      truing import log.csv --out out/sets/log
      truing import motor.txt --out out/sets/motor --full-effort 400 --yes
      truing import odometry.dat --pose mocap.csv --wheelbase 0.26 --out out/sets/mocap
      truing import log.csv --mapping log.mapping.toml --out out/sets/log
    """
    from truing.cli.import_dialogue import agreed_mapping
    from truing.errors import OutputError
    from truing.importers import ImportOptions, import_files, without_mapping
    from truing.importers.proposal import obedient_baseline
    from truing.recording.writer import next_run_path, replace_file, write_run

    if any((out / "runs").glob("*.csv")):
        raise OutputError(out, "already holds runs", "Give --out a new folder")
    options = ImportOptions(
        nominal_voltage, metres_per_unit, wheelbase, full_speed, mapping,
        full_effort=full_effort, wheel_radius_m=wheel_radius, pose=pose, spins=spins,
    )  # fmt: skip
    agreed: tuple[Mapping, Proposal] | None = None
    tables = without_mapping(files, options)
    if tables:
        agreed = agreed_mapping(app, tables, options, edits, out=out, preview=preview, yes=yes)
    imported = []
    with app.progress("importing") as progress:
        # What has a mapping of its own, then what has the one that was agreed.
        others = [file for file in files if file not in tables]
        chosen = options if agreed is None else replace(options, mapping=agreed[0])
        for group, how in ((others, options), (tables, chosen)):
            imported += [item.of_axis(axis) for item in import_files(group, how)]
            progress(len(imported) / len(files))
    written = []
    for item in imported:
        for run in item.runs:
            label = run.name.split("_", 1)[1]
            written.append((item, run, write_run(run, next_run_path(out, label))))
    app.emit(
        {
            "set": str(out),
            "runs": [
                {
                    "run": path.stem,
                    "from": str(item.source),
                    "kind": item.kind,
                    "rows": len(run),
                    "duration_s": run.duration_s,
                    "rate_hz": run.rate_hz,
                }
                for item, run, path in written
            ],
            "findings": [
                {
                    "file": str(item.source),
                    "test": finding.test,
                    "code": finding.code,
                    "text": finding.text,
                    "corrected": finding.corrected,
                }
                for item in imported
                for finding in item.findings
            ],
        }
    )
    _print(app, imported)
    baseline = None
    if agreed is not None:
        kept = agreed[0].path
        replace_file(kept, agreed[1].to_toml().encode("utf-8"))
        app.say(f"{kept}: the mapping; the next file needs no question with --mapping {kept}")
        baseline = obedient_baseline(agreed[1], out.name, written[0][1].interval_s)
    if baseline is not None:
        replace_file(out / "baseline.toml", baseline.encode("utf-8"))
        app.say(f"{out / 'baseline.toml'}: the command, obeyed at once")
        following = f"truing diagnose {out} --commanded"
    else:
        following = f"truing identify {out}{_scale_of_counts([run for _, run, _ in written])}"
    count = "1 run" if len(written) == 1 else f"{len(written)} runs"
    app.say(f"{out}: {count}; next: {following}")


def _scale_of_counts(runs: Sequence[Run]) -> str:
    """The options without which runs that hold encoder counts alone are no motion."""
    if not all(run.has_pair("ticks") and not (run.has_pair("pos") or run.has_pair("vel")) for run in runs):
        return ""
    return " --counts-per-rev N" + ("" if runs[0].axis is not None else " --wheel-radius METRES")


def _print(app: App, imported: list[Imported]) -> None:
    from rich.table import Table

    table = Table("run", "rows", "seconds", "Hz")
    for item in imported:
        for run in item.runs:
            table.add_row(run.name, str(len(run)), f"{run.duration_s:.2f}", f"{run.rate_hz:.4g}")
    app.show(table)
    for item in imported:
        for finding in item.findings:
            app.say(f"{'put right' if finding.corrected else 'note'}: {finding}")
