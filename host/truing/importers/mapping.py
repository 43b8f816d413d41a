"""A small TOML file that says which column of a foreign table is which column of a run.

A column's source is a name, a table with `column`, `scale`, `offset`, a table with `expression` (arithmetic
over columns and [constants]) or one with `constant`. Columns of one wheel alone, or of an axis, make an axis.

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

    missing = "drop"      # optional, above the tables: rows with an empty cell are a gap (default: "error")
    [constants]
    b = 0.23              # for expressions: { expression = "v - w*b/2" }
    [rows]
    from_s = 2.0          # time of the first row that is kept, from the file's first; to_s: of the last
    rate_hz = 50          # rows of a faster recorder are put together: mean efforts and speeds
"""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Mapping as AnyMapping
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from truing.arrays import FloatArray
from truing.errors import FileError, RecordingError, TruingError
from truing.recording.axis import AXIS_COLUMNS, Axis, axis_of, wheel_columns
from truing.recording.effort_convention import EffortActs, effort_acts, shifted
from truing.recording.run import (
    EFFORT_PAIR,
    MOTION_PAIRS,
    NUMERIC_COLUMNS,
    REQUIRED_COLUMNS,
    TRUTH_COLUMNS,
    known_columns,
)

from .expression import Expression
from .foreign import ForeignTest

EXAMPLE = (
    'A mapping says [columns] t_s = { column = "time", scale = 1e-3 } and so on; see truing import --help'
)

# An outside pose is interpolated between samples that are at most this far apart, s.
LONGEST_POSE_GAP_S = 0.5


