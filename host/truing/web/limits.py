"""Speed and acceleration limits that a trajectory must respect."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

CYCLE_S = 0.1
"""One cycle of control inputs: the MOM paper's time step of 100 ms (section 5.1)."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Speeds and accelerations of the body and of one wheel, SI units."""

    speed_mps: float = 0.8
    yaw_rate_radps: float = 2.0
    wheel_mps: float = 1.2
    accel_mps2: float = 1.0
    yaw_accel_radps2: float = 4.0
    wheelbase_m: float = 0.283

    @classmethod
    def of_board(cls, parameters: Mapping[str, float]) -> Limits:
        """Limits derived from the board's parameters, with 10 % reserve for its controller."""
        default = cls()
        wheel = 0.9 * parameters.get("speed_limit_mps", default.wheel_mps / 0.9)
        base = parameters.get("wheelbase_m", default.wheelbase_m)
        accel = min(default.accel_mps2, 0.5 * parameters.get("accel_limit_mps2", 2.0 * default.accel_mps2))
        return cls(
            speed_mps=min(default.speed_mps, wheel),
            yaw_rate_radps=min(default.yaw_rate_radps, wheel / (0.5 * base)),
            wheel_mps=wheel,
            accel_mps2=accel,
            yaw_accel_radps2=default.yaw_accel_radps2,
            wheelbase_m=base,
        )

    def clamped(
        self, requested: tuple[float, float], previous: tuple[float, float]
    ) -> tuple[float, float, tuple[str, ...]]:
        """The nearest feasible speed (m/s) and yaw rate (rad/s), and the names of the active limits.

        Where a wheel would exceed its limit, both are scaled together: the arc keeps its radius.
        """
        active: list[str] = []
        v = _clamp(requested[0], -self.speed_mps, self.speed_mps, "maximum speed", active)
        omega = _clamp(requested[1], -self.yaw_rate_radps, self.yaw_rate_radps, "maximum yaw rate", active)
        wheel_speed = abs(v) + 0.5 * self.wheelbase_m * abs(omega)
        if wheel_speed > self.wheel_mps * (1.0 + 1e-9):
            active.append("wheel speed")
            v, omega = v * self.wheel_mps / wheel_speed, omega * self.wheel_mps / wheel_speed
        step, turn = self.accel_mps2 * CYCLE_S, self.yaw_accel_radps2 * CYCLE_S
        v = _clamp(v, previous[0] - step, previous[0] + step, "acceleration", active)
        omega = _clamp(omega, previous[1] - turn, previous[1] + turn, "yaw acceleration", active)
        return v, omega, tuple(active)

    def on_radius(self, radius_m: float) -> tuple[float, float]:
        """Maximum speed (m/s) and acceleration (m/s2) along an arc; an infinite radius is a line."""
        if math.isinf(radius_m):
            return min(self.speed_mps, self.wheel_mps), self.accel_mps2
        r = abs(radius_m)
        speed = min(
            self.speed_mps, self.yaw_rate_radps * r, self.wheel_mps / (1.0 + 0.5 * self.wheelbase_m / r)
        )
        return speed, min(self.accel_mps2, self.yaw_accel_radps2 * r)

    def turning_in_place(self) -> tuple[float, float]:
        """Maximum yaw rate (rad/s) and yaw acceleration (rad/s2) of a turn in place."""
        return min(self.yaw_rate_radps, self.wheel_mps / (0.5 * self.wheelbase_m)), self.yaw_accel_radps2


def _clamp(value: float, low: float, high: float, name: str, active: list[str]) -> float:
    if value < low - 1e-12 or value > high + 1e-12:
        active.append(name)
    return min(max(value, low), high)
