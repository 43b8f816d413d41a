"""Control inputs replayed under an odometry error model of the MOM paper's form."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from truing.paper_mom import ErrorModel, replay
from truing.paper_mom import Pose as PaperPose
from truing.recording import FloatArray
from truing.web.pose import Pose
from truing.web.trajectory import Cycle

# The paper's equations go straight within a step: at 5 ms and 1 m/s that is half a centimetre.
_STEP_S = 0.005


def steps_of(cycles: Sequence[Cycle]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time at the end (s), advance (m) and turn (rad) of each small step, shape (n,) each."""
    counts = [max(1, math.ceil(cycle.duration_s / _STEP_S - 1e-9)) for cycle in cycles]
    spans = np.repeat([c.duration_s / n for c, n in zip(cycles, counts, strict=True)], counts)
    advances = np.repeat([c.v_mps for c in cycles], counts) * spans
    turns = np.repeat([c.omega_radps for c in cycles], counts) * spans
    return np.cumsum(spans), advances, turns


def replay_path(model: ErrorModel, start: Pose, advances_m: FloatArray, turns_rad: FloatArray) -> FloatArray:
    """Poses x, y, theta from the start on, shape (n + 1, 3).

    The paper advances along the heading at a step's end; half a turn less is the heading of its middle, which
    is where the arc goes. With steps this short the two differ by less than the paper's last digit.
    """
    first = PaperPose(start.x_m, start.y_m, math.degrees(start.theta_rad))
    return replay(model, first, advances_m, turns_rad)


def replay_cycles(
    model: ErrorModel, start: Pose, cycles: Sequence[Cycle], most: int = 400
) -> list[list[float]]:
    """The path of control inputs under a model, as points to draw: x, y, theta."""
    _, advances, turns = steps_of(cycles)
    return thinned(replay_path(model, start, advances, turns), most)


def thinned(path: FloatArray, most: int = 400) -> list[list[float]]:
    """At most so many rows of a path, its last among them, rounded for a picture."""
    stride = max(1, -(-len(path) // most))
    rows = path[::stride]
    if (len(path) - 1) % stride:
        rows = np.concatenate((rows, path[-1:]))
    drawn: list[list[float]] = np.round(rows, 4).tolist()
    return drawn
