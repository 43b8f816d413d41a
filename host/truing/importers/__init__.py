"""Foreign recordings: one importer per kind of file, all with `KIND`, `matches` and `read`."""

from __future__ import annotations

from collections.abc import Mapping as AnyMapping
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

from truing.errors import RecordingError
from truing.recording.run import MINIMUM_ROWS

from .foreign import Finding, ForeignTest, Imported, ImportOptions, to_run
from .recording_set import read_runs

if TYPE_CHECKING:
    from .mapping import Mapping

__all__ = [
    "Finding",
    "ImportOptions",
    "Imported",
    "import_file",
    "import_files",
    "import_table",
    "is_foreign",
    "read_runs",
    "without_mapping",
]

HEAD_BYTES = 4096


class Importer(Protocol):
    """What a module of this package offers."""

    KIND: str

    def matches(self, path: Path, head: bytes) -> bool:
        """Whether the file is one of this kind, judged by its name and its first bytes."""

    def read(self, path: Path, options: ImportOptions) -> tuple[list[ForeignTest], list[Finding]]:
        """The file's tests, and what its format leaves open."""


def importers() -> tuple[Importer, ...]:
    """Every importer, in the order in which files are tried: the surest signatures come first."""
    from . import mapped_csv, matlab, mcap_json, rosbag, sysid_json, wpilog

    modules = (wpilog, matlab, mcap_json, rosbag, sysid_json, mapped_csv)
    return tuple(cast("Importer", module) for module in modules)


def is_foreign(path: Path) -> bool:
    """Whether a path is for an importer: neither a recording set nor one of its CSV files."""
    if path.is_dir():
        return (path / "metadata.yaml").exists()
    if not path.is_file():
        return False
    if path.suffix.lower() != ".csv":
        return True
    header = _head(path).split(b"\n", 1)[0].decode("utf-8-sig", errors="replace")
    names = [name.strip() for name in header.split(",")]
    # A run's file with one required column missing is reported as such, not as foreign.
    return "t_s" not in names or not any(name.startswith("effort") for name in names)


def import_file(path: Path, options: ImportOptions | None = None) -> Imported:
    """Every test of a foreign file as a run, and what was suspicious about it.

    Raises
    ------
    RecordingError : no importer knows the file, or it is damaged; names the place.
    """
    (imported,) = import_files([path], options)
    return imported


def import_files(paths: Sequence[Path], options: ImportOptions | None = None) -> list[Imported]:
    """Files of one robot, in their order: what its wiring is, all of them decide together.

    Raises
    ------
    RecordingError : no importer knows a file, or it is damaged; names the place.
    """
    from .traps import turn_signs

    options = options or ImportOptions()
    read = [(path, *_read(path, options)) for path in paths]
    signs = turn_signs([test for _, _, tests, _ in read for test in tests])
    return [
        _imported(path, kind, tests, findings, options, signs if number == 0 else [])
        for number, (path, kind, tests, findings) in enumerate(read)
    ]


def _read(path: Path, options: ImportOptions) -> tuple[str, list[ForeignTest], list[Finding]]:
    """Kind, tests and findings of a file; tests that are too short for a run are left out."""
    head = _head(path)
    importer = next((item for item in importers() if item.matches(path, head)), None)
    if importer is None:
        kinds = ", ".join(item.KIND for item in importers())
        raise RecordingError(path, "no importer knows this file", next_step=f"Known kinds: {kinds}")
    tests, findings = importer.read(path, options)
    return importer.KIND, *_long_enough(path, tests, findings)


def _long_enough(
    path: Path, tests: list[ForeignTest], findings: list[Finding]
) -> tuple[list[ForeignTest], list[Finding]]:
    kept = [test for test in tests if test.time.size >= MINIMUM_ROWS]
    findings = findings + [
        Finding("too_short", f"only {test.time.size} rows; left out", test.name)
        for test in tests
        if test.time.size < MINIMUM_ROWS
    ]
    if not kept:
        raise RecordingError(path, f"no test has the {MINIMUM_ROWS} rows that a run needs")
    return kept, findings


def without_mapping(files: Sequence[Path], options: ImportOptions) -> list[Path]:
    """The files among these that are tables for which no mapping was given or lies beside them."""
    from . import mapped_csv, matlab

    found = []
    for file in files:
        head = _head(file)
        importer = next((item for item in importers() if item.matches(file, head)), None)
        table = importer is mapped_csv or (importer is matlab and not matlab.has_own_columns(file))
        if table and not mapped_csv.has_mapping(file, options):
            found.append(file)
    return found


def messages_without_mapping(file: Path, options: ImportOptions) -> dict[str, tuple[float, float]]:
    """The columns, with the ends of their ranges, of an MCAP file that has no mapping; of others none."""
    from . import mapped_csv, mcap_json

    if not mcap_json.matches(file, _head(file)) or mapped_csv.has_mapping(file, options):
        return {}
    return mcap_json.columns_of(file)


def import_table(
    table: AnyMapping[str, Sequence[Any]], name: str, mapping: Mapping, options: ImportOptions | None = None
) -> Imported:
    """Columns in memory as runs, by a mapping; `name` stands in errors for the file.

    Raises
    ------
    RecordingError : a column is missing, or holds what is no number; names it and the row.
    """
    from .mapping import apply
    from .traps import turn_signs

    source = Path(name)
    tests, findings = _long_enough(source, apply(mapping, table, source), [])
    return _imported(source, "table", tests, findings, options or ImportOptions(), turn_signs(tests))


def _imported(
    path: Path,
    kind: str,
    tests: list[ForeignTest],
    findings: list[Finding],
    options: ImportOptions,
    signs: list[Finding],
) -> Imported:
    """Tests as runs, once they have been looked at; `signs`: what was said of their drives' signs."""
    from .traps import inspect

    findings = [*findings, *signs, *inspect(path, tests)]
    runs = tuple(to_run(test, number, options, path, findings) for number, test in enumerate(tests, start=1))
    return Imported(path, kind, runs, tuple(findings))


def _head(path: Path) -> bytes:
    if path.is_dir():
        return b""
    try:
        with path.open("rb") as stream:
            return stream.read(HEAD_BYTES)
    except OSError as error:
        raise RecordingError(path, f"cannot be read: {error.strerror}") from None
