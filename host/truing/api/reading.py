"""`truing.read`: recordings from files or from columns in memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

from truing.api.models import AnyModel, as_baseline
from truing.errors import TruingError
from truing.importers import ImportOptions, import_table, read_runs
from truing.importers.mapping import Mapping as ColumnMapping
from truing.importers.mapping import parse_mapping, read_mapping
from truing.recording.baseline import RobotGeometry
from truing.recording.frames import Table, is_table, table_columns
from truing.recording.geometry import given_geometry, with_given_geometry
from truing.recording.run import RecordingSet, Run
from truing.recording.table import run_from_table

Source: TypeAlias = str | Path | RecordingSet | Run | Table


def read(
    source: Source,
    baseline: AnyModel | None = None,
    *,
    mapping: str | Path | Mapping[str, Any] | None = None,
    counts_per_rev: float | None = None,
    wheel_radius_m: float | None = None,
    wheelbase_m: float | None = None,
    name: str | None = None,
    spins: bool = True,
) -> RecordingSet:
    """Read recordings: a set, a CSV file, a file of another program, or columns in memory.

    Parameters
    ----------
    source : a path; or one run's columns (a mapping of arrays of shape (n,), a structured array, a pandas or
        polars frame); or several runs as a sequence of such tables, or as a mapping of run names to tables.
        Columns and units are those of docs/DATA_FORMAT.md: `t_s` in s, `effort_left` and `effort_right` in
        -1..1, and counts (`ticks_*`), travel (`pos_*_m`) or speed (`vel_*_mps`) of both wheels.
    baseline : what the simulation knows, instead of the baseline.toml beside the files: its path, a
        `Baseline`, a model, or what `identify` or `fit` returned.
    mapping : which column is which where the source has other names or units: a mapping file, or the same as
        a dictionary, `{"t_s": {"column": "time", "scale": 1e-3}, "effort_left": "pwm_l", ...}`.
    counts_per_rev : encoder counts per turn of a wheel.
    wheel_radius_m : radius of the wheels, m.
    wheelbase_m : distance between the wheels, m.
    name : of the set; the default is the file's, or "recordings".
    spins : keep tests of a SysId file that turn the robot on the spot. `identify` and `fit` prefer without.

    Returns
    -------
    RecordingSet
        The runs, each with `columns` (arrays of shape (n,)), `to_dict()` and `to_frame()`.

    Raises
    ------
    TruingError
        Names the file or run, the column and the row, and says in `next_step` what to do.

    Examples
    --------
    >>> import numpy as np
    >>> import truing
    >>> print(truing.read("docs/example"))
    trial: 3 runs, ... s, with a baseline
      01_diagnosis_steps_from_rest: ... rows, ... s at 20 Hz
      ...

    Columns in memory, here as a dictionary; a frame of pandas or polars is read in the same way:

    >>> t_s = np.arange(0.0, 4.0, 0.05)
    >>> speed = 0.5 * (1.0 - np.exp(-t_s / 0.2))
    >>> columns = {"t_s": t_s, "effort_left": 0.0 * t_s + 0.4, "effort_right": 0.0 * t_s + 0.4,
    ...            "vel_left_mps": speed, "vel_right_mps": speed}
    >>> print(truing.read(columns, name="bench"))
    bench: 1 run, 3.95 s, without a baseline
      01_bench: 80 rows, 3.95 s at 20 Hz
    """
    given = given_geometry(counts_per_rev, wheel_radius_m, wheelbase_m)
    known = None if mapping is None else _mapping(mapping)
    options = ImportOptions(mapping=known, spins=spins, wheelbase_m=wheelbase_m)
    if isinstance(source, (str, Path)):
        recordings = read_runs(Path(source), geometry=RobotGeometry(), options=options)
    elif isinstance(source, RecordingSet):
        recordings = source
    elif isinstance(source, Run):
        recordings = RecordingSet(name or source.name, (source,))
    else:
        recordings = RecordingSet(name or "recordings", _runs(source, name, known, options))
    if name is not None:
        recordings = replace(recordings, name=name)
    if baseline is not None:
        recordings = with_baseline(recordings, baseline)
    return with_given_geometry(recordings, given)


def with_baseline(recordings: RecordingSet, model: AnyModel) -> RecordingSet:
    """The same runs beside this baseline; what it lacks of the robot's numbers is as given with them."""
    baseline = as_baseline(model)
    robot = (baseline.robot or RobotGeometry()).or_else(recordings.geometry)
    known = None if robot == RobotGeometry() else robot
    return replace(recordings, baseline=replace(baseline, robot=known), geometry=None)


def named_tables(source: object, name: str | None) -> list[tuple[str, Table]]:
    """Each table with the name of its run."""
    if is_table(source):
        return [(f"01_{name or 'run'}", source)]
    if isinstance(source, Mapping) and source and all(map(is_table, source.values())):
        return [(str(key), table) for key, table in source.items()]
    if isinstance(source, Sequence) and source and all(map(is_table, source)):
        return [(f"{number:02d}_{name or 'run'}", table) for number, table in enumerate(source, start=1)]
    raise TruingError(
        f"{type(source).__name__}: neither a path nor a table with named columns",
        "Give a path, a mapping of arrays, a pandas or polars frame, or a list of these",
    )


def _runs(
    source: object, name: str | None, mapping: ColumnMapping | None, options: ImportOptions
) -> tuple[Run, ...]:
    tables = named_tables(source, name)
    if mapping is None:
        return tuple(run_from_table(table, label) for label, table in tables)
    found: list[Run] = []
    for label, table in tables:
        runs = import_table(table_columns(table), label, mapping, options).runs
        # A mapping without [split] makes one run of a table, which keeps the table's name.
        found += [replace(runs[0], name=label)] if len(runs) == 1 else runs
    return tuple(found)


def _mapping(mapping: str | Path | Mapping[str, Any]) -> ColumnMapping:
    if isinstance(mapping, (str, Path)):
        return read_mapping(Path(mapping))
    tree = mapping if "columns" in mapping else {"columns": dict(mapping)}
    return parse_mapping(tree, Path("mapping"))
