"""The catalogue of a fleet: which recording sets there are, of which robot, recorded when."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from truing.errors import CatalogueError
from truing.fleet.storage import Listed, Place, stamp_of

BASELINE = "baseline.toml"
# 2026-03-01, 20260301, 2026-03-01T14-30, 2026-03-01_14:30:05; anything may follow.
DATE = re.compile(r"(\d{4})-?(\d\d)-?(\d\d)(?:[T_ -]?(\d\d)[-:]?(\d\d)(?:[-:]?(\d\d))?)?(?!\d)")
TABLES = (".csv", ".toml")
LAYOUT = "ROBOT/DATE/ (for example rover-07/2026-03-01/), or a table of path, robot, recorded (docs/FLEET.md)"


@dataclass(frozen=True, slots=True)
class SetEntry:
    """One recording set of a fleet.

    Attributes
    ----------
    name : unique in the fleet: ROBOT/DATE, or ROBOT and what the table's path ends with.
    group : robots of one group are sisters, which are compared with each other.
    recorded : in UTC; a date without a time is its midnight.
    url : the folder, or the file of another program.
    model : what the simulation knows, where no baseline.toml is in the set; None: fitted to the runs.
    stamp : changes when a file of the set, or the model, does.
    """

    name: str
    robot: str
    group: str
    recorded: datetime
    url: str
    model: str | None
    stamp: str


@dataclass(frozen=True, slots=True)
class Catalogue:
    """The sets of a fleet in order, and the folders that were left out, each with the reason."""

    sets: tuple[SetEntry, ...]
    left_out: tuple[str, ...] = ()

    @property
    def robots(self) -> tuple[str, ...]:
        """Their names in order."""
        return tuple(sorted({entry.robot for entry in self.sets}))


def read_catalogue(sources: Sequence[str]) -> Catalogue:
    """The sets of folders with the layout ROBOT/DATE/, and of tables.

    Raises
    ------
    CatalogueError : no set is there, a table is malformed, or two sets have one name.
    """
    sets: list[SetEntry] = []
    left_out: list[str] = []
    for source in sources:
        place = Place(source)
        if source.lower().endswith(TABLES) and not place.is_folder():
            from truing.fleet.catalogue_table import read_table

            sets += read_table(place)
            continue
        found = _by_layout(place)
        sets += found.sets
        left_out += found.left_out
    if not sets:
        shown = f" ({left_out[0]})" if left_out else ""
        raise CatalogueError(
            ", ".join(sources), f"there is no recording set here{shown}", f"Lay it out as {LAYOUT}"
        )
    names: dict[str, str] = {}
    for entry in sets:
        if entry.name in names:
            raise CatalogueError(
                entry.url,
                f"two sets are called {entry.name}; the other is {names[entry.name]}",
                "Name it once, or give one of the robots another name in a table",
            )
        names[entry.name] = entry.url
    return Catalogue(
        tuple(sorted(sets, key=lambda entry: (entry.robot, entry.recorded, entry.name))), tuple(left_out)
    )


def _by_layout(root: Place) -> Catalogue:
    files = root.listing()
    if not files:
        raise CatalogueError(root.url, "there is nothing here", f"Lay it out as {LAYOUT}")
    if any(name.startswith("runs/") for name in files):
        raise CatalogueError(
            root.url,
            "is one recording set, not a fleet",
            f"`truing diagnose` takes it; a fleet is laid out as {LAYOUT}",
        )
    members: dict[tuple[str, str], dict[str, Listed]] = {}
    for name, file in files.items():
        robot, _, rest = name.partition("/")
        folder, _, inside = rest.partition("/")
        if inside:
            members.setdefault((robot, folder), {})[inside] = file
    sets: list[SetEntry] = []
    left_out: list[str] = []
    for (robot, folder), inside_files in members.items():
        if not any(_is_run(name) for name in inside_files):
            continue
        recorded = date_in(folder)
        if recorded is None:
            left_out.append(f"{root.url}/{robot}/{folder}: its name does not begin with a date")
            continue
        model = _model(files, robot, has_own=BASELINE in inside_files)
        known = inside_files if model is None else inside_files | {f"../{model}": files[model]}
        sets.append(
            SetEntry(
                name=f"{robot}/{folder}",
                robot=robot,
                group="",
                recorded=recorded,
                url=f"{root.url}/{robot}/{folder}",
                model=None if model is None else f"{root.url}/{model}",
                stamp=stamp_of(known),
            )
        )
    return Catalogue(tuple(sets), tuple(left_out))


def _is_run(name: str) -> bool:
    return name.endswith(".csv") and name.rpartition("/")[0] in ("", "runs")


def _model(files: dict[str, Listed], robot: str, *, has_own: bool) -> str | None:
    """The robot's baseline, or the fleet's, where the set has none of its own."""
    wanted = () if has_own else (f"{robot}/{BASELINE}", BASELINE)
    return next((name for name in wanted if name in files), None)


def date_in(text: str) -> datetime | None:
    """The date, and the time if there is one, that a text begins with, in UTC; None where there is none."""
    found = DATE.match(text)
    if found is None:
        return None
    year, month, day, hour, minute, second = (int(part or 0) for part in found.groups())
    try:
        return datetime(year, month, day, hour, minute, second, tzinfo=UTC)
    except ValueError:
        return None
