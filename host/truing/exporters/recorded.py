"""Recordings as a simulator's task: efforts over time in, wheel speeds at the rows out, and their error.

The input between rows is that of `truing.model`: an edge of the effort inside a row's interval is put where
the mean over the interval says. Speeds are means over a row's interval, as counts give them, and a recorder's
own filter is applied to simulated ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from truing.arrays import FloatArray
from truing.errors import TruingError
from truing.model.excitation import Pieces, excitation
from truing.model.robot_model import RobotModel
from truing.recording.run import GAP_FACTOR, WHEELS, RecordingSet, Run

# A run whose first speed is above this share of its largest begins in motion.
MOVING = 0.1


@dataclass(frozen=True, slots=True)
class Task:
    """One run to simulate, from rest; without gaps.

    Attributes
    ----------
    t_s : shape (n,), s, from zero.
    measured_mps : shape (2, n), mean rim speeds over the intervals that end at the rows.
    pieces : efforts of the left and the right wheel, constant between the times at which they change.
    left_out : what of the run is not in it, in a sentence, or "".
    """

    name: str
    t_s: FloatArray
    measured_mps: FloatArray
    pieces: tuple[Pieces, Pieces]
    left_out: str = ""

    def effort(self, time_s: float) -> tuple[float, float]:
        """Efforts that act from this time on."""
        left, right = (
            float(
                piece.effort[min(int(np.searchsorted(piece.end_s, time_s, "right")), piece.effort.size - 1)]
            )
            for piece in self.pieces
        )
        return left, right

    def changes(self) -> list[float]:
        """Every time at which an effort changes or a row ends, s, in order."""
        times = np.concatenate([self.t_s, *(piece.end_s for piece in self.pieces)])
        return sorted(set(times[(times > 0.0) & (times <= self.t_s[-1])].tolist()))


# Rim travel at the rows, shape (2, n), m.
Simulate = Callable[[Task], FloatArray]


def tasks(recordings: RecordingSet) -> list[Task]:
    """The runs to simulate, each up to its first gap.

    Raises
    ------
    TruingError : they are of a single axis.
    """
    if recordings.axis is not None:
        raise TruingError("recordings of a single axis cannot check a robot of two wheels")
    return [_task(run, recordings) for run in recordings]


def _task(run: Run, recordings: RecordingSet) -> Task:
    t = run.t_s - run.t_s[0]
    jumps = np.flatnonzero(np.diff(t) > GAP_FACTOR * run.interval_s)
    rows = int(jumps[0]) + 1 if jumps.size else len(t)
    # A simulator has one state at a time: of rows of the same time the last one stands.
    kept = np.flatnonzero(np.diff(t[:rows], append=np.inf) > 0.0)
    speeds = np.array([run.speed(wheel, recordings.robot).values[kept] for wheel in WHEELS])
    pieces = []
    for wheel in WHEELS:
        driven = excitation(
            t[kept],
            np.ascontiguousarray(run.effort(wheel)[kept]),
            np.zeros(kept.size),
            np.array([0, kept.size], dtype=np.int64),
            np.array([run.interval_s]),
        )
        pieces.append(driven.pieces)
    said = []
    if rows < len(t):
        said.append(
            f"{run.name}: simulated up to its gap at {run.t_s[rows - 1]:.4g} s, {rows} of {len(t)} rows"
        )
    if abs(speeds[:, 0]).max() > MOVING * abs(speeds).max():
        said.append(f"{run.name}: it begins in motion, and simulations begin at rest")
    return Task(run.name, t[kept], speeds, (pieces[0], pieces[1]), "; ".join(said))


def error_mps(all_tasks: Sequence[Task], simulate: Simulate, model: RobotModel | None = None) -> float:
    """Free-run error over all rows of all runs and both wheels, m/s.

    Parameters
    ----------
    model : whose recorder's filter the simulated speeds go through.
    """
    return float(np.sqrt(np.mean(residuals(all_tasks, simulate, model) ** 2)))


def residuals(all_tasks: Sequence[Task], simulate: Simulate, model: RobotModel | None = None) -> FloatArray:
    """Simulated less measured speeds of all rows but the first of each run, m/s, in one row."""
    found = []
    for task in all_tasks:
        steps = np.diff(task.t_s)
        speeds = np.diff(simulate(task)) / steps
        if model is not None:
            lags = [model.wheel(wheel).recorder_lag_s for wheel in WHEELS]
            speeds = np.array([_filtered(row, steps, lag) for row, lag in zip(speeds, lags, strict=True)])
        found.append((speeds - task.measured_mps[:, 1:]).ravel())
    return np.concatenate(found)


def _filtered(speeds: FloatArray, steps: FloatArray, lag_s: float) -> FloatArray:
    """Speeds behind a first-order filter."""
    if lag_s <= 0.0:
        return speeds
    out, held = np.empty_like(speeds), 0.0
    for row, (speed, step) in enumerate(zip(speeds.tolist(), steps.tolist(), strict=True)):
        held += (1.0 - float(np.exp(-step / lag_s))) * (speed - held)
        out[row] = held
    return out


def on_grid(task: Task, step_s: float) -> tuple[FloatArray, FloatArray]:
    """Times of an even grid, shape (m + 1,), s, and the mean efforts between them, shape (2, m)."""
    count = int(np.ceil(task.t_s[-1] / step_s - 1e-9))
    grid: FloatArray = step_s * np.arange(count + 1, dtype=np.float64)
    means = []
    for piece in task.pieces:
        ends = np.concatenate(([0.0], piece.end_s))
        impulse = np.concatenate(([0.0], np.cumsum(np.diff(ends) * piece.effort)))
        means.append(np.diff(np.interp(grid, ends, impulse)) / step_s)
    return grid, np.array(means)


def travelled(task: Task, grid: FloatArray, speeds: FloatArray) -> FloatArray:
    """Travel at the rows, shape (2, n), m, from speeds at the times of a grid, shape (2, m)."""
    steps = np.diff(grid) * 0.5 * (speeds[:, 1:] + speeds[:, :-1])
    travel = np.concatenate((np.zeros((2, 1)), np.cumsum(steps, axis=1)), axis=1)
    return np.array([np.interp(task.t_s, grid, row) for row in travel])


def spans(task: Task) -> list[tuple[float, float]]:
    """The stretches of constant effort, each from its begin to its end, s, that end at rows and changes."""
    return list(pairwise([0.0, *task.changes()]))
