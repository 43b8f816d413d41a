"""Reading and checking recordings: a run's CSV, its metadata, and a folder of runs."""

from __future__ import annotations

import csv
import io
import json
import math
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from truing.arrays import FloatArray
from truing.errors import FileError, RecordingError
from truing.recording.axis import Axis, as_wheels, axis_of, names_of_wheels
from truing.recording.baseline import Baseline, read_baseline
from truing.recording.effort_convention import read_effort_acts, with_effort_before
from truing.recording.plain_table import parse_plain
from truing.recording.run import (
    MINIMUM_ROWS,
    MODES,
    MOTION_PAIRS,
    REQUIRED_COLUMNS,
    TRUTH_COLUMNS,
    RecordingSet,
    Run,
    RunMetadata,
    known_columns,
)

METADATA_SUFFIX = ".meta.json"


def read_run(path: str | Path) -> Run:
    """Read one run's CSV and check it against docs/DATA_FORMAT.md.

    Raises
    ------
    RecordingError
        Naming the file, and where it applies the column and the row.
    """
    path = Path(path)
    data = _read_bytes(path)
    header, columns, text_columns, mode, axis = _plain_columns(path, data) or _cell_by_cell(path, data)
    check_time(path, columns["t_s"])
    metadata, warnings = _read_metadata(path)
    if axis is not None:
        columns = as_wheels(columns)
        header = list(columns)
    return Run(path.stem, columns, mode, text_columns, tuple(header), path, metadata, warnings, axis)


_Columns: TypeAlias = tuple[
    list[str], dict[str, FloatArray], dict[str, tuple[str, ...]], tuple[str, ...] | None, Axis | None
]


def _plain_columns(path: Path, data: bytes) -> _Columns | None:
    """Columns of a file of numbers; None where a cell needs a closer look."""
    parsed = parse_plain(data)
    if parsed is None:
        return None
    header, numbers, mode = parsed
    axis = axis_of(header)
    check_header(path, header if axis is None else names_of_wheels(header))
    columns = {name: column for name, column in zip(header, numbers, strict=True) if name != "mode"}
    known = known_columns(axis)
    finite = all(np.isfinite(column).all() for name, column in columns.items() if name in known)
    if not finite or len(columns["t_s"]) < MINIMUM_ROWS:
        return None
    return header, columns, {}, mode, axis


def _cell_by_cell(path: Path, data: bytes) -> _Columns:
    """Columns of any file; what is wrong with it is named by column and row."""
    rows, numbers_ok = _split(path, _decoded(path, data))
    header = [cell.strip() for cell in rows[0]]
    axis = axis_of(header)
    check_header(path, header if axis is None else names_of_wheels(header))
    body = _check_shape(path, header, rows[1:])

    columns: dict[str, FloatArray] = {}
    text_columns: dict[str, tuple[str, ...]] = {}
    mode: tuple[str, ...] | None = None
    for name, cells in zip(header, zip(*body, strict=True), strict=True):
        if name == "mode":
            mode = _check_mode(path, cells)
        elif name in known_columns(axis):
            columns[name] = _to_numbers(path, name, cells, numbers_ok)
        else:
            unknown = _unknown_numbers(cells)
            if unknown is None:
                text_columns[name] = cells
            else:
                columns[name] = unknown
    return header, columns, text_columns, mode, axis


def read_recording_set(path: str | Path, model: str | Path | None = None) -> RecordingSet:
    """Read a recording set, a plain folder of CSV files, or a single CSV file as a set of one.

    Parameters
    ----------
    model : a baseline.toml to use instead of the one in the folder.
    """
    path = Path(path)
    files = run_files(path)
    baseline = _find_baseline(path, model)
    acts = read_effort_acts(path)
    runs = tuple(with_effort_before(read_run(file), acts) for file in files)
    folder = path.parent if path.is_file() else path
    name = path.stem if path.is_file() else folder.resolve().name
    if baseline is not None and baseline.robot is not None and baseline.robot.name and not path.is_file():
        name = baseline.robot.name
    return RecordingSet(name, runs, baseline, path)


