"""Control inputs replayed with the MOM paper's odometry error model."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from truing.arrays import FloatArray
from truing.studies.mom_odometry import ErrorModel, replay
from truing.studies.mom_odometry import Pose as PaperPose
from truing.web.path.trajectory import Cycle
from truing.web.pose import Pose

# The paper's equations move straight within a step: half a centimetre at 5 ms and 1 m/s.
_STEP_S = 0.005


def steps_of(cycles: Sequence[Cycle]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time at the end (s), advance (m) and turn (rad) of each small step, shape (n,) each."""
    counts = [max(1, math.ceil(cycle.duration_s / _STEP_S - 1e-9)) for cycle in cycles]
    spans = np.repeat([c.duration_s / n for c, n in zip(cycles, counts, strict=True)], counts)
    advances = np.repeat([c.v_mps for c in cycles], counts) * spans
    turns = np.repeat([c.omega_radps for c in cycles], counts) * spans
    return np.cumsum(spans), advances, turns


def replay_path(model: ErrorModel, start: Pose, advances_m: FloatArray, turns_rad: FloatArray) -> FloatArray:
    """Poses x, y, theta including the start, shape (n + 1, 3).

    The paper advances along the heading at the end of a step; the exact chord has the heading of its middle.
    With steps this short the two differ by less than the paper's last digit.
    """
    first = PaperPose(start.x_m, start.y_m, math.degrees(start.theta_rad))
    return replay(model, first, advances_m, turns_rad)


def replay_cycles(model: ErrorModel, start: Pose, cycles: Sequence[Cycle]) -> list[list[float]]:
    """The path of control inputs under a model, as points x, y, theta for display."""
    _, advances, turns = steps_of(cycles)
    return thinned(replay_path(model, start, advances, turns))


def thinned(path: FloatArray, limit: int = 400) -> list[list[float]]:
    """At most `limit` rows of a path, including the last, rounded for display."""
    stride = max(1, -(-len(path) // limit))
    rows = path[::stride]
    if (len(path) - 1) % stride:
        rows = np.concatenate((rows, path[-1:]))
    points: list[list[float]] = np.round(rows, 4).tolist()
    return points
