"""Where a plan would take the robot: its path in the world, the room it needs, what stands in the way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.board.run_saver import motion_model
from truing.board.state import Parameter
from truing.floor import FloorNeed, estimate_floor, planned_path
from truing.plan import Plan
from truing.web.pose import Pose
from truing.web.world.world_map import BODY_M, WorldMap

_SPACING_M = 0.02


@dataclass(frozen=True, slots=True)
class RunForecast:
    """What a plan will do.

    Attributes
    ----------
    path : x (m), y (m), theta (rad) in the world, shape (n, 3), points at least 2 cm or 2 degrees apart.
    distance_m : along the path.
    obstacle : where the body first meets an obstacle of the world, x and y (m); None if nowhere.
    """

    path: FloatArray
    distance_m: float
    need: FloorNeed
    obstacle: tuple[float, float] | None

    def facts(self) -> list[tuple[str, str]]:
        """Names and values with units, for a person who stands beside the robot."""
        need = self.need
        return [
            ("distance", f"{self.distance_m:.2f} m"),
            ("room ahead", f"{need.ahead_m:.1f} m"),
            ("room behind", f"{need.behind_m:.1f} m"),
            ("room left", f"{need.left_m:.1f} m"),
            ("room right", f"{need.right_m:.1f} m"),
            ("top speed", f"{need.top_speed_mps:.2f} m/s"),
            ("top wheel speed", f"{need.top_wheel_speed_mps:.2f} m/s"),
            ("duration", f"{need.duration_s:.1f} s"),
        ]


def forecast(plan: Plan, parameters: Mapping[str, Parameter], start: Pose, world: WorldMap) -> RunForecast:
    """The forecast of a plan on a board with these parameters, from `start`."""
    model = motion_model(dict(parameters))
    own = planned_path(plan, model)
    distance_m = float(np.hypot(*np.diff(own[:, :2], axis=0).T).sum())
    path = start.placed(_thinned(own))
    return RunForecast(path, distance_m, estimate_floor(plan, model), first_obstacle(world, path))


def first_obstacle(world: WorldMap, path: FloatArray) -> tuple[float, float] | None:
    """The first point of a path at which the robot's body overlaps an occupied cell, x and y (m)."""
    blocked = world.widened(BODY_M)
    cells = np.floor((path[:, :2] - np.array(world.origin_m)) / world.resolution_m).astype(int)
    rows, columns = world.occupied.shape
    inside = (cells >= 0).all(axis=1) & (cells[:, 0] < columns) & (cells[:, 1] < rows)
    hit = np.zeros(len(path), dtype=bool)
    hit[inside] = blocked[cells[inside, 1], cells[inside, 0]]
    if not hit.any():
        return None
    x, y, _ = path[int(hit.argmax())].tolist()
    return x, y


def _thinned(path: FloatArray) -> FloatArray:
    """Points that differ from the one before, and the last."""
    steps = np.hypot(*np.diff(path[:, :2], axis=0).T) + BODY_M * np.abs(np.diff(path[:, 2]))
    travelled = np.concatenate(([0.0], np.cumsum(steps)))
    kept = np.concatenate(([True], np.diff(np.floor(travelled / _SPACING_M)) > 0))
    kept[-1] = True
    thinned: FloatArray = path[kept]
    return thinned
