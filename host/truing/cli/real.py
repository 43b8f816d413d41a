"""`truing real`: recordings of real robots, each diagnosed from a baseline without friction and delay."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from truing.cli.app import App
from truing.cli.options import json_option

if TYPE_CHECKING:
    from truing.studies.real.tables import RealStudy

OTHERS = ("emps", "mrclam", "mom")
PEERS = "peers"


@click.command()
@click.argument("recordings", metavar="[DIR]", required=False, type=click.Path(path_type=Path))
@click.option(
    "--only",
    multiple=True,
    metavar="NAME",
    help="Sets whose names hold NAME, or emps, mrclam, mom; peers: the comparison with other methods "
    "alone, of all sets or of those whose names hold the other NAMEs.",
)
@click.option(
    "--sets", "further", multiple=True, metavar="DIR",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Compare the recording sets in this folder as well; more than once for more.",
)  # fmt: skip
@click.option(
    "--jobs", type=click.IntRange(1), default=lambda: os.cpu_count() or 1, show_default="all cores",
    help="Processes of the comparison.",
)  # fmt: skip
@click.option(
    "--finished", is_flag=True, help="Show the finished sets of the comparison, and compare no others."
)
@click.option(
    "--markdown", "page", metavar="FILE", type=click.Path(dir_okay=False, path_type=Path),
    help="Write all tables, and what could not be decided, as a page of Markdown.",
)  # fmt: skip
@json_option
def command(
    app: App,
    recordings: Path | None,
    only: tuple[str, ...],
    further: tuple[Path, ...],
    jobs: int,
    finished: bool,
    page: Path | None,
) -> None:
    """Diagnose real robots' recordings, and compare the models found with those of other methods.

    DIR holds real/ (recording sets) and raw/ (emps, mrclam), and where there are any more/sets/ and
    other/sets/, which are compared only.  [default: $TRUING_RECORDINGS, or shared/recordings beside the
    repository]. The MOM paper's runs are made from its own numbers and need no files.

    The comparison diagnoses every set and fits the other methods to the same rows: a ladder of least
    squares, WPILib SysId's regression, ARX, N4SID, SINDy. Some of them need libraries (`./run setup peers`).
    It takes some 20 seconds for each set; what is finished is kept in .cache/comparison, so that a stopped
    one goes on. The rest takes some ten minutes of one core.

    \b
    Examples:
      truing real
      truing real --only mom
      truing real --only Minibot --only emps
      truing real --only peers --sets ~/robots
      truing real --markdown real.md
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from truing.recording.writer import replace_file
    from truing.studies.real.comparison_cache import compare_sets
    from truing.studies.real.comparison_tables import where_peers_are_better
    from truing.studies.real.tables import markdown, tables, undecided
    from truing.workspace import recordings_folder

    wanted = [name.lower() for name in only]
    folder = _folder(recordings if recordings is not None else recordings_folder(), wanted, further)
    chosen, compared = _chosen(folder, wanted), _compared(folder, further, wanted)
    with app.progress("comparison with other methods", shown=bool(compared)) as progress:
        comparisons = compare_sets(compared, progress, jobs, resume=not finished) if compared else []
    result = replace(_study(app, folder, chosen, wanted), comparisons=tuple(comparisons))
    app.emit(
        {
            "tables": [
                {"title": table.title, "header": table.header, "rows": table.rows, "remarks": table.remarks}
                for table in tables(result)
            ],
            "comparisons": [one.to_json() for one in comparisons],
            "better": where_peers_are_better(comparisons),
            "undecided": undecided(result),
        }
    )
    for table in tables(result):
        app.show(table.to_rich())
    for line in where_peers_are_better(comparisons):
        app.say(f"better: {line}")
    for line in undecided(result):
        app.say(f"undecided: {line}")
    if page is not None:
        replace_file(page, markdown(result).encode("utf-8"))
        app.say(f"written: {page}")


def _folder(folder: Path | None, wanted: list[str], further: Sequence[Path]) -> Path:
    """The folder of recordings; the MOM paper's runs and sets of other folders need none."""
    from truing.errors import FileError

    if folder is not None and folder.is_dir():
        return folder
    if wanted != ["mom"] and not (further and PEERS in wanted):
        place = folder or "$TRUING_RECORDINGS"
        raise FileError(place, "no folder of real recordings", "Give DIR, or set TRUING_RECORDINGS")
    return Path("no recordings")


def _chosen(folder: Path, wanted: list[str]) -> list[Path]:
    """The sets under `real` whose names hold one of the wanted parts."""
    from truing.studies.real.drivetrains import set_folders

    parts = _parts(wanted)
    if PEERS in wanted or (wanted and not parts):
        return []
    return _matching(set_folders(folder), parts, folder / "real")


def _compared(folder: Path, further: Sequence[Path], wanted: list[str]) -> list[Path]:
    """The sets to compare on, once it is known that every method's library is there."""
    from truing.studies.real.drivetrains import all_set_folders
    from truing.studies.real.peers.catalogue import PEERS as METHODS

    if wanted and PEERS not in wanted:
        return []
    found = _matching(all_set_folders(folder, further), _parts(wanted), folder)
    for method in METHODS:
        method.require()
    return found


def _parts(wanted: list[str]) -> list[str]:
    return [name for name in wanted if name not in (*OTHERS, PEERS)]


def _matching(folders: Sequence[Path], parts: Sequence[str], place: Path) -> list[Path]:
    """The folders whose names hold any of these parts; all where there are no parts.

    Raises
    ------
    FileError : a part is in no name.
    """
    from truing.errors import FileError

    for part in parts:
        if not any(part in path.name.lower() for path in folders):
            raise FileError(place, f"holds no set whose name holds {part!r}")
    return [path for path in folders if not parts or any(part in path.name.lower() for part in parts)]


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