def run_files(path: str | Path) -> tuple[Path, ...]:
    """The CSV files that `path` stands for, in the order of their names."""
    path = Path(path)
    if not path.exists():
        raise FileError(path, "no such file or folder")
    if path.is_file():
        return (path,)
    runs = path / "runs"
    folder = runs if runs.is_dir() else path
    try:
        files = sorted(
            (item for item in folder.iterdir() if item.suffix.lower() == ".csv" and item.is_file()),
            key=lambda item: item.name,
        )
    except OSError as error:
        raise FileError(folder, f"cannot be read: {error.strerror}") from None
    if not files:
        raise FileError(
            folder, "holds no CSV file", "A set keeps its runs as runs/01_NAME.csv, runs/02_NAME.csv, ..."
        )
    return tuple(files)


def _find_baseline(path: Path, model: str | Path | None) -> Baseline | None:
    if model is not None:
        return read_baseline(model)
    if path.is_file():
        places = [path.parent, path.parent.parent] if path.parent.name == "runs" else [path.parent]
    else:
        places = [path, path.parent] if path.name == "runs" else [path]
    for place in places:
        if (place / "baseline.toml").is_file():
            return read_baseline(place / "baseline.toml")
    return None


def _read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise FileError(path, "no such file") from None
    except OSError as error:
        raise FileError(path, f"cannot be read: {error.strerror}") from None


