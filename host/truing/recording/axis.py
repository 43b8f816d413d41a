"""A single motor or axis: its columns of a run, and how it is spoken of.

Everything that computes takes runs of two wheels. An axis is such a run whose two sides hold the same
numbers, of which the left one is computed; a rotation's radians stand where a wheel has metres at the rim.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from truing.arrays import FloatArray

Motion: TypeAlias = Literal["rotation", "translation"]
MOTIONS: tuple[Motion, ...] = get_args(Motion)

# What a run of one axis may call its columns, and the wheels' columns that they stand for.
_PAIRS = {
    "effort": ("effort_left", "effort_right"),
    "cmd": ("cmd_left", "cmd_right"),
    "ticks": ("ticks_left", "ticks_right"),
    "pos": ("pos_left_m", "pos_right_m"),
    "vel": ("vel_left_mps", "vel_right_mps"),
}
_UNITS: dict[Motion, dict[str, str]] = {
    "rotation": {"pos": "pos_rad", "vel": "vel_radps"},
    "translation": {"pos": "pos_m", "vel": "vel_mps"},
}
AXIS_COLUMNS = ("effort", "cmd", "ticks", "pos_rad", "vel_radps", "pos_m", "vel_mps")

# In this order: longer words first.
_WORDS = (
    (r"(?:on )?both wheels", "the axis"),
    (r"the wheels' speeds", "the speed"),
    (r"Speed of the (?:left|right) wheel", "Speed"),
    (r" on the (?:left|right) wheel| \((?:left|right) wheel\)| \((?:left|right)\)", ""),
    (r"\bof the (?:left|right) wheel\b", "of the axis"),
    (r"\b(?:left|right) wheel\b", "axis"),
    (r"\b(?:Left|Right) wheel\b", "Axis"),
    (r"\beach wheel\b|\bthe wheels?\b", "the axis"),
    (r"\bThe wheels?\b", "The axis"),
    (r"\bA wheel\b", "An axis"),
    (r"\bwheels?\b", "axis"),
    (r"\b[Tt]he robot\b: ", "The axis: "),
    (r"\bthe (?:whole )?robot\b", "the axis"),
    (r"\bLeft (\w)", r"\1"),
    (r"\b(?:breakaway|friction|amplitude) left\b", lambda m: m.group(0).split(" ")[0]),
    (r"(?<=[:,] )left (?=[-\d])", ""),
    (r" at the rim\b| while turning\b", ""),
)
_ROTATION = (
    (r"\b(gain|stribeck)_mps\b", r"\1"),
    (r"\bmm/s\b", "mrad/s"),
    (r"\bm/s\b", "rad/s"),
    (r"\bmm\b", "mrad"),
)


@dataclass(frozen=True, slots=True)
class Axis:
    """A single axis; `motion`: whether it turns (rad) or moves along a line (m)."""

    motion: Motion

    @property
    def speed_unit(self) -> str:
        """Of what stands in the columns of a wheel's speed."""
        return "rad/s" if self.motion == "rotation" else "m/s"

    def text(self, line: str) -> str:
        """A sentence about wheels as one about this axis, in its units; commands in backticks stay."""
        parts = line.split("`")
        parts[::2] = [self._said(part) for part in parts[::2]]
        return "`".join(parts)

    def _said(self, text: str) -> str:
        said = text
        for pattern, word in (*_WORDS, *(_ROTATION if self.motion == "rotation" else ())):
            said = re.sub(pattern, word, said)
        return said[:1].upper() + said[1:] if text[:1].isupper() else said


def axis_of(names: list[str]) -> Axis | None:
    """The axis whose columns these are, or None where they are two wheels'."""
    if "effort" not in names or "effort_left" in names or "effort_right" in names:
        return None
    turns = any(name in names for name in _UNITS["rotation"].values())
    return Axis("rotation" if turns or "ticks" in names else "translation")


def wheel_columns(name: str) -> tuple[str, ...]:
    """The columns of the wheels that one of an axis stands for; the name itself where it is none."""
    kind = next((kind for units in _UNITS.values() for kind, own in units.items() if own == name), name)
    return _PAIRS.get(kind, (name,))


def names_of_wheels(names: Sequence[str]) -> list[str]:
    """Columns of an axis, each by the names of the two wheels' that it stands for."""
    return [wheel for name in names for wheel in wheel_columns(name)]


def as_wheels(columns: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Columns of an axis as those of two wheels."""
    return {wheel: values for name, values in columns.items() for wheel in wheel_columns(name)}


def axis_names(names: list[str], axis: Axis) -> dict[str, str]:
    """For every column of the wheels that an axis' file keeps, its name there."""
    kept: dict[str, str] = {}
    own = {pair[0]: _UNITS[axis.motion].get(kind, kind) for kind, pair in _PAIRS.items()}
    other = {pair[1] for pair in _PAIRS.values()}
    for name in names:
        if name not in other:
            kept[name] = own.get(name, name)
    return kept
