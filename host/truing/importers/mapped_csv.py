"""Any CSV, through a mapping file."""

from __future__ import annotations

import csv
from pathlib import Path

from truing.errors import RecordingError

from .foreign import Finding, ForeignTest, ImportOptions
from .mapping import EXAMPLE, Mapping, apply, read_mapping

KIND = "CSV with a mapping"


def matches(path: Path, head: bytes) -> bool:
    """Whether this is a text table: a name that says so, and a first line with separators."""
    return path.suffix.lower() in (".csv", ".tsv", ".txt") and any(
        mark in head for mark in (b",", b";", b"\t")
    )


def find_mapping(path: Path, options: ImportOptions) -> Mapping:
    """The mapping that was asked for, or that of `<name>.mapping.toml` or `mapping.toml` beside the file."""
    if isinstance(options.mapping, Mapping):
        return options.mapping
    candidates = [path.with_name(f"{path.name.split('.')[0]}.mapping.toml"), path.with_name("mapping.toml")]
    for candidate in [options.mapping] if options.mapping else candidates:
        if candidate.exists():
            return read_mapping(candidate)
    if options.mapping:
        raise RecordingError(options.mapping, "no such mapping file")
    names = " or ".join(candidate.name for candidate in candidates)
    raise RecordingError(
        path,
        f"its columns are not our own, and there is no mapping: {names} beside it or truing import --mapping",
        next_step=EXAMPLE,
    )


def read(path: Path, options: ImportOptions) -> tuple[list[ForeignTest], list[Finding]]:
    """The file's rows, as the mapping says."""
    mapping = find_mapping(path, options)
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            sample = stream.read(4096)
            stream.seek(0)
            delimiter = max(",;\t", key=sample.count)
            rows = list(csv.reader(stream, delimiter=delimiter, skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(path, f"cannot be read: {error}") from None
    while rows and not rows[-1]:
        rows.pop()
    if len(rows) < 2:
        raise RecordingError(path, "no rows below the header")
    header = [name.strip() for name in rows[0]]
    for number, row in enumerate(rows[1:], start=1):
        # Some writers close every line with a separator.
        if len(row) != len(header) and not (len(row) == len(header) + 1 and not row[-1].strip()):
            raise RecordingError(path, f"{len(row)} cells where the header has {len(header)}", row=number)
    table = {name: [row[i] for row in rows[1:]] for i, name in enumerate(header)}
    return apply(mapping, table, path), []
