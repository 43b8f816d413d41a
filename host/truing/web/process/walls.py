"""Walls that a virtual robot collides with: it does not enter an occupied cell of the world."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from truing.web.pose import Pose
from truing.web.world.world_map import WorldMap

# Dry friction at each wheel while the body is pushed against a wall: tyres that slip on the floor, with a
# coefficient of friction of 0.7 under half of 5 kg at a radius of 0.0635 m.
GRIP_NM = 1.1
# A wheel is held so long at a time; then it may turn, so that the robot can drive away from the wall.
_HOLD_US = 40_000


class Movable(Protocol):
    """What walls need of a virtual robot."""

    def place(self, x_m: float, y_m: float, theta_rad: float) -> None:
        """Move the robot to another pose."""

    def hold_wheel(self, wheel: int, torque_nm: float) -> None:
        """Hold a wheel with dry friction; 0 lets go."""


@dataclass(frozen=True, slots=True)
class Walls:
    """The world as a robot sees it that starts at `base` in it."""

    world: WorldMap
    base: Pose

    @classmethod
    def of_json(cls, content: dict[str, Any], radius_m: float) -> Walls:
        """From `walls_json`; cells closer than a radius to an occupied one are occupied too."""
        rows, columns = content["shape"]
        bits = np.frombuffer(base64.b64decode(content["cells"]), np.uint8)
        occupied = np.unpackbits(bits, count=rows * columns).reshape(rows, columns).astype(np.bool_)
        x, y = content["origin_m"]
        world = WorldMap(occupied, content["resolution_m"], (x, y))
        return cls(WorldMap(world.widened(radius_m), world.resolution_m, (x, y)), Pose(*content["base"]))

    def blocks(self, pose: Pose) -> bool:
        """Whether the robot would overlap an obstacle there."""
        at = self.base.compose(pose)
        return self.world.is_occupied(at.x_m, at.y_m)


def walls_json(world: WorldMap, base: Pose) -> dict[str, Any]:
    """A world and the pose in it at which the robot's own coordinates begin, as plain data."""
    return {
        "shape": list(world.occupied.shape),
        "cells": base64.b64encode(np.packbits(world.occupied).tobytes()).decode(),
        "resolution_m": world.resolution_m,
        "origin_m": list(world.origin_m),
        "base": [base.x_m, base.y_m, base.theta_rad],
    }


class Collisions:
    """Stops the body of a robot at walls; its wheels slip there under friction."""

    def __init__(self, robot: Movable) -> None:
        self.walls: Walls | None = None
        self._robot = robot
        self._last: Pose | None = None
        self._held_until_us = 0

    def step(self, time_us: int, pose: Pose) -> Pose:
        """Undo a motion into a wall since the last step; returns the pose that holds."""
        walls, last = self.walls, self._last
        if self._held_until_us and time_us >= self._held_until_us:
            self._hold(0.0, 0)
        # A robot that was placed into an obstacle may leave it.
        if walls is None or last is None or not walls.blocks(pose) or walls.blocks(last):
            self._last = pose
            return pose
        # Along a wall it slides.
        for x_m, y_m in ((pose.x_m, last.y_m), (last.x_m, pose.y_m), (last.x_m, last.y_m)):
            free = Pose(x_m, y_m, pose.theta_rad)
            if not walls.blocks(free):
                break
        self._robot.place(free.x_m, free.y_m, free.theta_rad)
        self._hold(GRIP_NM, time_us + _HOLD_US)
        self._last = free
        return free

    def _hold(self, torque_nm: float, until_us: int) -> None:
        self._held_until_us = until_us
        for wheel in (0, 1):
            self._robot.hold_wheel(wheel, torque_nm)
