"""Any CSV, through a mapping file."""

from __future__ import annotations

import csv
from pathlib import Path

from truing.errors import RecordingError

from .foreign import Finding, ForeignTest, ImportOptions
from .mapping import EXAMPLE, Mapping, apply, read_mapping
from .tables import columns_of, read_table
from .text_table import GZIP, SUFFIXES

KIND = "CSV with a mapping"


def matches(path: Path, head: bytes) -> bool:
    """Whether this is a text table: a name that says so, and a first line with separators, or packed."""
    if head.startswith(GZIP):
        return path.suffix.lower() == ".gz" and path.with_suffix("").suffix.lower() in SUFFIXES
    return path.suffix.lower() in SUFFIXES and any(mark in head for mark in (b",", b";", b"\t", b" ", b"|"))


def has_mapping(path: Path, options: ImportOptions) -> bool:
    """Whether a mapping was given, or lies beside the file."""
    return options.mapping is not None or any(one.exists() for one in _beside(path))


def _beside(path: Path) -> tuple[Path, Path]:
    return path.with_name(f"{path.name.split('.')[0]}.mapping.toml"), path.with_name("mapping.toml")


def find_mapping(path: Path, options: ImportOptions) -> Mapping:
    """The mapping that was asked for, or that of `<name>.mapping.toml` or `mapping.toml` beside the file."""
    if isinstance(options.mapping, Mapping):
        return options.mapping
    candidates = list(_beside(path))
    for candidate in [options.mapping] if options.mapping else candidates:
        if candidate.exists():
            return read_mapping(candidate)
    if options.mapping:
        raise RecordingError(options.mapping, "no such mapping file")
    names = " or ".join(candidate.name for candidate in candidates)
    raise RecordingError(
        path,
        f"its columns are not our own, and there is no mapping: {names} beside it or truing import --mapping",
        next_step=f"truing import {path} --out SET proposes one. {EXAMPLE}",
    )


def read(path: Path, options: ImportOptions) -> tuple[list[ForeignTest], list[Finding]]:
    """The file's rows, as the mapping says.

    A table with a header and commas alone is read strictly: a cell that is no number is an error with its
    row. One with comments, without a header, ..., or a mapping with `missing = "drop"`, is read as it is.
    """
    mapping = find_mapping(path, options)
    if mapping.missing == "drop" or options.pose is not None or not _has_header(path, mapping):
        return _lenient(path, mapping, options)
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


def _has_header(path: Path, mapping: Mapping) -> bool:
    """Whether the first line names a column that the mapping takes, so that the plain reader will do."""
    try:
        with path.open(encoding="utf-8-sig", errors="replace") as stream:
            first = stream.readline()
    except OSError:
        return True
    if path.suffix.lower() == ".gz":
        return False
    names = {cell.strip().strip('"') for mark in ",;\t" for cell in first.split(mark)}
    wanted = {name for source in mapping.columns.values() for name in source.names} - set(mapping.constants)
    return not first.lstrip().startswith(("#", "%", "//")) and bool(names & wanted or "," in first)


def _lenient(path: Path, mapping: Mapping, options: ImportOptions) -> tuple[list[ForeignTest], list[Finding]]:
    table = read_table(path, options.pose)
    columns = columns_of(table)
    findings = [Finding("table_form", note) for note in table.notes]
    tests = apply(mapping, columns, path)
    used = sum(test.time.size for test in tests)
    if mapping.rate_hz is not None and used < len(table):
        text = f"{len(table)} rows put together to {used} at about {mapping.rate_hz:g} Hz"
        findings.append(Finding("rows_put_together", text))
    elif used < len(table):
        text = (
            f"{len(table) - used} of {len(table)} rows left out: outside the asked time, of a test that is "
            "skipped, or without a number where one is needed"
        )
        findings.append(Finding("rows_left_out", text))
    return tests, findings
