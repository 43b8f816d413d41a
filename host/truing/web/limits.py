"""What a robot can do, as far as a trajectory must respect it."""

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
    turn_radps: float = 2.0
    wheel_mps: float = 1.2
    accel_mps2: float = 1.0
    turn_accel_radps2: float = 4.0
    wheelbase_m: float = 0.283

    @classmethod
    def of_board(cls, parameters: Mapping[str, float]) -> Limits:
        """Limits within what the board's parameters allow, with a tenth to spare for its controller."""
        usual = cls()
        wheel = 0.9 * parameters.get("speed_limit_mps", usual.wheel_mps / 0.9)
        base = parameters.get("wheelbase_m", usual.wheelbase_m)
        accel = min(usual.accel_mps2, 0.5 * parameters.get("accel_limit_mps2", 2.0 * usual.accel_mps2))
        return cls(
            speed_mps=min(usual.speed_mps, wheel),
            turn_radps=min(usual.turn_radps, wheel / (0.5 * base)),
            wheel_mps=wheel,
            accel_mps2=accel,
            turn_accel_radps2=usual.turn_accel_radps2,
            wheelbase_m=base,
        )

    def allowed(
        self, wanted: tuple[float, float], before: tuple[float, float], seconds: float = CYCLE_S
    ) -> tuple[float, float, tuple[str, ...]]:
        """The nearest speed (m/s) and yaw rate (rad/s) that the robot can take up, and what held it back.

        Where a wheel would be too fast, speed and yaw rate shrink together: the arc keeps its radius.
        """
        held: list[str] = []
        v = _within(wanted[0], -self.speed_mps, self.speed_mps, "top speed", held)
        omega = _within(wanted[1], -self.turn_radps, self.turn_radps, "top turn rate", held)
        fastest = abs(v) + 0.5 * self.wheelbase_m * abs(omega)
        if fastest > self.wheel_mps * (1.0 + 1e-9):
            held.append("wheel speed")
            v, omega = v * self.wheel_mps / fastest, omega * self.wheel_mps / fastest
        step, turn = self.accel_mps2 * seconds, self.turn_accel_radps2 * seconds
        v = _within(v, before[0] - step, before[0] + step, "acceleration", held)
        omega = _within(omega, before[1] - turn, before[1] + turn, "turn acceleration", held)
        return v, omega, tuple(held)

    def on_radius(self, radius_m: float) -> tuple[float, float]:
        """Fastest speed (m/s) and acceleration (m/s2) along an arc; an infinite radius is a line."""
        if math.isinf(radius_m):
            return min(self.speed_mps, self.wheel_mps), self.accel_mps2
        r = abs(radius_m)
        speed = min(self.speed_mps, self.turn_radps * r, self.wheel_mps / (1.0 + 0.5 * self.wheelbase_m / r))
        return speed, min(self.accel_mps2, self.turn_accel_radps2 * r)

    def on_the_spot(self) -> tuple[float, float]:
        """Fastest yaw rate (rad/s) and yaw acceleration (rad/s2) of a turn on the spot."""
        return min(self.turn_radps, self.wheel_mps / (0.5 * self.wheelbase_m)), self.turn_accel_radps2


def _within(value: float, low: float, high: float, what: str, held: list[str]) -> float:
    if value < low - 1e-12 or value > high + 1e-12:
        held.append(what)
    return min(max(value, low), high)
