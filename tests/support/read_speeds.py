"""Recordings of a robot with dry friction that hold its speeds alone: read at the rows, or averaged."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from support import recorded_sets
from truing.recording.run import RecordingSet, Run

FRICTION, NOISE_MPS = 0.05, 0.003
SUBSTEPS = 20


def recorded(*, instant: bool, cut: int = 0) -> RecordingSet:
    """Four runs; `cut`: rows that are missing at the start of each."""
    rng = np.random.default_rng(7)
    runs = []
    for number in range(1, 5):
        values = recorded_sets.columns(number)
        effort = np.stack([values["effort_left"], values["effort_right"]], axis=1)
        speed = wheel_speeds(effort, instant=instant)
        speed += NOISE_MPS * rng.standard_normal(speed.shape)
        columns = {"t_s": values["t_s"], "effort_left": effort[:, 0], "effort_right": effort[:, 1]}
        columns |= {"vel_left_mps": speed[:, 0], "vel_right_mps": speed[:, 1]}
        kept = {name: column[cut:].copy() for name, column in columns.items()}
        runs.append(Run(f"{number:02d}_levels", kept, order=tuple(kept)))
    return RecordingSet("plain", tuple(runs))


def wheel_speeds(effort: NDArray[np.float64], *, instant: bool) -> NDArray[np.float64]:
    """Speeds (n, 2) of a first-order robot with dry friction, a row's effort being that up to its time."""
    step_s = 1.0 / recorded_sets.RATE_HZ / SUBSTEPS
    share = 1.0 - np.exp(-step_s / recorded_sets.TAU_S)
    speed, rows = np.zeros(2), [np.zeros(2)]
    for row in effort[1:]:
        within = []
        for _ in range(SUBSTEPS):
            before, direction = speed, np.where(speed != 0.0, np.sign(speed), np.sign(row))
            stuck = (before == 0.0) & (np.abs(row) <= FRICTION)
            goal = np.where(stuck, 0.0, recorded_sets.GAIN_MPS * (row - FRICTION * direction))
            after = before + (goal - before) * share
            speed = np.where((before * after < 0.0) & (np.abs(row) <= FRICTION), 0.0, after)
            within.append(0.5 * (before + speed))
        rows.append(speed if instant else np.mean(within, axis=0))
    return np.array(rows)
