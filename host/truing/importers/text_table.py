"""Text tables as programs and people write them: comments, odd separators, no header, decimal commas."""

from __future__ import annotations

import csv
import gzip
import math
import re
import zlib
from collections import Counter
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from truing.arrays import FloatArray
from truing.errors import RecordingError

SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".log", ".asc")
GZIP = b"\x1f\x8b"
COMMENTS = ("#", "%", "//", "!")
MISSING = frozenset({"", "nan", "na", "n/a", "null", "none", "-", "--", "inf", "-inf", "#n/a", "nil"})
# Lines that are looked at to find the form of the table.
LOOKED_AT = 400
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$")
_COMMA_NUMBER = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?$")
_ISO = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d|\d\d:\d\d:\d\d(\.\d+)?$")
_WIDE = re.compile(r"\t+|\s{2,}")
_UNIT_ROW = re.compile(r"^[\[(]?[A-Za-z°µ%/^0-9*._ -]{0,12}[\])]?$")


@dataclass(frozen=True, slots=True)
class TextTable:
    """A table of a file.

    Attributes
    ----------
    numbers : columns that hold numbers, shape (n,) each, NaN where a cell holds none; ISO times in seconds.
    texts : columns that hold text.
    units : by column, where a line below the header or the name itself says one.
    lines : shape (n,), the line of the file that each row stands in.
    iso : columns that held ISO times.
    notes : what was skipped or taken for something, for the user.
    """

    path: Path
    numbers: dict[str, FloatArray]
    texts: dict[str, tuple[str, ...]]
    units: dict[str, str]
    lines: tuple[int, ...]
    iso: frozenset[str] = frozenset()
    notes: tuple[str, ...] = field(default=())

    @property
    def names(self) -> tuple[str, ...]:
        """All columns, those of numbers first."""
        return (*self.numbers, *self.texts)

    def __len__(self) -> int:
        return len(self.lines)


def read_text_table(path: Path) -> TextTable:
    """Read a text table, whatever its form, packed by gzip or not.

    Raises
    ------
    RecordingError : no text, or no table of numbers; names the line and says what is expected.
    """
    lines = _lines(path)
    notes: list[str] = []
    kept = [(number, line) for number, line in lines if not line.lstrip().startswith(COMMENTS)]
    if len(kept) < len(lines):
        notes.append(f"{len(lines) - len(kept)} comment lines skipped")
    if not kept:
        raise RecordingError(path, "holds nothing but comments")
    separator = _separator([line for _, line in kept[:LOOKED_AT]])
    rows = [(number, _cells(line, separator)) for number, line in kept]
    if sum(not cells[-1] for _, cells in rows) > 0.9 * len(rows):
        # Some writers close every line with a separator.
        rows = [(number, cells if cells[-1] else cells[:-1]) for number, cells in rows]
    width = Counter(len(cells) for _, cells in rows).most_common(1)[0][0]
    decimal_comma = separator != "," and _has_decimal_commas([cells for _, cells in rows[:LOOKED_AT]])
    if decimal_comma:
        notes.append("decimal commas read as points")
        rows = [(number, [_point(cell) for cell in cells]) for number, cells in rows]
    first = next(
        (k for k, (_, cells) in enumerate(rows) if len(cells) == width and _is_data(cells)), len(rows)
    )
    if first == len(rows):
        raise RecordingError(
            path, f"no line of {width} numbers", next_step="A table with a row per sample is due"
        )
    above = [line for line in lines if line[0] < rows[first][0]]
    header, units, skipped = _header(rows[:first], above, separator, width)
    if skipped:
        notes.append(f"{skipped} lines before the table skipped")
    if header is None:
        header = [f"column_{k}" for k in range(1, width + 1)]
        notes.append("no header: the columns are named by their number")
    body: list[tuple[int, list[str]]] = []
    odd: list[tuple[int, list[str]]] = []
    for number, cells in rows[first:]:
        # Some writers close every line with a separator.
        if len(cells) == width + 1 and not cells[-1]:
            cells = cells[:-1]
        (body if len(cells) == width else odd).append((number, cells))
    if odd:
        notes.append(f"{len(odd)} lines without {width} cells left out, the first is line {odd[0][0]}")
    return _columns(path, header, units, body, notes)


