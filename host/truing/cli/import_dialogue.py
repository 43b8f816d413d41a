"""What `truing import` shows and asks where a table has no mapping: columns, mapping, preview, a question."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from truing.cli.app import App
from truing.errors import TruingError

if TYPE_CHECKING:
    from truing.importers import ImportOptions
    from truing.importers.mapping import Mapping
    from truing.importers.proposal import Proposal
    from truing.importers.text_table import TextTable
    from truing.recording.run import Run

QUESTION = "Enter takes it; a line such as `effort_left = pwmL / 255; acts = after` changes it"
NOT_ACCEPTED = "--yes takes it; or save it as mapping.toml, change it, and give --mapping mapping.toml"


def agreed_mapping(
    app: App,
    files: Sequence[Path],
    options: ImportOptions,
    edits: Sequence[str],
    *,
    out: Path,
    preview: Path | None,
    yes: bool,
) -> tuple[Mapping, Proposal]:
    """The mapping, and what it was made of, for tables that have none: proposed, shown, changed, accepted.

    Parameters
    ----------
    edits : lines of the user's from the command line, as the question takes them.
    out : the set's folder, where the mapping will lie.
    preview : where to write a picture of the first run, .html or .png.
    yes : accept without a question.

    Raises
    ------
    TruingError : nobody accepts it, or it lacks what a run needs; says what the file has and what is due.
    """
    from truing.importers.mapping import parse_mapping
    from truing.importers.proposal import check_complete, propose
    from truing.importers.tables import read_table

    tables = [read_table(file, options.pose) for file in files]
    proposal = propose(
        tables,
        nominal_voltage_v=options.nominal_voltage_v,
        full_effort=options.full_effort,
        wheel_radius_m=options.wheel_radius_m,
        wheelbase_m=options.wheelbase_m,
        full_speed_mps=options.full_speed_mps,
    )
    for edit in edits:
        proposal = proposal.with_edit(edit)
    asks = app.asks and not yes
    while True:
        _show(app, tables[0], proposal)
        mapping = None
        try:
            check_complete(proposal, files[0])
            mapping = parse_mapping(tomllib.loads(proposal.to_toml()), out / "mapping.toml")
            _preview(app, files[0], replace(options, mapping=mapping), preview)
        except TruingError as error:
            if not asks:
                raise
            app.note(f"{error.message}. {error.next_step}")
        if mapping is not None and yes:
            return mapping, proposal
        if not asks:
            raise TruingError(f"{files[0]}: not imported, the mapping above is only proposed", NOT_ACCEPTED)
        line = click.prompt(QUESTION, default="", show_default=False, err=True).strip()
        if not line and mapping is not None:
            return mapping, proposal
        if line:
            try:
                proposal = proposal.with_edit(line)
            except TruingError as error:
                app.note(f"{error.message}. {error.next_step}")


def _show(app: App, table: TextTable, proposal: Proposal) -> None:
    """The columns with unit, range and course; then the mapping."""
    from rich.markup import escape
    from rich.table import Table

    shown = Table("column", "unit", "from", "to", "empty", "course", "becomes", box=None, pad_edge=False)
    for column in proposal.columns:
        becomes = ", ".join(_taken(proposal, column.name)) or "-"
        empty = str(column.missing) if column.missing else ""
        ends = [f"{end:.6g}" if end == end else "" for end in (column.low, column.high)]
        shown.add_row(escape(column.name), column.unit, *ends, empty, column.spark, becomes)
    app.say(f"{table.path}: {len(table)} rows")
    for note in (*table.notes, *proposal.notes):
        app.say(f"  {note}")
    app.show(shown)
    app.say()
    for line in proposal.to_toml().splitlines():
        app.say(f"  {line}".rstrip())
    app.say()


def _taken(proposal: Proposal, column: str) -> list[str]:
    """The columns of a run that take this one."""
    from truing.importers.expression import Expression

    found = []
    for name, source in proposal.tree["columns"].items():
        if isinstance(source, dict) and "expression" in source:
            names = list(Expression(source["expression"]).names)
        else:
            names = [str(source.get("column")) if isinstance(source, dict) else source]
        if column in names:
            found.append(name)
    if proposal.tree.get("split", {}).get("column") == column:
        found.append("a run per value")
    return found


def _preview(app: App, file: Path, options: ImportOptions, path: Path | None) -> None:
    """The first run that this mapping makes, as lines of bars; as a picture where one is asked for."""
    from truing.importers import import_file
    from truing.importers.column_guess import sparkline

    imported = import_file(file, options)
    run = imported.runs[0]
    app.say(f"Preview: {run.name}, {len(run)} rows, {run.duration_s:.4g} s at {run.rate_hz:.4g} Hz")
    for name, label in _labels(run).items():
        values = run.columns[name]
        app.say(f"  {label:16} {values.min():9.4g} to {values.max():9.4g}  {sparkline(values, 48)}")
    app.say()
    if path is not None:
        from truing.report.import_preview import save_preview

        save_preview(run, _labels(run), path)
        app.say(f"written: {path}")


def _labels(run: Run) -> dict[str, str]:
    """Columns to preview, by their names in the file that will be written."""
    from truing.recording.axis import axis_names

    names = list(run.order)
    labels = {name: name for name in names} if run.axis is None else axis_names(names, run.axis)
    wanted = ("effort", "ticks", "pos", "vel", "truth", "gyro", "battery")
    return {name: label for name, label in labels.items() if label.split("_")[0] in wanted}