def _decoded(path: Path, data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise RecordingError(
            path,
            f"line {line} holds bytes that are not UTF-8 text (byte {error.start})",
            next_step="Save the file as UTF-8, comma separated",
        ) from None


def _split(path: Path, text: str) -> tuple[list[list[str]], bool]:
    """Cells by row, and whether Python's float() may be trusted on them as it stands."""
    if '"' in text:
        try:
            rows = list(csv.reader(io.StringIO(text), strict=True))
        except csv.Error as error:
            raise RecordingError(path, f"not a readable CSV: {error}") from None
    else:
        # splitlines() would also split at form feeds and the like, and shift the row numbers.
        lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
        rows = [line.split(",") if line else [] for line in lines]
    while rows and not any(cell.strip() for cell in rows[-1]):
        rows.pop()
    if not rows:
        raise RecordingError(path, "the file is empty", next_step="Record the run, or fetch its log, again")
    return rows, text.find("_", text.find("\n")) < 0


def check_header(path: Path, header: list[str]) -> None:
    """Check the names of a run's columns: each has one, none comes twice, the required ones are there."""
    if len(header) == 1 and any(mark in header[0] for mark in ";\t"):
        raise RecordingError(path, "the header is not comma separated", next_step="Save the file with commas")
    seen: set[str] = set()
    for position, name in enumerate(header, start=1):
        if not name:
            raise RecordingError(path, f"column {position} has no name in the header")
        if name in seen:
            raise RecordingError(path, "the header names this column twice", column=name)
        seen.add(name)
    for name in REQUIRED_COLUMNS:
        if name not in seen:
            raise RecordingError(
                path, "required, but missing", column=name, next_step=f"The file has: {', '.join(header)}"
            )
    if not any(all(name in seen for name in pair) for pair in MOTION_PAIRS.values()):
        half = [pair for pair in MOTION_PAIRS.values() if seen & set(pair)]
        if half:
            name = next(name for name in half[0] if name not in seen)
            raise RecordingError(path, "required, but missing; the other wheel's is there", column=name)
        raise RecordingError(
            path,
            "wheel motion is missing: ticks_left and ticks_right, or pos_left_m and pos_right_m, "
            "or vel_left_mps and vel_right_mps are required",
            column="ticks_left",
            next_step=f"The file has: {', '.join(header)}",
        )


def _check_shape(path: Path, header: list[str], rows: list[list[str]]) -> list[list[str]]:
    width = len(header)
    for number, row in enumerate(rows, start=1):
        if len(row) != width:
            if not row:
                raise RecordingError(path, "an empty line between the rows", row=number)
            column = header[len(row)] if len(row) < width else None
            raise RecordingError(
                path, f"{len(row)} cells where the header has {width}", column=column, row=number
            )
    if len(rows) < MINIMUM_ROWS:
        raise RecordingError(
            path,
            f"only {len(rows)} rows of data; at least {MINIMUM_ROWS} are needed",
            row=len(rows) or None,
            next_step="Record for longer, or at a higher rate",
        )
    return rows


def _to_numbers(path: Path, name: str, cells: tuple[str, ...], trusted: bool) -> FloatArray:
    if name in TRUTH_COLUMNS and not all(cells):
        # In rows without one nothing outside saw the robot.
        known = np.full(len(cells), np.nan)
        for number, cell in enumerate(cells, start=1):
            if cell:
                _check_number(path, name, number, cell)
                known[number - 1] = float(cell)
        return known
    values: FloatArray | None
    try:
        values = np.fromiter(map(float, cells), dtype=np.float64, count=len(cells))
    except ValueError:
        values = None
    if values is None or not np.isfinite(values).all() or not trusted:
        for number, cell in enumerate(cells, start=1):
            _check_number(path, name, number, cell)
    assert values is not None
    return values


def _check_number(path: Path, name: str, number: int, cell: str) -> None:
    text = cell.strip()
    if not text:
        raise RecordingError(path, "the cell is empty", column=name, row=number)
    try:
        # float() would read 1_000 as a thousand; no CSV writer means that.
        value = math.nan if "_" in text else float(cell)
    except ValueError:
        value = None
    if value is None or "_" in text:
        raise RecordingError(path, f"{_shorten(text)!r} is not a number", column=name, row=number)
    if not math.isfinite(value):
        raise RecordingError(path, f"{_shorten(text)!r} is not a finite number", column=name, row=number)


def _shorten(text: str) -> str:
    return text if len(text) <= 32 else text[:29] + "..."


def _check_mode(path: Path, cells: tuple[str, ...]) -> tuple[str, ...]:
    modes = tuple(cell.strip() for cell in cells)
    if not set(modes) <= set(MODES):
        number, value = next((k, mode) for k, mode in enumerate(modes, start=1) if mode not in MODES)
        raise RecordingError(
            path, f"{_shorten(value)!r} is not a mode (idle, effort or velocity)", column="mode", row=number
        )
    return modes


def _unknown_numbers(cells: tuple[str, ...]) -> FloatArray | None:
    """An unknown column as numbers if it holds nothing else (not-a-number included), else None."""
    try:
        return np.fromiter(map(float, cells), dtype=np.float64, count=len(cells))
    except ValueError:
        return None


def check_time(path: Path, t_s: FloatArray) -> None:
    """Check that time, shape (n,), s, runs forward."""
    backwards = np.flatnonzero(np.diff(t_s) < 0.0)
    if backwards.size:
        row = int(backwards[0]) + 1
        raise RecordingError(
            path,
            f"time runs backwards, from {t_s[row - 1]:.6g} s to {t_s[row]:.6g} s",
            column="t_s",
            row=row + 1,
            next_step="Split the file where the recorder restarted: one file per run",
        )
    if t_s[-1] == t_s[0]:
        raise RecordingError(path, "time stands still", column="t_s", row=len(t_s))


def _read_metadata(path: Path) -> tuple[RunMetadata | None, tuple[str, ...]]:
    """The metadata beside a run; a damaged file costs a warning, never the run."""
    file = path.with_name(path.stem + METADATA_SUFFIX)
    try:
        data = file.read_bytes()
    except FileNotFoundError:
        return None, ()
    except OSError as error:
        return None, (f"{file.name} cannot be read ({error.strerror}); the run is used without its metadata",)
    try:
        tree = json.loads(data)
        if not isinstance(tree, dict):
            raise ValueError("not a table of values")
        return _metadata_from_tree(tree), ()
    except (ValueError, TypeError, RecursionError) as error:
        return None, (f"{file.name} is damaged ({error}); the run is used without its metadata",)


def _metadata_from_tree(tree: dict[str, Any]) -> RunMetadata:
    known = dict.fromkeys(("firmware", "parameters", "plan", "seed", "pause_before_s"))
    for name in ("firmware", "parameters", "plan"):
        if not isinstance(tree.get(name, {}), dict):
            raise ValueError(f"{name} is not a table")
    pause = tree.get("pause_before_s")
    return RunMetadata(
        firmware=dict(tree.get("firmware", {})),
        parameters={str(name): float(value) for name, value in tree.get("parameters", {}).items()},
        plan=dict(tree.get("plan", {})),
        seed=None if tree.get("seed") is None else int(tree["seed"]),
        pause_before_s=None if pause is None else float(pause),
        extra={name: value for name, value in tree.items() if name not in known and name != "schema"},
    )
