"""Ray casting in an occupancy grid: distance to the first occupied cell.

Each ray steps from cell border to cell border (Amanatides and Woo, "A Fast Voxel Traversal Algorithm for
Ray Tracing", 1987), so that its length is exact for the grid at every angle.
"""

from __future__ import annotations

import math

import numpy as np

from truing.arrays import BoolArray, FloatArray
from truing.model.compiled import compiled
from truing.web.world.world_map import WorldMap


def cast(world: WorldMap, x_m: float, y_m: float, angles_rad: FloatArray, max_range_m: float) -> FloatArray:
    """Distance to the first occupied cell along each ray, shape of `angles_rad`, m; `max_range_m` without
    one.
    """
    out = np.empty(angles_rad.shape)
    _cast(
        world.occupied,
        world.resolution_m,
        x_m - world.origin_m[0],
        y_m - world.origin_m[1],
        angles_rad,
        max_range_m,
        out,
    )
    return out


@compiled
def _cast(
    occupied: BoolArray,
    resolution: float,
    x: float,
    y: float,
    angles: FloatArray,
    max_range: float,
    out: FloatArray,
) -> None:
    rows, columns = occupied.shape
    for i in range(angles.shape[0]):
        dx, dy = math.cos(angles[i]), math.sin(angles[i])
        column, row = math.floor(x / resolution), math.floor(y / resolution)
        step_x = 1 if dx > 0 else -1
        step_y = 1 if dy > 0 else -1
        # Ray lengths to the next border in x and in y, and between two borders.
        if abs(dx) < 1e-12:
            next_x, every_x = math.inf, math.inf
        else:
            border = (column + (1 if dx > 0 else 0)) * resolution
            next_x, every_x = (border - x) / dx, resolution / abs(dx)
        if abs(dy) < 1e-12:
            next_y, every_y = math.inf, math.inf
        else:
            border = (row + (1 if dy > 0 else 0)) * resolution
            next_y, every_y = (border - y) / dy, resolution / abs(dy)
        length = 0.0
        out[i] = max_range
        while length <= max_range:
            inside = 0 <= row < rows and 0 <= column < columns
            if inside and occupied[row, column]:
                out[i] = length
                break
            if next_x < next_y:
                length = next_x
                next_x += every_x
                column += step_x
                if (step_x > 0 and column >= columns) or (step_x < 0 and column < 0):
                    break
            else:
                length = next_y
                next_y += every_y
                row += step_y
                if (step_y > 0 and row >= rows) or (step_y < 0 and row < 0):
                    break
