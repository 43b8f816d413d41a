"""A board's parameters as a TOML file: a copy to keep, to compare with, and to load onto another board."""

from __future__ import annotations

import math
import struct
import tomllib
from collections.abc import Mapping
from pathlib import Path

from truing.board.device import parameter_info
from truing.board.state import Parameter, format_f32
from truing.errors import ParameterFileError, TruingError
from truing.recording.writer import replace_file
from truing_protocol import ParameterKind

_TABLE = "parameters"
_EXAMPLE = "write for example: [parameters] and below it wheelbase_m = 0.29"


def write_parameter_file(path: str | Path, parameters: Mapping[str, Parameter], origin: str) -> None:
    """Write the values in force.

    Parameters
    ----------
    origin : where they come from, one line for the file's head.
    """
    lines = [f"# {origin}", "# `truing params load --file` puts them into force.", "", f"[{_TABLE}]"]
    for name, parameter in parameters.items():
        unit = f"{parameter.info.unit}; " if parameter.info.unit else ""
        lines.append(f"{name} = {parameter.text}  # {unit}{parameter.info.doc}")
    replace_file(path, ("\n".join(lines) + "\n").encode())


def read_parameter_file(path: str | Path) -> dict[str, float]:
    """The values in a file, by name; it need not name all parameters.

    Raises
    ------
    ParameterFileError : it cannot be read, is no TOML, names a parameter that no board has, or gives
        one a value beyond its limits.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise ParameterFileError(path, f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ParameterFileError(path, "is not text in UTF-8") from None
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ParameterFileError(path, f"not valid TOML: {error}") from None
    table = content.get(_TABLE)
    if not isinstance(table, dict):
        raise ParameterFileError(path, f"there is no table [{_TABLE}]", _EXAMPLE)
    return {name: _value(path, name, value) for name, value in table.items()}


def _value(path: str | Path, name: str, value: object) -> float:
    try:
        info = parameter_info(name)
    except TruingError as error:
        raise ParameterFileError(path, error.message, error.next_step) from None
    if isinstance(value, bool) and info.kind is ParameterKind.FLAG:
        return float(value)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ParameterFileError(path, f"{name}: {value!r} is not a finite number")
    if not info.minimum <= value <= info.maximum:
        limits = f"{format_f32(info.minimum)} to {format_f32(info.maximum)} {info.unit}".rstrip()
        raise ParameterFileError(path, f"{name} = {value:g} lies outside {limits}")
    if info.kind is not ParameterKind.REAL and value != int(value):
        raise ParameterFileError(path, f"{name} = {value:g} is not a whole number")
    return float(value)


def same_on_the_board(left: float, right: float) -> bool:
    """Whether two values are one in the single precision of the board."""
    return struct.pack("<f", left) == struct.pack("<f", right)
