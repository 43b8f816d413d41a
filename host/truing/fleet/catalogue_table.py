"""A table that names the sets of a fleet: CSV with a header, or TOML with an array of tables `set`."""

from __future__ import annotations

import csv
import io
import tomllib
from datetime import UTC, date, datetime, time
from typing import Any

from truing.errors import CatalogueError
from truing.fleet.catalogue import SetEntry, date_in
from truing.fleet.storage import Place, stamp_of

REQUIRED = ("path", "robot", "recorded")
OPTIONAL = ("group", "model")
NEXT = f"Each set has {', '.join(REQUIRED)}, and may have {' and '.join(OPTIONAL)} (docs/FLEET.md)"


def read_table(table: Place) -> list[SetEntry]:
    """The sets that a table names, in its order.

    Raises
    ------
    CatalogueError : names the row, and what is wrong there.
    """
    try:
        text = table.read().decode("utf-8-sig")
    except UnicodeDecodeError:
        raise CatalogueError(table.url, "is not UTF-8 text", NEXT) from None
    rows = _of_toml(table, text) if table.url.lower().endswith(".toml") else _of_csv(table, text)
    sets: list[SetEntry] = []
    names: dict[str, int] = {}
    for number, row in enumerate(rows, start=1):
        entry = _entry(table, number, row)
        if entry.name in names:
            raise CatalogueError(
                table.url,
                f"sets {names[entry.name]} and {number} are both {entry.name}",
                "Give their folders other names",
            )
        names[entry.name] = number
        sets.append(entry)
    return sets


def _of_csv(table: Place, text: str) -> list[dict[str, Any]]:
    reader = csv.DictReader(io.StringIO(text), restkey="", restval="")
    missing = [name for name in REQUIRED if name not in (reader.fieldnames or ())]
    if missing:
        raise CatalogueError(table.url, f"its header lacks {', '.join(missing)}", NEXT)
    return [{name: value for name, value in row.items() if value} for row in reader]


def _of_toml(table: Place, text: str) -> list[dict[str, Any]]:
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise CatalogueError(table.url, f"is no TOML: {error}", NEXT) from None
    sets = tree.get("set", [])
    if not isinstance(sets, list) or not all(isinstance(row, dict) for row in sets):
        raise CatalogueError(table.url, "`set` is no array of tables", "Write [[set]] above each set")
    return sets


def _entry(table: Place, number: int, row: dict[str, Any]) -> SetEntry:
    where = f"set {number}"
    missing = [name for name in REQUIRED if row.get(name) in (None, "")]
    if missing:
        raise CatalogueError(table.url, f"{where} has no {', '.join(missing)}", NEXT)
    recorded = _recorded(row["recorded"])
    if recorded is None:
        raise CatalogueError(
            table.url,
            f"{where}: recorded = {row['recorded']!r} is no date",
            "Write 2026-03-01 or 2026-03-01T14:30:00, in UTC",
        )
    url = _resolved(table, str(row["path"]))
    model = None if row.get("model") in (None, "") else _resolved(table, str(row["model"]))
    # A set that is not there becomes a row with its error, as every other bad set does.
    files = {f"{url}/{name}": file for part in (url, model) if part for name, file in _files(part).items()}
    robot = str(row["robot"])
    return SetEntry(
        name=f"{robot}/{url.rsplit('/', 1)[-1]}",
        robot=robot,
        group=str(row.get("group", "")),
        recorded=recorded,
        url=url,
        model=model,
        stamp=stamp_of(files),
    )


def _files(url: str) -> dict[str, Any]:
    place = Place(url)
    return dict(place.listing()) if place.exists() else {}


def _recorded(value: object) -> datetime | None:
    if isinstance(value, datetime):
        return value.astimezone(UTC) if value.tzinfo else value.replace(tzinfo=UTC)
    if isinstance(value, date):
        return datetime.combine(value, time(), UTC)
    return _parsed(value.strip()) if isinstance(value, str) else None


def _parsed(text: str) -> datetime | None:
    try:
        return _recorded(datetime.fromisoformat(text))
    except ValueError:
        return date_in(text)


def _resolved(table: Place, path: str) -> str:
    """A path of a table, which may be relative to the table's folder."""
    path = path.rstrip("/")
    if "://" in path or path.startswith("/") or path[1:3] == ":\\":
        return path
    above, slash, _ = table.url.rpartition("/")
    return f"{above}{slash}{path}"
