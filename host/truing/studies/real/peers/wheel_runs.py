"""One wheel's recordings as the peers get them, and the same on even times for methods that need those."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truing.arrays import BoolArray, FloatArray

# WPILib renews speeds every 20 ms or slower. A discrete model of a shorter interval would be fitted to rows
# that repeat the row before.
SHORTEST_INTERVAL_S = 0.02


@dataclass(frozen=True, slots=True)
class WheelRun:
    """One wheel over a run, or over a stretch of it without a gap.

    Attributes
    ----------
    run : index of the run in its set.
    t_s : shape (n,), increasing.
    effort : shape (n,), -1..1, mean over the interval that ends at the row.
    speed_mps : shape (n,), measured.
    judged : shape (n,), rows whose error counts.
    initial_mps : speed at the first row, from which every free run starts.
    """

    run: int
    t_s: FloatArray
    effort: FloatArray
    speed_mps: FloatArray
    judged: BoolArray
    initial_mps: float

    def __len__(self) -> int:
        return len(self.t_s)

    def judge(self, simulated_mps: FloatArray) -> FloatArray:
        """Errors of speeds (n,) at the judged rows, m/s, and how long each stands, s: shape (k, 2).

        A measurement stands until the next one, as the recorder repeats it until then.
        """
        rows = np.flatnonzero(self.judged)
        usual_s = float(np.median(np.diff(self.t_s)))
        until_next_s = np.diff(self.t_s[rows], append=self.t_s[-1] + usual_s) if len(rows) else np.zeros(0)
        return np.stack([(simulated_mps - self.speed_mps)[rows], until_next_s], axis=1)


def even_interval(runs: Sequence[WheelRun]) -> float:
    """Usual time between rows, s, and at least `SHORTEST_INTERVAL_S`."""
    steps = np.concatenate([np.diff(run.t_s) for run in runs])
    return max(float(np.median(steps)), SHORTEST_INTERVAL_S)


@dataclass(frozen=True, slots=True)
class EvenRun:
    """A run at even times: `t_s`, `effort` and `speed_mps`, each of shape (n,)."""

    t_s: FloatArray
    effort: FloatArray
    speed_mps: FloatArray


def even_run(run: WheelRun, interval_s: float) -> EvenRun:
    """A run at even times; the effort keeps its mean over each interval, the speed is interpolated."""
    count = int(np.floor((run.t_s[-1] - run.t_s[0]) / interval_s + 1e-6)) + 1
    grid = run.t_s[0] + interval_s * np.arange(count)
    impulse = np.concatenate(([0.0], np.cumsum(run.effort[1:] * np.diff(run.t_s))))
    effort = np.diff(np.interp(grid, run.t_s, impulse)) / interval_s
    return EvenRun(grid, np.concatenate((run.effort[:1], effort)), np.interp(grid, run.t_s, run.speed_mps))


def at_rows(run: WheelRun, even: EvenRun, speed_mps: FloatArray) -> FloatArray:
    """Speeds (m,) simulated at even times, interpolated to the rows of the run, shape (n,)."""
    return np.asarray(np.interp(run.t_s, even.t_s, speed_mps))
