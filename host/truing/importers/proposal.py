"""A mapping for tables that have none: proposed from what their columns seem to hold, and written as TOML."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence
from collections.abc import Mapping as AnyMapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import RecordingError, TruingError

from .column_guess import Column, guess_columns, words
from .expression import Expression
from .foreign import NOMINAL_VOLTAGE_V
from .text_table import TextTable

# Between rows of a recorder, s.
STEPS_S = (5e-4, 2.0)
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
# Full effort where a file gives numbers of its timer or per cent.
FULL_EFFORTS = (1.0, 100.0, 255.0, 400.0, 1000.0, 1023.0, 2047.0, 4095.0, 10_000.0, 32_767.0, 65_535.0)
# Volts of a small motor, where numbers are no whole ones and nobody says what they are.
HIGHEST_MOTOR_V = 26.0
# An effort that ends a little above full is noise of the recorder.
ABOVE_FULL = 1.02
_SPEEDS = {
    "": 1.0,
    "m/s": 1.0,
    "mm/s": 1e-3,
    "cm/s": 1e-2,
    "rad/s": 1.0,
    "deg/s": np.pi / 180.0,
    "rpm": np.pi / 30.0,
    "rot/s": 2.0 * np.pi,
}
_LENGTHS = {"": 1.0, "m": 1.0, "mm": 1e-3, "cm": 1e-2, "rad": 1.0, "deg": np.pi / 180.0, "rot": 2.0 * np.pi}
_ANGULAR = {"rad/s", "deg/s", "rpm", "rot/s", "rad", "deg", "rot"}
NEEDED = (
    "A run needs time (t_s), effort (effort_left and effort_right, or effort), and motion (ticks_, pos_ or "
    "vel_ of both wheels, or ticks, pos_rad, vel_radps, pos_m, vel_mps of one axis)"
)


@dataclass(frozen=True, slots=True)
class Proposal:
    """A mapping as the tree of its file, and what was taken for what.

    Attributes
    ----------
    columns : of the first table, with their guesses.
    notes : what is not said by the files and was assumed.
    commanded : no wheel was measured; speeds are those that a body's motion commands.
    """

    tree: dict[str, Any]
    columns: tuple[Column, ...]
    notes: tuple[str, ...] = field(default=())
    commanded: bool = False

    def with_edit(self, text: str) -> Proposal:
        """The proposal with a line of a user's: `effort_left = pwmL / 255`, `b = 0.23; acts = after`.

        Raises
        ------
        TruingError : the line is no such thing, or takes a column that is not there.
        """
        found = self
        for part in text.split(";"):
            found = found._with_one(part.strip())
        return found

    def _with_one(self, text: str) -> Proposal:
        name, mark, value = (part.strip() for part in text.partition("="))
        if not mark or not name or not value:
            raise TruingError(f"{text!r}: NAME = EXPRESSION is due", NEEDED)
        tree = {**self.tree, "columns": dict(self.tree["columns"])}
        if name in ("from_s", "to_s", "rate_hz"):
            tree["rows"] = {**tree.get("rows", {}), name: _number(text, value)}
        elif name == "acts":
            tree["effort"] = value.strip("\"'")
        elif name.split("_")[0] in (
            "t",
            "effort",
            "ticks",
            "pos",
            "vel",
            "truth",
            "battery",
            "gyro",
            "x",
            "y",
            "theta",
        ):
            tree["columns"][name] = _edited(value, {column.name for column in self.columns}, tree)
        else:
            tree["constants"] = {**tree.get("constants", {}), name: _number(text, value)}
        return replace(self, tree=tree)

    def to_toml(self) -> str:
        """The mapping file."""
        return mapping_toml(self.tree)


def propose(
    tables: Sequence[TextTable],
    *,
    nominal_voltage_v: float = NOMINAL_VOLTAGE_V,
    full_effort: float | None = None,
    wheel_radius_m: float | None = None,
    wheelbase_m: float | None = None,
    full_speed_mps: float | None = None,
) -> Proposal:
    """A mapping for tables with the same columns.

    Parameters
    ----------
    nominal_voltage_v : full effort where efforts are volts, V.
    full_effort : the file's number for full effort; None: volts as above, else the next usual one.
    wheel_radius_m : turns rad/s and rpm of wheels into speeds at the rim, m.
    wheelbase_m : turns a body's speed and turn rate into those of its wheels, m.
    full_speed_mps : wheel speed of full effort, where only a body's motion is commanded, m/s.

    Raises
    ------
    RecordingError : the tables differ; names the file and the columns.
    """
    table = tables[0]
    for other in tables[1:]:
        if set(other.names) != set(table.names):
            odd = sorted(set(other.names) ^ set(table.names))
            raise RecordingError(
                other.path,
                f"its columns are not those of {table.path.name}: {', '.join(odd)}",
                next_step="Import files of different columns in calls of their own",
            )
    notes: list[str] = []
    columns = _one_axis(guess_columns(table), notes)
    found: dict[str, Any] = {"t_s": _time(tables, columns, notes)}
    constants: dict[str, float] = {}
    commanded = False
    found |= _efforts(tables, _with_left_over(columns, notes), (nominal_voltage_v, full_effort), notes)
    if not any(name.startswith("effort") for name in found):
        twist = _twist(columns, (wheelbase_m, full_speed_mps), constants, notes)
        commanded = bool(twist)
        found |= twist
    sides = "effort_left" in found
    if not any(name.startswith("vel") for name in found):
        found |= _motion(columns, sides, wheel_radius_m, wheelbase_m, constants, notes)
    found |= _others(columns, sides)
    tree: dict[str, Any] = {"missing": "drop", "columns": {k: v for k, v in found.items() if v is not None}}
    if constants:
        tree["constants"] = constants
    split = next((column.name for column in columns if column.kind == "split"), None)
    if split is not None:
        tree["split"] = {"column": split}
    missing = _missing(tree["columns"])
    if missing:
        notes.append(f"not found: {', '.join(missing)}")
    return Proposal(tree, tuple(columns), tuple(notes), commanded)


def obedient_baseline(proposal: Proposal, name: str, interval_s: float) -> str | None:
    """A baseline's text for a motion that was only commanded: at full speed within half a row.

    None where wheels were measured: their gains and time constants are what `truing identify` finds.
    """
    if not proposal.commanded:
        return None
    constants = proposal.tree["constants"]
    wheel = f"gain_mps = {constants['full']!r}\ntime_constant_s = {0.5 * interval_s:.6g}\n"
    return (
        f"[robot]\nname = {json.dumps(name, ensure_ascii=False)}\nwheelbase_m = {constants['b']!r}\n"
        f"\n[wheel.left]\n{wheel}\n[wheel.right]\n{wheel}"
    )


def check_complete(proposal: Proposal, path: Path) -> None:
    """Stop where a proposal lacks what a run needs; names the file, what it has and what is due."""
    missing = _missing(proposal.tree["columns"])
    if missing:
        have = ", ".join(column.name for column in proposal.columns)
        hints = [note for note in proposal.notes if "--wheel" in note or "is no effort" in note]
        step = ". ".join([*dict.fromkeys(hints), NEEDED])
        raise RecordingError(path, f"not found: {', '.join(missing)}; its columns: {have}", next_step=step)


def _missing(names: Iterable[str]) -> list[str]:
    """What a run of these columns lacks."""
    kinds = {name.split("_")[0] for name in names}
    needed = {"time": {"t"}, "effort": {"effort"}, "motion": {"ticks", "pos", "vel"}}
    return [words for words, any_of in needed.items() if not kinds & any_of]


def mapping_toml(tree: AnyMapping[str, Any]) -> str:
    """A mapping file from its tree."""
    lines = [f"{key} = {_value(tree[key])}" for key in ("effort", "missing") if key in tree]
    for name in ("columns", "constants", "rows", "split"):
        if name in tree:
            lines += [
                "",
                f"[{name}]",
                *(f"{_key(key)} = {_value(value)}" for key, value in tree[name].items()),
            ]
    return "\n".join(lines).strip() + "\n"


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_value(part)}" for key, part in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(float(value))


def _key(name: str) -> str:
    return (
        name if name.replace("_", "").isalnum() and name.isascii() else json.dumps(name, ensure_ascii=False)
    )


def _scaled(name: str, scale: float) -> Any:
    return name if scale == 1.0 else {"column": name, "scale": float(f"{scale:.12g}")}


def _time(tables: Sequence[TextTable], columns: list[Column], notes: list[str]) -> Any:
    """The column of time with one unit for all files, which the files or the steps of all of them say."""
    column = next((column for column in columns if column.kind == "time"), None)
    if column is None:
        return None
    if column.unit in TIME_UNITS:
        return {"column": column.name, "scale": TIME_UNITS[column.unit]}
    medians = {table.path.name: float(np.nanmedian(np.diff(table.numbers[column.name]))) for table in tables}
    odd = [
        name for name, step in medians.items() if not 0.01 < step / np.median(list(medians.values())) < 100.0
    ]
    if odd:
        notes.append(
            f"{column.name}: rows of {', '.join(odd)} lie a hundred times nearer or further than usual"
        )
    steps = np.concatenate([np.diff(table.numbers[column.name]) for table in tables])
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    fitting = [unit for unit, scale in TIME_UNITS.items() if STEPS_S[0] <= step * scale <= STEPS_S[1]]
    whole = all(np.all(np.mod(table.numbers[column.name][:200], 1.0) == 0.0) for table in tables)
    if not fitting:
        notes.append(f"{column.name}: rows {step:.3g} apart are no time that is known; seconds assumed")
        return {"column": column.name, "scale": 1.0}
    unit = "ms" if whole and "ms" in fitting and step > 1.0 else fitting[0]
    where = "" if len(tables) == 1 else f" in all {len(tables)} files"
    notes.append(f"{column.name}: taken as {unit}{where}, rows {step:.4g} apart; no unit is said")
    return {"column": column.name, "scale": TIME_UNITS[unit]}


def _one_axis(columns: list[Column], notes: list[str]) -> list[Column]:
    """The columns without those of other numbered axes, where a table of drives has several.

    The one that moves furthest is kept: drives of one controller are logged together, and most stand still.
    """
    if any(column.side for column in columns):
        return columns
    kinds = ("pos", "vel", "effort", "ticks")
    numbers = {c.name: re.findall(r"\d+", c.name)[:1] for c in columns if c.kind in kinds}
    axes = {found[0] for found in numbers.values() if found}
    moved = {
        kind: {numbers[c.name][0]: c.high - c.low for c in columns if c.kind == kind and numbers[c.name]}
        for kind in ("ticks", "pos", "vel")
    }
    spans = next((one for one in moved.values() if len(one) > 1), None)
    if spans is None or len(axes) < 3 or not all(numbers.values()):
        # Two of them may be the wheels of a robot, left and right.
        return columns
    chosen = max(spans, key=lambda axis: spans[axis])
    notes.append(f"of axes {', '.join(sorted(axes))}: {chosen}, which moves furthest, is taken")
    return [
        column if numbers.get(column.name, [chosen]) == [chosen] else replace(column, kind="other")
        for column in columns
    ]


def _with_left_over(columns: list[Column], notes: list[str]) -> list[Column]:
    """The columns with an effort where none has such a name: the only one left that changes."""
    if any(column.kind == "effort" for column in columns):
        return columns
    moves = [c for c in columns if c.kind in ("ticks", "pos", "vel") and not c.outside]
    rest = [c for c in columns if c.kind == "other" and c.high > c.low and not _like(c, moves)]
    modes = [c for c in rest if {"mode", "state", "status", "flag"} & set(words(c.name))]
    notes += [
        f"{column.name}: a mode is no effort; effort = {column.name} / {column.high:g} * E takes it, "
        f"with E the effort of mode {column.high:g}"
        for column in modes
    ]
    rest = [column for column in rest if column not in modes]
    if len(rest) != 1 or not moves:
        return columns
    notes.append(f"{rest[0].name}: the only column left, taken as effort")
    return [replace(column, kind="effort") if column is rest[0] else column for column in columns]


def _like(column: Column, moves: Sequence[Column]) -> bool:
    """Whether a column spans the same numbers as a motion: what was asked for, in the same unit."""
    spans = [(one.low, one.high, one.high - one.low) for one in moves]
    return any(
        abs(column.low - low) < 0.1 * span and abs(column.high - high) < 0.1 * span
        for low, high, span in spans
    )


def _twist(
    columns: list[Column],
    given: tuple[float | None, float | None],
    constants: dict[str, float],
    notes: list[str],
) -> dict[str, Any]:
    """Efforts and wheel speeds of a body's commanded motion, where nothing else was recorded.

    `given`: the wheelbase and the wheel speed of full effort.
    """
    outside = any(column.kind == "x" and column.outside for column in columns)
    pair = _body_motion(columns)
    if not outside or pair is None:
        return {}
    wheelbase_m, full_mps = given
    v, w = (c.name if c.name.isidentifier() else f"`{c.name}`" for c in pair)
    if wheelbase_m is None:
        notes.append(f"{pair[0].name}, {pair[1].name}: --wheelbase turns a body's motion into its wheels'")
        return {}
    fastest = max(abs(pair[0].low), abs(pair[0].high)) + 0.5 * wheelbase_m * max(
        abs(pair[1].low), abs(pair[1].high)
    )
    constants |= {"b": wheelbase_m, "full": full_mps or float(f"{fastest:.3g}")}
    notes.append(
        f"{pair[0].name}, {pair[1].name}: taken as commanded, full effort at {constants['full']:g} m/s "
        "(--full-speed); no wheel was measured: `truing diagnose --commanded` judges the pose"
    )
    return {
        f"{name}_{side}{unit}": {"expression": f"({v} {sign} {w}*b/2){scale}"}
        for name, unit, scale in (("effort", "", "/full"), ("vel", "_mps", ""))
        for side, sign in (("left", "-"), ("right", "+"))
    }


def _efforts(
    tables: Sequence[TextTable],
    columns: list[Column],
    full: tuple[float, float | None],
    notes: list[str],
) -> dict[str, Any]:
    found = [column for column in columns if column.kind == "effort"]
    # Applied before commanded, where a file has both.
    applied = [c for c in found if not {"cmd", "command"} & set(c.name.lower().replace("_", " ").split())]
    found = applied or found
    if not found:
        return {}
    pair = _pair(found)
    if not pair and len(found) > 1 and _pair_of_motion(columns):
        pair = [replace(found[0], side="left"), replace(found[1], side="right")]
        notes.append(f"{found[0].name}, {found[1].name}: taken as left and right, in this order")
    chosen = pair or found[:1]
    values = [table.numbers[column.name] for table in tables for column in chosen]
    scale = 1.0 / full[1] if full[1] else _effort_scale(chosen[0], values, full[0], notes)
    if pair:
        return {f"effort_{column.side}": _scaled(column.name, scale) for column in pair}
    two = any(column.side for column in columns if column.kind in ("ticks", "pos", "vel"))
    names = ("effort_left", "effort_right") if two and _pair_of_motion(columns) else ("effort",)
    if len(names) == 2:
        notes.append(f"{chosen[0].name}: the only effort, taken for both wheels")
    return {name: _scaled(chosen[0].name, scale) for name in names}


def _effort_scale(
    column: Column, values: list[FloatArray], nominal_voltage_v: float, notes: list[str]
) -> float:
    largest = max(float(np.nanmax(np.abs(one))) for one in values)
    if column.unit in ("V", "mV"):
        volts = 1.0 if column.unit == "V" else 1e-3
        notes.append(f"{column.name}: volts, full effort at {nominal_voltage_v:g} V (--nominal-voltage)")
        return volts / nominal_voltage_v
    if column.unit == "%":
        return 0.01
    if column.unit == "A":
        full = float(f"{largest:.1g}")
        full = full if full >= largest else full + 10.0 ** math.floor(math.log10(largest))
        notes.append(f"{column.name}: a current, full effort taken as {full:g} A (--full-effort)")
        return 1.0 / full
    fractions = any(np.nanmax(np.mod(np.abs(one), 1.0)) > 0.0 for one in values)
    if 1.0 * ABOVE_FULL < largest <= HIGHEST_MOTOR_V and fractions:
        notes.append(
            f"{column.name}: reaches {largest:g} in fractions: taken as volts, full effort at "
            f"{nominal_voltage_v:g} V (--nominal-voltage, --full-effort)"
        )
        return 1.0 / nominal_voltage_v
    full = next((one for one in FULL_EFFORTS if largest <= ABOVE_FULL * one), largest)
    if full != 1.0:
        notes.append(f"{column.name}: reaches {largest:g}, full effort taken as {full:g} (--full-effort)")
    return 1.0 / full


def _pair(columns: list[Column]) -> list[Column]:
    left = next((column for column in columns if column.side == "left"), None)
    right = next((column for column in columns if column.side == "right"), None)
    return [left, right] if left is not None and right is not None else []


def _pair_of_motion(columns: list[Column]) -> bool:
    return any(_pair([c for c in columns if c.kind == kind]) for kind in ("ticks", "pos", "vel"))


def _motion(
    columns: list[Column],
    sides: bool,
    wheel_radius_m: float | None,
    wheelbase_m: float | None,
    constants: dict[str, float],
    notes: list[str],
) -> dict[str, Any]:
    """Counts, positions and speeds of both wheels, or of one axis."""
    found: dict[str, Any] = {}
    for kind, scales in (("ticks", {"": 1.0}), ("pos", _LENGTHS), ("vel", _SPEEDS)):
        own = [column for column in columns if column.kind == kind and not column.outside]
        pair = _pair(own)
        for column in pair if sides and pair else ([] if sides else own[:1]):
            turns = column.unit in _ANGULAR
            scale = scales.get(column.unit, 1.0)
            if sides and turns:
                radius = wheel_radius_m
                if radius is None:
                    notes.append(
                        f"{column.name}: in {column.unit}: --wheel-radius turns it into travel; left out"
                    )
                    continue
                scale *= radius
            suffix = {"ticks": "", "pos": "_m", "vel": "_mps"}[kind]
            if not sides:
                suffix = {
                    "ticks": "",
                    "pos": "_rad" if turns else "_m",
                    "vel": "_radps" if turns else "_mps",
                }[kind]
            found[f"{kind}_{column.side}{suffix}" if sides else f"{kind}{suffix}"] = _scaled(
                column.name, scale
            )
    if found or not sides:
        return found
    pair_of_body = _body_motion(columns)
    if pair_of_body is None:
        return found
    forward, turning = pair_of_body
    if wheelbase_m is None:
        notes.append(f"{forward.name}, {turning.name}: --wheelbase turns a body's motion into its wheels'")
        return found
    constants["b"] = wheelbase_m
    v, w = (c.name if c.name.isidentifier() else f"`{c.name}`" for c in (forward, turning))
    return {
        "vel_left_mps": {"expression": f"{v} - {w}*b/2"},
        "vel_right_mps": {"expression": f"{v} + {w}*b/2"},
    }


def _body_motion(columns: list[Column]) -> tuple[Column, Column] | None:
    """Forward speed and turn rate of a body, where a table has both."""
    forward = next((c for c in columns if c.kind == "vel" and not c.side and c.unit not in _ANGULAR), None)
    turning = next(
        (c for c in columns if c.kind in ("vel", "gyro") and not c.side and c is not forward), None
    )
    return None if forward is None or turning is None else (forward, turning)


def _others(columns: list[Column], sides: bool) -> dict[str, Any]:
    """Supply, yaw rate and a pose from outside, where they are there."""
    found: dict[str, Any] = {}
    battery = next((column for column in columns if column.kind == "battery"), None)
    if battery is not None:
        found["battery_v"] = _scaled(battery.name, 1e-3 if battery.unit == "mV" else 1.0)
    if not sides:
        return found
    gyro = next((column for column in columns if column.kind == "gyro"), None)
    if gyro is not None:
        found["gyro_z_radps"] = _scaled(gyro.name, _SPEEDS.get(gyro.unit, 1.0))
    for kind, name in (("x", "truth_x_m"), ("y", "truth_y_m"), ("heading", "truth_theta_rad")):
        column = next((c for c in columns if c.kind == kind and c.outside), None)
        if column is not None:
            found[name] = _scaled(column.name, _LENGTHS.get(column.unit, 1.0))
    return found


def _edited(value: str, known: set[str], tree: AnyMapping[str, Any]) -> Any:
    """A source as a user types it: a column, a number, or an expression."""
    if value in known:
        return value
    try:
        return {"constant": float(value)}
    except ValueError:
        pass
    found = Expression(value)
    unknown = [name for name in found.names if name not in known and name not in tree.get("constants", {})]
    if unknown:
        raise TruingError(
            f"{value!r}: there is no column {unknown[0]!r}", f"Columns: {', '.join(sorted(known))}"
        )
    return {"expression": value}


def _number(text: str, value: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise TruingError(f"{text!r}: {value!r} is not a number", "NAME = NUMBER sets a constant") from None
