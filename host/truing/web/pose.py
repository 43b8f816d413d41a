"""Poses in the plane: composing them, and advancing them by a twist."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class Pose:
    """Position (m) and heading (rad, positive to the left, not wrapped)."""

    x_m: float = 0.0
    y_m: float = 0.0
    theta_rad: float = 0.0

    def compose(self, other: Pose) -> Pose:
        """The pose that is `other` when seen from this one."""
        c, s = math.cos(self.theta_rad), math.sin(self.theta_rad)
        return Pose(
            self.x_m + c * other.x_m - s * other.y_m,
            self.y_m + s * other.x_m + c * other.y_m,
            self.theta_rad + other.theta_rad,
        )

    def inverse(self) -> Pose:
        """The pose that composes with this one to the origin."""
        c, s = math.cos(self.theta_rad), math.sin(self.theta_rad)
        return Pose(-c * self.x_m - s * self.y_m, s * self.x_m - c * self.y_m, -self.theta_rad)

    def advanced(self, v_mps: float, omega_radps: float, seconds: float) -> Pose:
        """The pose after a constant twist, integrated exactly along its arc."""
        turn = omega_radps * seconds
        ahead = v_mps * seconds
        # sin(x)/x and (1 - cos x)/x; series expansions for small x, where the quotients lose digits.
        if abs(turn) < 1e-4:
            along, aside = 1.0 - turn * turn / 6.0, turn / 2.0
        else:
            along, aside = math.sin(turn) / turn, (1.0 - math.cos(turn)) / turn
        return self.compose(Pose(ahead * along, ahead * aside, turn))

    def distance_m(self, other: Pose) -> float:
        """Distance on the floor."""
        return math.hypot(self.x_m - other.x_m, self.y_m - other.y_m)

    def placed(self, path: FloatArray) -> FloatArray:
        """A path of x (m), y (m), theta (rad), shape (n, 3), as it is when seen from this pose."""
        c, s = math.cos(self.theta_rad), math.sin(self.theta_rad)
        x = self.x_m + c * path[:, 0] - s * path[:, 1]
        y = self.y_m + s * path[:, 0] + c * path[:, 1]
        return np.column_stack((x, y, path[:, 2] + self.theta_rad))

    def as_list(self) -> list[float]:
        """x, y, theta, rounded for display."""
        return [round(self.x_m, 4), round(self.y_m, 4), round(self.theta_rad, 5)]


def wrapped(angle_rad: float) -> float:
    """The same direction within -pi to pi."""
    return math.remainder(angle_rad, 2.0 * math.pi)
