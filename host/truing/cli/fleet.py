"""`truing fleet`: identify and diagnose the recordings of many robots, compare them, follow them in time."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING

import click

from truing.cli.app import App
from truing.cli.options import json_option

if TYPE_CHECKING:
    from truing.fleet.run import Ran
    from truing.fleet.storage import Place
    from truing.fleet.tables import Tables
    from truing.fleet.task import Job


@click.command()
@click.argument("sets", metavar="SETS...", nargs=-1, required=True)
@click.option(
    "--out",
    metavar="FOLDER",
    help="Folder for the results, also s3://BUCKET/FOLDER and the like.  [default: out/fleet]",
)
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Run on this Dask cluster, tcp://HOST:8786.  [default: an embedded one on this computer]",
)
@click.option(
    "--workers", type=click.IntRange(min=1), help="Processes of the embedded cluster.  [default: all cores]"
)
@click.option(
    "--numbers-only", is_flag=True, help="Identify, and diagnose nothing: a few seconds less for each set."
)
@click.option(
    "--false-discovery-rate",
    "rate",
    type=click.FloatRange(0.0, 0.5, min_open=True),
    default=0.01,
    show_default=True,
    help="Share of the drifts, and of the differences, that may be by chance.",
)
@click.option("--no-report", is_flag=True, help="Write the tables alone, and no pages.")
@json_option
def command(
    app: App,
    sets: tuple[str, ...],
    out: str | None,
    scheduler: str | None,
    workers: int | None,
    numbers_only: bool,
    rate: float,
    no_report: bool,
) -> None:
    """Identify and diagnose the recordings of many robots, say which robots differ from their sisters, which
    of their numbers drift and since when, and which effects come together.

    SETS are folders with the layout ROBOT/DATE/, each holding a recording set, or tables (.csv, .toml) of
    path, robot, recorded; on disk, or wherever fsspec reaches (s3://...). Each set's result is written as it
    ends: the same command again goes on where it stopped. A set that cannot be read becomes a row with its
    error. The exit status is 0 when every set has its row, 1 when the cluster is lost, 2 for bad input or a
    full disk.

    \b
    Examples:
      truing fleet recordings
      truing fleet recordings --out s3://lab/fleet --scheduler tcp://10.0.0.5:8786
      truing fleet sets.csv --numbers-only --json
      duckdb -c "select * from 'out/fleet/changes.parquet' where found order by p"
    """
    from truing.extras import require

    require("fleet")
    if scheduler is not None and workers is not None:
        raise click.UsageError("--workers is for the embedded cluster; a cluster at an address has its own.")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from truing.fleet.catalogue import read_catalogue
    from truing.fleet.run import existing_parts, jobs_of
    from truing.fleet.storage import Place
    from truing.fleet.tables import gather
    from truing.workspace import out_folder

    place = Place(out if out is not None else str(out_folder() / "fleet"))
    catalogue = read_catalogue(sets)
    for reason in catalogue.left_out:
        app.note(f"left out: {reason}")
    jobs = jobs_of(catalogue.sets, place.url, diagnose=not numbers_only)
    ran = _run(app, jobs, place, scheduler, workers, diagnose=not numbers_only)
    tables = gather(place, ran.parts, existing_parts(place))
    if tables.missing:
        app.note(f"{len(tables.missing)} results are damaged; made again")
        _run(app, jobs, place, scheduler, workers, diagnose=not numbers_only, redo=tables.missing)
        tables = gather(place, ran.parts, existing_parts(place))
    _answer(app, place, ran, tables, rate, report=not no_report, left_out=catalogue.left_out)


def _run(
    app: App,
    jobs: list[Job],
    place: Place,
    scheduler: str | None,
    workers: int | None,
    *,
    diagnose: bool,
    redo: Collection[str] = (),
) -> Ran:
    """Run what is not done; without a cluster where nothing is."""
    from truing.fleet.dask_engine import open_cluster
    from truing.fleet.run import Ran as Done
    from truing.fleet.run import existing_parts, run_fleet

    there = existing_parts(place)
    if not redo and all(job.part in there for job in jobs):
        return Done({job.entry.name: job.part for job in jobs}, len(jobs))
    if diagnose and scheduler is None:
        from truing.diagnose.simulation.warm import compile_once

        compile_once(app.note)  # once here instead of in every worker
    with open_cluster(workers, scheduler) as engine, app.progress(f"{len(jobs)} sets") as progress:
        return run_fleet(jobs, place, engine, progress, app.note, redo)


def _answer(
    app: App, place: Place, ran: Ran, tables: Tables, rate: float, *, report: bool, left_out: tuple[str, ...]
) -> None:
    """Tables, analysis, report, and what is printed."""
    from truing.fleet.analysis import analyse, analysis_tables, to_json
    from truing.fleet.tables import write_tables
    from truing.fleet.wording import change_table, difference_table, effect_table, summary_lines

    analysis = analyse(tables, rate)
    written: list[str] = []
    say: Callable[[str], None] = written.append
    write_tables(place, tables.named() | analysis_tables(analysis), say)
    if report:
        from truing.fleet.report import write_report

        write_report(place, tables, analysis, say)
    rows = tables.sets.select(["set", "robot", "status", "error"]).to_pylist()
    bad = [row for row in rows if row["error"]]
    robots = len({row["robot"] for row in rows})
    app.emit(
        {
            "sets": len(rows),
            "robots": robots,
            "done_before": ran.before,
            "errors": [{"set": row["set"], "status": row["status"], "error": row["error"]} for row in bad],
            "left_out": list(left_out),
            "missing": list(tables.missing),
            **to_json(analysis),
            "out": place.url,
        }
    )
    for line in summary_lines(analysis, len(rows), robots, len(bad)):
        app.say(line)
    shown = (
        change_table(analysis.drifting, rate),
        difference_table(analysis.differing, rate),
        effect_table(analysis.robots),
    )
    for table in shown:
        if table.rows:
            app.say()
            app.show(table.to_rich())
    for line in written:
        app.say(line)
