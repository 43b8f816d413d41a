"""How much floor a plan needs and how fast it goes: a conservative estimate, made before anything moves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.plan import Kind, Plan

_STEP_S = 0.01
# First-order models leave out friction, which slows a robot, and a fresh battery, which does not.
_GAIN_MARGIN = 1.10
# Wheels that differ by 3 per cent turn a robot that was told to go straight by 0.03 / 0.283 rad per metre.
_CURL_RAD_PER_M = 0.106


@dataclass(frozen=True, slots=True)
class MotionModel:
    """Enough of a robot to guess where a plan takes it.

    `source` says where the numbers come from, in the user's words.
    """

    gain_left_mps: float = 1.5
    gain_right_mps: float = 1.5
    time_constant_s: float = 0.4
    wheelbase_m: float = 0.283
    source: str = "the default robot (1.5 m/s at full effort)"


@dataclass(frozen=True, slots=True)
class FloorNeed:
    """The floor that a plan sweeps, metres from the robot's centre at its start, and its top speed.

    `radius_m` is the farthest that the centre gets from the start.
    """

    ahead_m: float
    behind_m: float
    left_m: float
    right_m: float
    radius_m: float
    top_speed_mps: float
    top_wheel_speed_mps: float
    duration_s: float
    source: str

    def sentence(self) -> str:
        """In one line, for a person who stands beside the robot."""
        if max(self.ahead_m, self.behind_m, self.left_m, self.right_m) < 0.05:
            room = "turns on the spot" if self.top_wheel_speed_mps > 0 else "does not move"
        else:
            room = f"{self.ahead_m:.1f} m ahead, {self.behind_m:.1f} m behind, "
            room += f"{self.left_m:.1f} m left, {self.right_m:.1f} m right"
        return (
            f"floor: {room}, and the robot's own size around it; "
            f"top speed {self.top_wheel_speed_mps:.2f} m/s at the wheel; "
            f"{self.duration_s:.1f} s (estimate from {self.source}, margins included)"
        )


def estimate_floor(plan: Plan, model: MotionModel | None = None) -> FloorNeed:
    """Roll first-order wheels through the plan and widen the path by what they leave out."""
    model = model or MotionModel()
    left, right, dt = _wheel_speeds(plan, model, _GAIN_MARGIN)
    x, y, _ = _path(left, right, dt, model).T
    v = 0.5 * (left + right)
    travelled = np.cumsum(np.abs(v) * dt)
    # Off a straight line by a curl c over a path s: c s^2 / 2, and never beyond the path itself.
    stray = np.minimum(0.5 * _CURL_RAD_PER_M * travelled**2, travelled)
    return FloorNeed(
        ahead_m=max(0.0, float(x.max())),
        behind_m=max(0.0, -float(x.min())),
        left_m=max(0.0, float((y + stray).max())),
        right_m=max(0.0, -float((y - stray).min())),
        radius_m=float(np.minimum(np.hypot(x, y) + stray, travelled).max()),
        top_speed_mps=float(np.abs(v).max()),
        top_wheel_speed_mps=float(max(np.abs(left).max(), np.abs(right).max())),
        duration_s=plan.duration_s,
        source=model.source,
    )


def planned_path(plan: Plan, model: MotionModel | None = None) -> FloatArray:
    """The path that a plan commands: x (m), y (m), theta (rad), from the origin along x, shape (n, 3).

    Without the margins of `estimate_floor`; it ends when the wheels are at rest.
    """
    model = model or MotionModel()
    path = _path(*_wheel_speeds(plan, model, 1.0), model)
    return np.concatenate((np.zeros((1, 3)), path))


def _path(left: FloatArray, right: FloatArray, dt: FloatArray, model: MotionModel) -> FloatArray:
    """Where these wheel speeds lead, from the origin along x: x (m), y (m), theta (rad), shape (n, 3)."""
    way = 0.5 * (left + right) * dt
    turn = (right - left) / model.wheelbase_m * dt
    theta = np.cumsum(turn)
    heading = theta - 0.5 * turn
    return np.column_stack((np.cumsum(way * np.cos(heading)), np.cumsum(way * np.sin(heading)), theta))


def _wheel_speeds(plan: Plan, model: MotionModel, margin: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """First-order wheels through a plan to rest: left and right, m/s, and the step before each, s."""
    speeds, steps_s = [], []
    last = np.zeros(2)
    to_rest = (0.0, 0.0, 5 * model.time_constant_s)
    for left, right, duration_s in (*_wheel_targets(plan, model, margin), to_rest):
        steps = max(1, math.ceil(duration_s / _STEP_S))
        decay = np.exp(-duration_s / steps / model.time_constant_s * np.arange(1, steps + 1))[:, None]
        target = np.array([left, right])
        speeds.append(target + (last - target) * decay)
        steps_s.append(np.full(steps, duration_s / steps))
        last = speeds[-1][-1]
    both = np.concatenate(speeds)
    return both[:, 0], both[:, 1], np.concatenate(steps_s)


def _wheel_targets(plan: Plan, model: MotionModel, margin: float) -> list[tuple[float, float, float]]:
    """Steady wheel speeds (m/s, left and right) times a margin, and duration (s) of each segment."""
    targets = []
    for segment in plan.segments:
        a, b = segment.a, segment.b
        if segment.kind is Kind.EFFORT:
            pair = (a * model.gain_left_mps, b * model.gain_right_mps)
        elif segment.kind is Kind.VELOCITY:
            pair = (a, b)
        else:
            half = 0.5 * b * model.wheelbase_m
            pair = (a - half, a + half)
        targets.append((pair[0] * margin, pair[1] * margin, segment.duration_s))
    return targets
