"""A small TOML file that says which column of a foreign table is which column of a run.

Example::

    effort = "after"      # optional: a row's effort acts in the interval after the row (default: "before")

    [columns]
    t_s = { column = "time", scale = 1e-3 }           # milliseconds
    effort_left = { column = "leftPwm", scale = 0.00392 }
    effort_right = { column = "rightPwm", scale = 0.00392 }
    ticks_left = "leftEncoder"
    ticks_right = "rightEncoder"

    [split]                                            # optional: a run per value of a column
    column = "test"
    skip = ["none"]
"""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Mapping as AnyMapping
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import FileError, RecordingError
from truing.recording.axis import AXIS_COLUMNS, Axis, axis_of, wheel_columns
from truing.recording.effort_convention import EffortActs, effort_acts, shifted
from truing.recording.run import EFFORT_PAIR, MOTION_PAIRS, NUMERIC_COLUMNS, REQUIRED_COLUMNS

from .foreign import ForeignTest

EXAMPLE = (
    'A mapping says [columns] t_s = { column = "time", scale = 1e-3 } and so on; see truing import --help'
)


@dataclass(frozen=True, slots=True)
class Source:
    """Where a column comes from: `scale * column + offset`; `scaled` when the user gave a scale."""

    column: str
    scale: float = 1.0
    offset: float = 0.0
    scaled: bool = False


@dataclass(frozen=True, slots=True)
class Mapping:
    """A mapping file's content; `effort`: the interval that a row's effort acts in; `axis`: of one motor."""

    path: Path
    columns: dict[str, Source]
    split: str | None = None
    skip: tuple[str, ...] = ()
    effort: EffortActs = "before"
    axis: Axis | None = None


def read_mapping(path: Path) -> Mapping:
    """Read and check a mapping file; errors name the file and the key."""
    try:
        tree = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise FileError(path, f"cannot be read as a mapping: {error}") from None
    return parse_mapping(tree, path)


def parse_mapping(tree: AnyMapping[str, Any], path: Path) -> Mapping:
    """A mapping from the content of its file; errors name `path` and the key."""
    raw = tree.get("columns")
    if not isinstance(raw, dict) or not raw:
        raise FileError(path, "has no [columns] table", EXAMPLE)
    columns: dict[str, Source] = {}
    axis = axis_of(list(raw))
    for name, value in raw.items():
        if name not in NUMERIC_COLUMNS and (axis is None or name not in AXIS_COLUMNS):
            known = ", ".join(sorted({*NUMERIC_COLUMNS, *AXIS_COLUMNS}))
            raise FileError(path, f"[columns] {name}: a run has no such column", f"A run has {known}")
        source = _source(path, name, value)
        columns |= dict.fromkeys((name,) if axis is None else wheel_columns(name), source)
    missing = [name for name in REQUIRED_COLUMNS if name not in columns]
    if not any(all(name in columns for name in pair) for pair in MOTION_PAIRS.values()):
        missing.append("one of the pairs " + ", ".join("/".join(pair) for pair in MOTION_PAIRS.values()))
    if missing:
        raise FileError(path, f"[columns] lacks {', '.join(missing)}")
    unknown = sorted(set(tree) - {"columns", "split", "effort"})
    if unknown:
        raise FileError(path, f"unknown key {unknown[0]!r}: there are [columns], [split] and effort")
    acts = effort_acts(path, tree.get("effort", "before"))
    if "split" not in tree:
        return Mapping(path, columns, effort=acts, axis=axis)
    split = tree["split"]
    if not isinstance(split, dict) or not isinstance(split.get("column"), str):
        raise FileError(path, "[split] needs column = NAME")
    skip = split.get("skip", [])
    if not isinstance(skip, list):
        raise FileError(path, f"[split] skip must be a list of values, not {skip!r}")
    return Mapping(path, columns, split["column"], tuple(str(value) for value in skip), acts, axis)


