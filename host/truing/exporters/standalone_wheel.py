"""A wheel and a robot that need nothing but Python's own library; exported as they stand."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable

# Longest step (s) where friction depends on speed, or the drive on a lag.
MAX_STEP_S = 1e-3


class Wheel:
    """time_constant dv/dt = gain (effort - friction sign(v)) - v, and what else its parameters say.

    The effort is held between calls; with constant friction every step is solved in closed form, stops and
    reversals included. At rest the wheel stays at rest until the effort exceeds its breakaway friction.
    """

    def __init__(self, parameters: dict[str, float]) -> None:
        value = parameters.get
        gain, tau = parameters["gain_mps"], parameters["time_constant_s"]
        friction, excess = value("friction", 0.0), value("breakaway_excess", 0.0)
        # Forward, reverse.
        self._gain = (gain, gain * value("reverse_gain", 1.0))
        self._tau = (tau, tau * value("reverse_time_constant", 1.0))
        self._friction = (friction, friction * value("reverse_friction", 1.0))
        self._excess = (excess, excess * value("reverse_excess", 1.0))
        self._stribeck = value("stribeck_mps", 0.0)
        self._shape = value("stribeck_shape", 1.0)
        self._drag = value("drag", 0.0)
        self._offset = value("offset", 0.0)
        self._lag = value("lag_s", 0.0)
        self._delay = value("delay_s", 0.0)
        self._deadband = value("deadband", 0.0)
        self._small_steps = self._drag != 0.0 or self._lag > 0.0 or (self._stribeck > 0.0 and excess > 0.0)
        self.reset()

    def reset(self, speed_mps: float = 0.0) -> None:
        """Stand still (or roll at a speed), with no effort on the way."""
        self.time_s = 0.0
        self.speed_mps = speed_mps
        self.travel_m = 0.0
        self._effort = 0.0  # that acts now
        self._lagged = self._offset
        self._coming: deque[tuple[float, float]] = deque()  # (when it arrives, effort)

    def step(self, effort: float, duration_s: float) -> float:
        """Apply an effort (-1..1) for a time; the speed at its end, m/s."""
        arrival = self.time_s + self._delay
        end = self.time_s + duration_s
        # A change of plan: what was to arrive later than this command has been replaced by it.
        while self._coming and self._coming[-1][0] >= arrival:
            self._coming.pop()
        self._coming.append((arrival, effort))
        while True:
            while self._coming and self._coming[0][0] <= self.time_s + 1e-12:
                self._effort = self._coming.popleft()[1]
            until = min(end, self._coming[0][0]) if self._coming else end
            driven = math.copysign(max(abs(self._effort) - self._deadband, 0.0), self._effort)
            self._roll(driven + self._offset, until - self.time_s)
            self.time_s = until
            if until >= end:
                return self.speed_mps

    def _roll(self, drive: float, duration: float) -> None:
        """Roll for a time under a constant drive (effort with the offset)."""
        left = duration
        while left > 1e-12:
            h = min(left, MAX_STEP_S) if self._small_steps else left
            now = drive
            if self._lag > 0.0:
                # The mean of the lagged drive over the step.
                now += (self._lagged - drive) * -math.expm1(-h / self._lag) * self._lag / h
            h = self._roll_once(now, h)
            if self._lag > 0.0:
                self._lagged = drive + (self._lagged - drive) * math.exp(-h / self._lag)
            left -= h

    def _roll_once(self, drive: float, h: float) -> float:
        """One step without a stop inside; how long it was."""
        v = self.speed_mps
        sign = 1.0 if v > 0.0 or (v == 0.0 and drive >= 0.0) else -1.0
        side = 0 if sign > 0.0 else 1
        friction, excess = self._friction[side], self._excess[side]
        if v == 0.0 and abs(drive) <= friction + excess:
            return h
        slope = 0.0
        speed = abs(v)
        if self._stribeck > 0.0 and excess > 0.0:
            z = (speed / self._stribeck) ** self._shape
            part = excess * math.exp(-z)
            friction += part
            if speed > 0.0:
                slope -= part * self._shape * z / speed
            elif self._shape == 1.0:
                slope -= part / self._stribeck
        friction += self._drag * speed * speed
        slope += 2.0 * self._drag * speed
        gain, tau = self._gain[side], self._tau[side]
        # dv/dt = level - rate v, friction linearised about v.
        rate = (1.0 + gain * slope) / tau
        level = gain * (drive - sign * friction + slope * v) / tau
        end = v * math.exp(-rate * h) + level * _integral(rate, h)
        stops = v != 0.0 and end * sign <= 0.0
        if stops:
            h = min(
                h, -v / level if abs(rate * v) < 1e-9 * abs(level) else math.log1p(-rate * v / level) / rate
            )
            end = 0.0
        decay = _integral(rate, h)
        if abs(rate * h) < 1e-6:
            self.travel_m += v * h + (level - rate * v) * 0.5 * h * h
        else:
            self.travel_m += level / rate * h + (v - level / rate) * decay
        self.speed_mps = end
        return h


def _integral(rate: float, h: float) -> float:
    """(1 - exp(-rate h)) / rate, also for a rate near zero."""
    z = rate * h
    return h * (1.0 - 0.5 * z) if abs(z) < 1e-9 else -math.expm1(-z) / rate


class Robot:
    """Both wheels, and the pose where the wheelbase is known."""

    def __init__(
        self, left: dict[str, float], right: dict[str, float], wheelbase_m: float | None = None
    ) -> None:
        self.left, self.right = Wheel(left), Wheel(right)
        self.wheelbase_m = wheelbase_m
        self.x_m = self.y_m = self.theta_rad = 0.0

    def step(self, effort_left: float, effort_right: float, duration_s: float) -> tuple[float, float]:
        """Apply efforts (-1..1) for a time; both speeds at its end, m/s."""
        before = self.left.travel_m, self.right.travel_m
        self.left.step(effort_left, duration_s)
        self.right.step(effort_right, duration_s)
        if self.wheelbase_m:
            left, right = self.left.travel_m - before[0], self.right.travel_m - before[1]
            turn = (right - left) / self.wheelbase_m
            # Midpoint (second-order Runge-Kutta) odometry.
            heading = self.theta_rad + 0.5 * turn
            self.x_m += 0.5 * (left + right) * math.cos(heading)
            self.y_m += 0.5 * (left + right) * math.sin(heading)
            self.theta_rad += turn
        return self.left.speed_mps, self.right.speed_mps


def run(
    robot: Robot, times_s: Iterable[float], efforts_left: Iterable[float], efforts_right: Iterable[float]
) -> list[tuple[float, float]]:
    """Speeds (left, right) at each time; each row's effort acts over the interval that ends at it."""
    speeds: list[tuple[float, float]] = []
    before: float | None = None
    for time, left, right in zip(times_s, efforts_left, efforts_right, strict=True):
        if before is None:
            speeds.append((robot.left.speed_mps, robot.right.speed_mps))
        else:
            speeds.append(robot.step(left, right, time - before))
        before = time
    return speeds
