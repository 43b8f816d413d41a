"""`truing.simulate`: wheel speeds and travel of a model under the efforts of recordings or of columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truing.api.models import AnyModel, as_robot_model
from truing.api.reading import Source, named_tables, read
from truing.arrays import FloatArray, IntArray
from truing.identify.model_error import FreeRunError
from truing.identify.signals import NOMINAL_SUPPLY_V
from truing.identify.simulate import simulate as simulate_runs
from truing.model.excitation import excitation
from truing.model.robot_model import RobotModel
from truing.model.wheel import simulate_physics
from truing.recording.frames import preformatted
from truing.recording.run import BATTERY_COLUMN, MOTION_PAIRS, WHEELS, Geometry, RecordingSet, Run, Wheel
from truing.recording.table import run_from_table


@dataclass(frozen=True, slots=True)
class Simulated:
    """A free-run simulation of one or more runs.

    Attributes
    ----------
    recordings : the simulated runs, with the efforts as given and `vel_*_mps` (m/s) and `pos_*_m` (m).
    errors : free-run error of each wheel where the input holds measured motion; else empty.
    notes : what of the model is not simulated.
    """

    recordings: RecordingSet
    errors: Mapping[Wheel, FreeRunError]
    notes: tuple[str, ...] = ()

    @property
    def runs(self) -> tuple[Run, ...]:
        """The simulated runs."""
        return self.recordings.runs

    def __str__(self) -> str:
        count = "1 run" if len(self.runs) == 1 else f"{len(self.runs)} runs"
        lines = [f"{count} simulated"]
        lines += [
            f"{wheel} wheel: free-run error {1e3 * error.rms_mps:.3g} mm/s, {error.percent:.3g} %"
            for wheel, error in self.errors.items()
        ]
        return "\n".join([*lines, *(f"note: {note}" for note in self.notes)])

    def _repr_html_(self) -> str:
        return preformatted(str(self))


def simulate(model: AnyModel, efforts: Source) -> Simulated:
    """Simulate a model under recorded or given efforts; no measured speed but the first enters.

    Parameters
    ----------
    model : what `identify`, `fit` or `diagnose` returned, a `RobotModel`, a `Baseline`, or a file of these.
    efforts : what `read` returned or takes; or columns of shape (n,) without motion: `t_s` (s), `effort_left`
        and `effort_right` (-1..1, mean over the interval that ends at the row), then from rest.

    Returns
    -------
    Simulated
        `runs` with the simulated columns, each of shape (n,), and `errors` where there are measured speeds.
        A gap in measured runs starts afresh from the measured speed behind it.

    Raises
    ------
    TruingError
        The model or the efforts cannot be read; says what to do.

    Examples
    --------
    >>> import numpy as np
    >>> import truing
    >>> t_s = np.arange(0.0, 3.0, 0.01)
    >>> half = {"t_s": t_s, "effort_left": 0.0 * t_s + 0.5, "effort_right": 0.0 * t_s + 0.5}
    >>> simulated = truing.simulate("docs/example/baseline.toml", half)
    >>> print(f"{simulated.runs[0].columns['vel_left_mps'][-1]:.3f} m/s")
    0.688 m/s
    """
    robot, notes = as_robot_model(model)
    driven = _driven(efforts)
    geometry = driven.robot or robot.robot
    measured = all(any(run.has_pair(pair) for pair in MOTION_PAIRS) for run in driven)
    runs = tuple(_simulated(robot, run, _speeds(run, geometry) if measured else None) for run in driven)
    errors: dict[Wheel, FreeRunError] = {}
    if measured:
        errors = {wheel: simulate_runs(robot, driven.runs, wheel, geometry).error for wheel in WHEELS}
    return Simulated(RecordingSet(driven.name, runs, None, None, geometry), errors, notes)


def _driven(efforts: Source) -> RecordingSet:
    """The efforts as runs, which need not have moved."""
    if isinstance(efforts, (str, Path, RecordingSet, Run)):
        return read(efforts)
    tables = named_tables(efforts, None)
    return RecordingSet("efforts", tuple(run_from_table(table, name, motion=False) for name, table in tables))


def _speeds(run: Run, geometry: Geometry) -> dict[Wheel, FloatArray]:
    return {wheel: run.speed(wheel, geometry).values for wheel in WHEELS}


def _simulated(robot: RobotModel, run: Run, measured: Mapping[Wheel, FloatArray] | None) -> Run:
    """One run of the model; rows that share a time stamp are one instant, the last of them stands."""
    keep = np.append(np.diff(run.t_s) > 0.0, True)
    rows = {name: values[keep] for name, values in run.columns.items()}
    t_s = rows["t_s"]
    later = np.zeros(len(run), dtype=bool)
    if measured is not None:
        later[run.gaps()] = True
    starts = np.unique(np.array([0, *np.flatnonzero(later[keep]), len(t_s)], dtype=np.int64))
    supply = rows[BATTERY_COLUMN] / NOMINAL_SUPPLY_V - 1.0 if BATTERY_COLUMN in rows else np.zeros(len(t_s))
    columns = {name: rows[name] for name in ("t_s", "effort_left", "effort_right")}
    travels: dict[str, FloatArray] = {}
    for wheel in WHEELS:
        driven = excitation(
            t_s, rows[f"effort_{wheel}"], supply, starts, np.full(len(starts) - 1, run.interval_s)
        )
        initial = np.zeros(len(starts) - 1) if measured is None else measured[wheel][keep][starts[:-1]]
        response = simulate_physics(robot.wheel(wheel).to_vector(), driven, initial)
        columns[f"vel_{wheel}_mps"] = response.speed_mps
        travels[f"pos_{wheel}_m"] = _joined(response.travel_m, starts)
    columns |= travels
    return Run(run.name, columns, order=tuple(columns))


def _joined(travel_m: FloatArray, starts: IntArray) -> FloatArray:
    """Travel of segments laid end to end, shape (n,), m; what a gap adds is not known."""
    ends = np.concatenate(([0.0], np.cumsum(travel_m[starts[1:] - 1])))[:-1]
    return np.asarray(travel_m + np.repeat(ends, np.diff(starts)))
