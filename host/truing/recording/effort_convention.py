"""Which interval a recorded row's effort acts in, as `recording.toml` of a set says it.

Everything behind the reader has efforts as means over the interval that ends at their row
(docs/DATA_FORMAT.md, section 2); `effort = "after"` says that the recorder means the interval after the row.
"""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from truing.arrays import FloatArray
from truing.errors import FileError
from truing.recording.run import EFFORT_PAIR, Run

EffortActs: TypeAlias = Literal["before", "after"]
SETTING = "recording.toml"


def read_effort_acts(path: Path) -> EffortActs:
    """`effort` of the recording.toml of a set, a folder of runs or one run's folder; "before" without one."""
    folder = path if path.is_dir() else path.parent
    candidates = [folder / SETTING] + ([folder.parent / SETTING] if folder.name == "runs" else [])
    file = next((one for one in candidates if one.is_file()), None)
    if file is None:
        return "before"
    try:
        tree = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise FileError(file, f"cannot be read: {error}") from None
    unknown = sorted(set(tree) - {"effort"})
    if unknown:
        raise FileError(file, f"unknown key {unknown[0]!r}", 'It may say effort = "after" or "before"')
    return effort_acts(file, tree.get("effort", "before"))


def effort_acts(path: Path, value: Any) -> EffortActs:
    """A checked value of the key `effort`."""
    if value not in get_args(EffortActs):
        raise FileError(
            path,
            f'effort must be "before" or "after", not {value!r}',
            '"after": a row\'s effort acts in the interval that begins at the row',
        )
    acts: EffortActs = value
    return acts


def shifted(effort: FloatArray) -> FloatArray:
    """Efforts of the interval after each row as those of the interval before it, along the last axis.

    The first row has no interval before it in the recording: it keeps its own.
    """
    return np.concatenate((effort[..., :1], effort[..., :-1]), axis=-1)


def with_effort_before(run: Run, acts: EffortActs) -> Run:
    """The run with every effort in the row that ends its interval."""
    if acts == "before":
        return run
    return replace(run, columns=run.columns | {name: shifted(run.columns[name]) for name in EFFORT_PAIR})