def _lines(path: Path) -> list[tuple[int, str]]:
    """Lines that are not empty, with their numbers."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordingError(path, f"cannot be read: {error.strerror}") from None
    if data.startswith(GZIP):
        try:
            data = gzip.decompress(data)
        except (OSError, EOFError, zlib.error):
            raise RecordingError(path, "a .gz file that is damaged or cut off") from None
    if b"\0" in data[:4096] and not data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise RecordingError(path, "not a text table: it holds bytes that are zero")
    encoding = "utf-16" if data.startswith((b"\xff\xfe", b"\xfe\xff")) else "utf-8-sig"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    numbered = enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1)
    found = [(number, line) for number, line in numbered if line.strip()]
    if not found:
        raise RecordingError(path, "the file is empty")
    return found


def _separator(lines: list[str]) -> str | None:
    """What stands between cells; None: any white space."""
    best, most = None, 0
    for mark in (";", "\t", ",", "|"):
        counts = Counter(line.count(mark) for line in lines)
        count, times = counts.most_common(1)[0]
        if count > 0 and times >= 0.6 * len(lines):
            # Decimal commas between white space or semicolons are no separators.
            if mark == "," and all(_COMMA_NUMBER.match(part) for part in lines[-1].split()):
                continue
            if count > most:
                best, most = mark, count
                if mark == ";":
                    break
    return best


def _cells(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return line.split()
    if '"' in line:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]
    return [cell.strip() for cell in line.split(separator)]


def _has_decimal_commas(rows: list[list[str]]) -> bool:
    commas = sum(bool(_COMMA_NUMBER.match(cell)) for cells in rows for cell in cells)
    points = sum("." in cell and bool(_NUMBER.match(cell)) for cells in rows for cell in cells)
    return commas > 10 * points and commas > 0


def _point(cell: str) -> str:
    return cell.replace(",", ".") if _COMMA_NUMBER.match(cell) else cell


def _is_data(cells: list[str]) -> bool:
    """Whether most cells are numbers or times: no header has that."""
    numbers = sum(bool(_NUMBER.match(cell) or _ISO.match(cell)) for cell in cells)
    return numbers > 0 and numbers + sum(cell.lower() in MISSING for cell in cells) >= 0.5 * len(cells)


def _header(
    above: list[tuple[int, list[str]]],
    lines: list[tuple[int, str]],
    separator: str | None,
    width: int,
) -> tuple[list[str] | None, dict[str, str], int]:
    """Names of the columns, their units, and how many lines above are neither."""
    fitting = [
        cells for _, cells in above if len(cells) == width or (len(cells) == width + 1 and not cells[-1])
    ]
    units: list[str] = []
    if len(fitting) > 1 and all(_UNIT_ROW.match(cell) for cell in fitting[-1]):
        units = [cell.strip("[]() ") for cell in fitting[-1]]
        fitting.pop()
    if not fitting:
        # The header itself may be a comment: `# t v w`.
        for _, line in reversed(lines):
            text = line.lstrip()
            mark = next((mark for mark in COMMENTS if text.startswith(mark)), None)
            inside = text[len(mark) :].strip() if mark else ""
            # Names may hold single spaces where columns stand further apart.
            ways = (_cells(inside, separator), _WIDE.split(inside), inside.split())
            cells = next((one for one in ways if len(one) == width), [])
            if cells and not _is_data(cells):
                fitting = [cells]
                break
    skipped = max(len(above) - bool(fitting) - bool(units), 0)
    if not fitting:
        return None, {}, skipped
    names: list[str] = []
    for k, name in enumerate(fitting[-1][:width]):
        plain = name.strip() or f"column_{k + 1}"
        names.append(plain if plain not in names else f"{plain}_{k + 1}")
    return names, dict(zip(names, units, strict=False)), skipped


def _columns(
    path: Path, header: list[str], units: dict[str, str], body: list[tuple[int, list[str]]], notes: list[str]
) -> TextTable:
    numbers: dict[str, FloatArray] = {}
    texts: dict[str, tuple[str, ...]] = {}
    iso = set()
    for name, cells in zip(header, zip(*(cells for _, cells in body), strict=True), strict=True):
        plain = _plain_numbers(cells)
        if plain is not None:
            numbers[name] = plain
            continue
        present = [cell for cell in cells if cell.lower() not in MISSING]
        if present and sum(bool(_ISO.match(cell)) for cell in present) > 0.9 * len(present):
            numbers[name] = np.array([_seconds(cell) for cell in cells])
            iso.add(name)
            continue
        values = np.array([_number(cell) for cell in cells])
        if np.isnan(values).sum() - (len(cells) - len(present)) > 0.1 * len(cells):
            texts[name] = cells
        else:
            numbers[name] = values
    lines = tuple(number for number, _ in body)
    return TextTable(path, numbers, texts, units, lines, frozenset(iso), tuple(notes))


def _plain_numbers(cells: tuple[str, ...]) -> FloatArray | None:
    """The column where every cell is a number, else None, and each has to be looked at."""
    try:
        values = np.fromiter(map(float, cells), dtype=np.float64, count=len(cells))
    except ValueError:
        return None
    return values if np.isfinite(values).all() and not any("_" in cell for cell in cells) else None


def _number(cell: str) -> float:
    try:
        # float() would read 1_000 as a thousand; no program that writes tables means that.
        value = math.nan if "_" in cell else float(cell)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def _seconds(cell: str) -> float:
    """Seconds of an ISO time, or of a time of day."""
    text = cell.strip().replace("Z", "+00:00")
    try:
        if re.match(r"\d\d:", text):
            hours, minutes, seconds = text.split(":")
            return 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds)
        found = datetime.fromisoformat(text)
    except ValueError:
        return math.nan
    return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()
