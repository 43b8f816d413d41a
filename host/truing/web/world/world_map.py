"""The world of the simulated sensors: a grid of occupied cells that can be painted and erased."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from truing.arrays import BoolArray
from truing.errors import TruingError

# 100 m by 100 m at 5 cm: still drawn by a page, and an image of a few kilobytes.
MAX_CELLS = 4_000_000

# Radius of the robot's body as the pages draw it.
BODY_M = 0.17


@dataclass(frozen=True, slots=True)
class FrozenWorld:
    """A state of a world, a bit for each cell."""

    shape: tuple[int, int]
    bits: bytes
    resolution_m: float
    origin_m: tuple[float, float]

    def world(self) -> WorldMap:
        """As a world of its own."""
        rows, columns = self.shape
        cells = np.unpackbits(np.frombuffer(self.bits, np.uint8), count=rows * columns)
        return WorldMap(cells.reshape(rows, columns).astype(np.bool_), self.resolution_m, self.origin_m)


@dataclass
class WorldMap:
    """Which cells are occupied.

    Attributes
    ----------
    occupied : shape (rows, columns); row 0 is the lowest in y, column 0 the lowest in x.
    resolution_m : side of a cell, m.
    origin_m : x and y of the lower left corner, m.
    version : incremented by every change, so that a page knows when to fetch the map again.
    """

    occupied: BoolArray
    resolution_m: float
    origin_m: tuple[float, float]
    version: int = 0

    @classmethod
    def empty(cls, width_m: float = 8.0, height_m: float = 8.0, resolution_m: float = 0.05) -> WorldMap:
        """An empty floor around the origin.

        Raises
        ------
        TruingError : the floor has no area, or more cells than a page can handle.
        """
        if not (width_m > 0 and height_m > 0 and resolution_m > 0):
            raise TruingError("a map needs a positive width, height and resolution")
        columns, rows = math.ceil(width_m / resolution_m), math.ceil(height_m / resolution_m)
        check_size(rows, columns)
        origin = (-0.5 * columns * resolution_m, -0.5 * rows * resolution_m)
        return cls(np.zeros((rows, columns), dtype=np.bool_), resolution_m, origin)

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height."""
        rows, columns = self.occupied.shape
        return columns * self.resolution_m, rows * self.resolution_m

    def is_occupied(self, x_m: float, y_m: float) -> bool:
        """Whether the cell at a point is occupied; outside the map none is."""
        column = math.floor((x_m - self.origin_m[0]) / self.resolution_m)
        row = math.floor((y_m - self.origin_m[1]) / self.resolution_m)
        rows, columns = self.occupied.shape
        return 0 <= row < rows and 0 <= column < columns and bool(self.occupied[row, column])

    def paint_stroke(self, points_m: list[tuple[float, float]], width_m: float, value: bool) -> None:
        """Set the cells under a round brush drawn along `points_m`; one point is a dot."""
        if not points_m or not all(math.isfinite(c) for point in points_m for c in point):
            return
        ends = points_m if len(points_m) > 1 else points_m * 2
        for a, b in pairwise(ends):
            self._paint_line(a, b, 0.5 * width_m, value)
        self.version += 1

    def paint_room(self, a: tuple[float, float], b: tuple[float, float], width_m: float) -> None:
        """Four walls between two opposite corners."""
        (x0, y0), (x1, y1) = a, b
        self.paint_stroke([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)], width_m, True)

    def clear(self) -> None:
        """Remove every obstacle."""
        self.occupied[:] = False
        self.version += 1

    def replace(self, other: WorldMap) -> None:
        """Replace content and extent by another map's."""
        self.occupied = other.occupied
        self.resolution_m, self.origin_m = other.resolution_m, other.origin_m
        self.version += 1

    def frozen(self) -> FrozenWorld:
        """The content and extent of now."""
        shape = (self.occupied.shape[0], self.occupied.shape[1])
        return FrozenWorld(shape, np.packbits(self.occupied).tobytes(), self.resolution_m, self.origin_m)

    def widened(self, radius_m: float) -> BoolArray:
        """Cells whose centre is closer than a radius to the centre of an occupied one."""
        radius = radius_m / self.resolution_m
        reach = math.floor(radius)
        padded = np.pad(self.occupied, reach)
        found = np.zeros_like(self.occupied)
        rows, columns = found.shape
        for down in range(-reach, reach + 1):
            for right in range(-reach, reach + 1):
                if math.hypot(down, right) <= radius:
                    top, left = reach + down, reach + right
                    found |= padded[top : top + rows, left : left + columns]
        return found

    def rectangles(self) -> list[tuple[float, float, float, float]]:
        """Occupied cells as few axis-aligned boxes: x, y of the centre, width and height, m.

        Rows of cells are merged first, then equal runs of neighbouring rows: walls become single boxes.
        """
        open_runs: dict[tuple[int, int], int] = {}
        found: list[tuple[int, int, int, int]] = []
        rows = self.occupied.shape[0]
        for row in range(rows + 1):
            runs = set(_runs(self.occupied[row])) if row < rows else set()
            ended = [run for run in open_runs if run not in runs]
            found += [(*run, open_runs.pop(run), row) for run in ended]
            for run in runs:
                open_runs.setdefault(run, row)
        r, (x, y) = self.resolution_m, self.origin_m
        return [
            (x + 0.5 * (c0 + c1) * r, y + 0.5 * (r0 + r1) * r, (c1 - c0) * r, (r1 - r0) * r)
            for c0, c1, r0, r1 in found
        ]

    def _paint_line(
        self, a: tuple[float, float], b: tuple[float, float], brush_radius_m: float, value: bool
    ) -> None:
        """Set cells whose centre lies within the brush along the segment; at least those it crosses."""
        r = self.resolution_m
        radius = max(brush_radius_m, 0.5 * r)
        rows, columns = self.occupied.shape
        (ox, oy), low, high = self.origin_m, np.minimum(a, b) - radius, np.maximum(a, b) + radius
        c0, c1 = _span(low[0] - ox, high[0] - ox, r, columns)
        r0, r1 = _span(low[1] - oy, high[1] - oy, r, rows)
        if c0 >= c1 or r0 >= r1:
            return
        x = ox + (np.arange(c0, c1) + 0.5) * r - a[0]
        y = (oy + (np.arange(r0, r1) + 0.5) * r - a[1])[:, None]
        dx, dy = b[0] - a[0], b[1] - a[1]
        length2 = dx * dx + dy * dy
        along = np.clip((x * dx + y * dy) / length2, 0.0, 1.0) if length2 > 0 else np.zeros(y.shape) * x
        near = (x - along * dx) ** 2 + (y - along * dy) ** 2 <= (radius + 1e-9) ** 2
        self.occupied[r0:r1, c0:c1][near] = value


def check_size(rows: int, columns: int) -> None:
    """Reject a map that is too large for a page."""
    if rows * columns > MAX_CELLS:
        raise TruingError(
            f"a map of {columns} by {rows} cells is more than the {MAX_CELLS} that the view handles",
            "use a coarser resolution or a smaller floor",
        )


def _span(low: float, high: float, step: float, count: int) -> tuple[int, int]:
    return max(0, math.floor(low / step)), min(count, math.ceil(high / step))


def _runs(row: BoolArray) -> list[tuple[int, int]]:
    """First column and end column (exclusive) of each run of occupied cells."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], row, [False])).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
