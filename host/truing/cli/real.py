"""`truing real`: recordings of real robots, each diagnosed from a baseline without friction and delay."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from truing.cli.app import App
from truing.cli.options import json_option

if TYPE_CHECKING:
    from truing.studies.real.tables import RealStudy

OTHERS = ("emps", "mrclam", "mom")


@click.command()
@click.argument("recordings", metavar="[DIR]", required=False, type=click.Path(path_type=Path))
@click.option(
    "--only",
    multiple=True,
    metavar="NAME",
    help="Sets under DIR/real whose names hold NAME, or emps, mrclam, mom; more than once for more.",
)
@click.option(
    "--markdown", "page", metavar="FILE", type=click.Path(dir_okay=False, path_type=Path),
    help="Write all tables, and what could not be decided, as a page of Markdown.",
)  # fmt: skip
@json_option
def command(app: App, recordings: Path | None, only: tuple[str, ...], page: Path | None) -> None:
    """Diagnose real robots' recordings, and print what the named effects do to the error on unseen runs.

    DIR holds real/ (recording sets) and raw/ (emps, mrclam).  [default: $TRUING_RECORDINGS, or
    shared/recordings beside the repository]. The MOM paper's runs are made from its own numbers and need
    no files. All of it takes some ten minutes of one core.

    \b
    Examples:
      truing real
      truing real --only mom
      truing real --only Minibot --only emps
      truing real --markdown real.md
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from truing.recording.writer import replace_file
    from truing.studies.real.tables import markdown, tables, undecided
    from truing.workspace import recordings_folder

    wanted = [name.lower() for name in only]
    folder = _folder(recordings if recordings is not None else recordings_folder(), wanted)
    result = _study(app, folder, _chosen(folder, wanted), wanted)
    app.emit(
        {
            "tables": [
                {"title": table.title, "header": table.header, "rows": table.rows, "remarks": table.remarks}
                for table in tables(result)
            ],
            "undecided": undecided(result),
        }
    )
    for table in tables(result):
        app.show(table.to_rich())
    for line in undecided(result):
        app.say(f"undecided: {line}")
    if page is not None:
        replace_file(page, markdown(result).encode("utf-8"))
        app.say(f"written: {page}")


def _folder(folder: Path | None, wanted: list[str]) -> Path:
    """The folder of recordings; the MOM paper's runs need none."""
    from truing.errors import FileError

    if folder is not None and folder.is_dir():
        return folder
    if wanted != ["mom"]:
        place = folder or "$TRUING_RECORDINGS"
        raise FileError(place, "no folder of real recordings", "Give DIR, or set TRUING_RECORDINGS")
    return Path()


def _chosen(folder: Path, wanted: list[str]) -> list[Path]:
    """The sets under `real` whose names hold one of the wanted parts."""
    from truing.errors import FileError
    from truing.studies.real.drivetrains import set_folders

    parts = [name for name in wanted if name not in OTHERS]
    if wanted and not parts:
        return []
    chosen = [
        path for path in set_folders(folder) if not parts or any(p in path.name.lower() for p in parts)
    ]
    for part in parts:
        if not any(part in path.name.lower() for path in chosen):
            raise FileError(folder / "real", f"holds no set whose name holds {part!r}")
    return chosen


def _study(app: App, folder: Path, chosen: list[Path], wanted: list[str]) -> RealStudy:
    from truing.studies.real.study import study_drift, study_drivetrain, study_emps, study_mrclam
    from truing.studies.real.tables import RealStudy

    sets = []
    for path in chosen:
        with app.progress(path.name) as progress:
            sets.append(study_drivetrain(path, progress))
    others = [name for name in OTHERS if not wanted or name in wanted]
    there = {name for name in others if name in wanted or (folder / "raw" / name).is_dir()}
    with app.progress("emps", shown="emps" in there) as progress:
        emps = study_emps(folder, progress) if "emps" in there else None
    with app.progress("mrclam", shown="mrclam" in there) as progress:
        mrclam = study_mrclam(folder, progress) if "mrclam" in there else None
    with app.progress("mom", shown="mom" in others) as progress:
        drift = study_drift(progress) if "mom" in others else None
    return RealStudy(tuple(sets), emps, mrclam, drift)
