"""The global map: an occupancy grid built from range scans as the robot drives.

Each cell holds the log odds of being occupied; each beam lowers those of the cells it passed and raises
those of the cell it ended in (Moravec and Elfes 1985; Thrun, Burgard and Fox, "Probabilistic Robotics",
section 9.2).
"""

from __future__ import annotations

import math

import numpy as np

from truing.arrays import BoolArray, FloatArray
from truing.model.compiled import compiled
from truing.web.pose import Pose
from truing.web.world.map_file import FREE, OCCUPIED, UNKNOWN, ByteArray
from truing.web.world.range_sensors import RangeSensor

# Probabilities 0.7 and 0.4 of the inverse sensor model in the book's example; the bound lets a cell that was
# occupied for a long time become free again within seconds.
_HIT = math.log(0.7 / 0.3)
_MISS = math.log(0.4 / 0.6)
_BOUND = 6.0
_KNOWN = 0.5


class OccupancyGrid:
    """Occupancy accumulated from all scans.

    Attributes
    ----------
    log_odds : shape (rows, columns), row 0 lowest in y; 0 is unknown.
    """

    def __init__(
        self, size_m: tuple[float, float], resolution_m: float, origin_m: tuple[float, float]
    ) -> None:
        rows = math.ceil(size_m[1] / resolution_m)
        columns = math.ceil(size_m[0] / resolution_m)
        self.log_odds: FloatArray = np.zeros((rows, columns))
        self.resolution_m = resolution_m
        self.origin_m = origin_m

    def clear(self) -> None:
        """Set every cell to unknown."""
        self.log_odds[:] = 0.0

    def add(self, sensor: RangeSensor, pose: Pose, distances_m: FloatArray) -> None:
        """Add a scan taken at `pose`; beams without a return mark their whole length as free."""
        ranges = np.where(np.isnan(distances_m), sensor.max_range_m, distances_m)
        _add(
            self.log_odds,
            self.resolution_m,
            pose.x_m - self.origin_m[0],
            pose.y_m - self.origin_m[1],
            sensor.angles_rad + pose.theta_rad,
            ranges + sensor.mount_m,
            ~np.isnan(distances_m),
        )

    def pixels(self) -> ByteArray:
        """Pixels for a map file: OCCUPIED, UNKNOWN and FREE, row 0 lowest in y."""
        out = np.full(self.log_odds.shape, UNKNOWN, dtype=np.uint8)
        out[self.log_odds > _KNOWN] = OCCUPIED
        out[self.log_odds < -_KNOWN] = FREE
        return out

    def shades(self) -> ByteArray:
        """Pixels for display: 0 certainly occupied to 255 certainly free, 128 unknown."""
        shade: ByteArray = np.round(255.0 / (1.0 + np.exp(self.log_odds))).astype(np.uint8)
        return shade


@compiled
def _add(
    odds: FloatArray,
    resolution: float,
    x: float,
    y: float,
    angles: FloatArray,
    ranges: FloatArray,
    hit: BoolArray,
) -> None:
    rows, columns = odds.shape
    half = 0.5 * resolution
    for i in range(angles.shape[0]):
        dx, dy = math.cos(angles[i]), math.sin(angles[i])
        # Slightly beyond the surface, so that noise of a millimetre does not select the cell in front of it.
        end_column = math.floor((x + (ranges[i] + 0.1 * half) * dx) / resolution)
        end_row = math.floor((y + (ranges[i] + 0.1 * half) * dy) / resolution)
        last_column, last_row = -1, -1
        steps = int(ranges[i] / half)
        for k in range(steps):
            column = math.floor((x + k * half * dx) / resolution)
            row = math.floor((y + k * half * dy) / resolution)
            if column == last_column and row == last_row:
                continue
            last_column, last_row = column, row
            if column == end_column and row == end_row:
                break
            if 0 <= row < rows and 0 <= column < columns:
                odds[row, column] = max(-_BOUND, odds[row, column] + _MISS)
        if hit[i] and 0 <= end_row < rows and 0 <= end_column < columns:
            odds[end_row, end_column] = min(_BOUND, odds[end_row, end_column] + _HIT)