@dataclass(frozen=True, slots=True)
class Source:
    """Where a column comes from: `scale * column + offset`, an expression or a constant.

    `scaled`: the user gave a scale.
    """

    column: str
    scale: float = 1.0
    offset: float = 0.0
    scaled: bool = False
    expression: Expression | None = None
    constant: float | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The columns, and constants of the mapping, that it takes."""
        if self.constant is not None:
            return ()
        return (self.column,) if self.expression is None else self.expression.names


@dataclass(frozen=True, slots=True)
class Mapping:
    """A mapping file's content; `effort`: the interval that a row's effort acts in; `axis`: of one motor."""

    path: Path
    columns: dict[str, Source]
    split: str | None = None
    skip: tuple[str, ...] = ()
    effort: EffortActs = "before"
    axis: Axis | None = None
    constants: dict[str, float] = field(default_factory=dict)
    missing: Literal["error", "drop"] = "error"
    from_s: float | None = None
    to_s: float | None = None
    rate_hz: float | None = None


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
    raw, axis = _one_sided(raw)
    for name, value in raw.items():
        if name not in known_columns(axis):
            known = ", ".join(sorted({*NUMERIC_COLUMNS, *AXIS_COLUMNS}))
            raise FileError(path, f"[columns] {name}: a run has no such column", f"A run has {known}")
        source = _source(path, name, value)
        columns |= dict.fromkeys((name,) if axis is None else wheel_columns(name), source)
    missing = [name for name in REQUIRED_COLUMNS if name not in columns]
    if not any(all(name in columns for name in pair) for pair in MOTION_PAIRS.values()):
        missing.append("one of the pairs " + ", ".join("/".join(pair) for pair in MOTION_PAIRS.values()))
    if missing:
        raise FileError(path, f"[columns] lacks {', '.join(missing)}")
    keys = {"columns", "split", "effort", "constants", "missing", "rows"}
    unknown = sorted(set(tree) - keys)
    if unknown:
        raise FileError(path, f"unknown key {unknown[0]!r}: there are {', '.join(sorted(keys))}")
    limits = _numbers_table(path, tree, "rows", {"from_s", "to_s", "rate_hz"})
    plain = Mapping(
        path,
        columns,
        effort=effort_acts(path, tree.get("effort", "before")),
        axis=axis,
        constants=_numbers_table(path, tree, "constants", None),
        missing=_missing(path, tree.get("missing", "error")),
        from_s=limits.get("from_s"),
        to_s=limits.get("to_s"),
        rate_hz=_positive(path, limits.get("rate_hz")),
    )
    if "split" not in tree:
        return plain
    split = tree["split"]
    if not isinstance(split, dict) or not isinstance(split.get("column"), str):
        raise FileError(path, "[split] needs column = NAME")
    skip = split.get("skip", [])
    if not isinstance(skip, list):
        raise FileError(path, f"[split] skip must be a list of values, not {skip!r}")
    return replace(plain, split=split["column"], skip=tuple(str(value) for value in skip))


def _one_sided(raw: dict[str, Any]) -> tuple[dict[str, Any], Axis | None]:
    """The columns with those of one wheel alone under both sides, and the axis that they then are."""
    axis = axis_of(list(raw))
    if axis is not None:
        return raw, axis
    for side, other in (("left", "right"), ("right", "left")):
        own = [name for name in raw if side in name.split("_")]
        if own and not any(other in name.split("_") for name in raw):
            return raw | {name.replace(side, other): raw[name] for name in own}, Axis("translation")
    return raw, None


def _numbers_table(
    path: Path, tree: AnyMapping[str, Any], name: str, allowed: set[str] | None
) -> dict[str, float]:
    """A table of finite numbers; `allowed`: its keys."""
    table = tree.get(name, {})
    if not isinstance(table, dict):
        raise FileError(path, f"[{name}] must be a table, not {table!r}")
    for key, value in table.items():
        if allowed is not None and key not in allowed:
            raise FileError(path, f"[{name}] {key}: there are {', '.join(sorted(allowed))}")
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
            raise FileError(path, f"[{name}] {key} must be a finite number, not {value!r}")
    return {key: float(value) for key, value in table.items()}


def _positive(path: Path, rate_hz: float | None) -> float | None:
    if rate_hz is not None and rate_hz <= 0.0:
        raise FileError(path, f"[rows] rate_hz must be above zero, not {rate_hz:g}")
    return rate_hz


def _missing(path: Path, value: Any) -> Literal["error", "drop"]:
    if value == "drop":
        return "drop"
    if value == "error":
        return "error"
    raise FileError(path, f'missing must be "error" or "drop", not {value!r}')


def _source(path: Path, name: str, value: Any) -> Source:
    if isinstance(value, str):
        return Source(value)
    if isinstance(value, dict) and set(value) == {"expression"} and isinstance(value["expression"], str):
        try:
            return Source("", expression=Expression(value["expression"]), scaled=True)
        except TruingError as error:
            raise FileError(path, f"[columns] {name}: {error.message}", error.next_step) from None
    if isinstance(value, dict) and set(value) == {"constant"}:
        return Source("", constant=_numbers_table(path, {name: value}, name, None)["constant"], scaled=True)
    if not isinstance(value, dict) or not isinstance(value.get("column"), str):
        raise FileError(
            path,
            f"[columns] {name}: a column's name or a table with `column`, `expression` or `constant` is due, "
            f"not {value!r}",
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


def apply(mapping: Mapping, table: AnyMapping[str, Any], source: Path) -> list[ForeignTest]:
    """The table's rows as tests, in the order in which they stand.

    Parameters
    ----------
    table : columns of equal length by name, each an array or a sequence of numbers or texts.
    source : the file that they come from, for errors.
    """
    for name, wanted in mapping.columns.items():
        for column in wanted.names:
            if column not in table and column not in mapping.constants:
                known = ", ".join([*table, *mapping.constants])
                raise RecordingError(
                    source,
                    f"{mapping.path.name} takes {name} from a column that is not there; columns: {known}",
                    column=column,
                )
    raw = {
        column: _numbers(source, column, table[column], mapping.missing)
        for column in dict.fromkeys(
            column for wanted in mapping.columns.values() for column in wanted.names if column in table
        )
    }
    height = len(next(iter(table.values())))
    numbers = {name: _computed(wanted, raw, mapping, height) for name, wanted in mapping.columns.items()}
    table, numbers = _kept(mapping, table, numbers)
    tests = []
    for name, rows in _stretches(mapping, table, len(numbers["t_s"]), source):
        part = {column: values[rows] for column, values in numbers.items()}
        if mapping.effort == "after":
            part |= {column: shifted(part[column]) for column in EFFORT_PAIR}
        if mapping.rate_hz is not None:
            part = thinned(part, mapping.rate_hz)
        tests.append(_test(name, part, mapping.columns["t_s"].scaled))
        tests[-1].axis = mapping.axis
    return tests


def _computed(wanted: Source, raw: AnyMapping[str, FloatArray], mapping: Mapping, rows: int) -> FloatArray:
    """A column of a run, shape (rows,)."""
    if wanted.constant is not None:
        return np.full(rows, wanted.constant)
    if wanted.expression is not None:
        found = wanted.expression.evaluate({**mapping.constants, **raw})
        return np.array(np.broadcast_to(found, (rows,)))
    return wanted.scale * raw[wanted.column] + wanted.offset


def _kept(
    mapping: Mapping, table: AnyMapping[str, Sequence[Any]], numbers: dict[str, FloatArray]
) -> tuple[AnyMapping[str, Sequence[Any]], dict[str, FloatArray]]:
    """The rows inside the asked time that have all numbers; a pose from outside is filled over short gaps.

    Over longer ones it stays unknown, which is no reason to leave out what the wheels did meanwhile.
    """
    numbers = numbers | filled_pose(numbers)
    needed = [values for name, values in numbers.items() if name not in TRUTH_COLUMNS]
    keep = np.logical_and.reduce([np.isfinite(values) for values in needed])
    time = numbers["t_s"] - float(numbers["t_s"][np.isfinite(numbers["t_s"])][:1].sum())
    with np.errstate(invalid="ignore"):
        if mapping.from_s is not None:
            keep &= time >= mapping.from_s
        if mapping.to_s is not None:
            keep &= time <= mapping.to_s
    if keep.all():
        return table, numbers
    rows = np.flatnonzero(keep)
    kept = {name: [values[row] for row in rows] for name, values in table.items()}
    return kept, {name: values[rows] for name, values in numbers.items()}


def thinned(numbers: AnyMapping[str, FloatArray], rate_hz: float) -> dict[str, FloatArray]:
    """Rows put together to about this rate; each new one stands at the end of its interval.

    Efforts, speeds and the supply are means over it, weighted by time; counts, positions and poses are those
    at its end. A rate above the recorder's own changes nothing.
    """
    time = numbers["t_s"]
    interval = np.floor((time - time[0]) * rate_hz * (1.0 + 1e-9) - 1e-6).astype(np.int64)
    # The first row is a state, with no interval before it.
    first = np.flatnonzero(np.diff(interval, prepend=interval[0] - 1))
    last = np.append(first[1:] - 1, len(time) - 1)
    weights = np.diff(time, prepend=time[0])
    weights[0] = 1.0
    total = np.add.reduceat(weights, first)
    kept = {}
    for name, values in numbers.items():
        mean = name.split("_")[0] in ("effort", "vel", "battery", "gyro", "cmd")
        kept[name] = np.add.reduceat(weights * values, first) / total if mean else values[last]
    return kept


def filled_pose(numbers: AnyMapping[str, FloatArray]) -> dict[str, FloatArray]:
    """The outside pose between its own samples, where these are at most half a second apart.

    A camera, a beacon or GPS is slower than the wheels' log: its rows between are empty.
    """
    time = numbers["t_s"]
    found: dict[str, FloatArray] = {}
    for name in TRUTH_COLUMNS:
        values = numbers.get(name)
        if values is None or np.isfinite(values).all() or not np.isfinite(time).all():
            continue
        seen = np.flatnonzero(np.isfinite(values))
        if len(seen) < 2:
            continue
        known = np.unwrap(values[seen]) if name == "truth_theta_rad" else values[seen]
        between = np.interp(time, time[seen], known, left=np.nan, right=np.nan)
        after = np.clip(np.searchsorted(seen, np.arange(len(time))), 0, len(seen) - 1)
        before = np.clip(after - 1, 0, len(seen) - 1)
        near = time[seen[after]] - time[seen[before]] <= LONGEST_POSE_GAP_S
        found[name] = np.where(np.isfinite(values) | near, between, np.nan)
    return found


def _numbers(source: Path, column: str, raw: Sequence[Any], missing: Literal["error", "drop"]) -> FloatArray:
    if isinstance(raw, np.ndarray) and raw.dtype == np.float64:
        values = np.asarray(raw)
    else:
        values = _parsed(source, column, raw)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size and missing == "error":
        raise RecordingError(
            source,
            "not a finite number",
            column=column,
            row=int(bad[0]) + 1,
            next_step='missing = "drop" in the mapping takes rows without a number for gaps',
        )
    return values


def _parsed(source: Path, column: str, raw: Sequence[Any]) -> FloatArray:
    values = np.empty(len(raw))
    for row, value in enumerate(raw):
        try:
            # float() would read 1_000 as a thousand; no program that writes tables means that.
            values[row] = float(str(value).replace("_", "?"))
        except ValueError:
            raise RecordingError(source, f"{value!r} is not a number", column=column, row=row + 1) from None
    return values


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