def _source(path: Path, name: str, value: Any) -> Source:
    if isinstance(value, str):
        return Source(value)
    if not isinstance(value, dict) or not isinstance(value.get("column"), str):
        raise FileError(
            path, f"[columns] {name}: a column's name or a table with `column` is due, not {value!r}"
        )
    unknown = set(value) - {"column", "scale", "offset"}
    if unknown:
        raise FileError(path, f"[columns] {name}: unknown key {sorted(unknown)[0]!r}")
    for key in ("scale", "offset"):
        number = value.get(key, 1.0)
        if isinstance(number, bool) or not isinstance(number, (int, float)) or not np.isfinite(number):
            raise FileError(path, f"[columns] {name}: {key} must be a finite number, not {number!r}")
    scale, offset = float(value.get("scale", 1.0)), float(value.get("offset", 0.0))
    return Source(value["column"], scale, offset, "scale" in value)


def apply(mapping: Mapping, table: AnyMapping[str, Sequence[Any]], source: Path) -> list[ForeignTest]:
    """The table's rows as tests, in the order in which they stand.

    Parameters
    ----------
    table : columns of equal length, numbers or text, by name.
    source : the file that they come from, for errors.
    """
    for name, wanted in mapping.columns.items():
        if wanted.column not in table:
            known = ", ".join(table)
            raise RecordingError(
                source,
                f"{mapping.path.name} takes {name} from a column that is not there; columns: {known}",
                column=wanted.column,
            )
    numbers = {name: _numbers(source, wanted, table) for name, wanted in mapping.columns.items()}
    tests = []
    for name, rows in _stretches(mapping, table, len(numbers["t_s"]), source):
        part = {column: values[rows] for column, values in numbers.items()}
        if mapping.effort == "after":
            part |= {column: shifted(part[column]) for column in EFFORT_PAIR}
        tests.append(_test(name, part, mapping.columns["t_s"].scaled))
        tests[-1].axis = mapping.axis
    return tests


def _numbers(source: Path, wanted: Source, table: AnyMapping[str, Sequence[Any]]) -> FloatArray:
    raw = table[wanted.column]
    values = np.empty(len(raw))
    for row, value in enumerate(raw):
        try:
            # float() would read 1_000 as a thousand; no program that writes tables means that.
            values[row] = float(str(value).replace("_", "?"))
        except ValueError:
            raise RecordingError(
                source, f"{value!r} is not a number", column=wanted.column, row=row + 1
            ) from None
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise RecordingError(source, "not a finite number", column=wanted.column, row=int(bad[0]) + 1)
    return wanted.scale * values + wanted.offset


def _stretches(
    mapping: Mapping, table: AnyMapping[str, Sequence[Any]], rows: int, source: Path
) -> list[tuple[str, slice]]:
    if mapping.split is None:
        return [(source.name.split(".")[0].lower(), slice(0, rows))]
    if mapping.split not in table:
        raise RecordingError(
            source, f"{mapping.path.name} splits by a column that is not there", column=mapping.split
        )
    labels = [str(value) for value in table[mapping.split]]
    edges = [0, *(row for row in range(1, rows) if labels[row] != labels[row - 1]), rows]
    return [
        (labels[begin].strip().replace(" ", "_").replace("-", "_"), slice(begin, end))
        for begin, end in itertools.pairwise(edges)
        if labels[begin] not in mapping.skip
    ]


def _test(name: str, columns: dict[str, FloatArray], time_known: bool) -> ForeignTest:
    def pair(left: str, right: str) -> FloatArray | None:
        if left not in columns or right not in columns:
            return None
        return np.array([columns.pop(left), columns.pop(right)])

    test = ForeignTest(name, columns.pop("t_s"), effort=pair("effort_left", "effort_right"))
    test.time_known = time_known
    test.position = pair("pos_left_m", "pos_right_m")
    test.speed = pair("vel_left_mps", "vel_right_mps")
    test.battery_v = columns.pop("battery_v", None)
    test.gyro_z_radps = columns.pop("gyro_z_radps", None)
    test.extra = columns
    return test
