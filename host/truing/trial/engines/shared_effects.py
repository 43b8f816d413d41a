"""What every engine can hide in its robot, each by means of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from truing.trial.engines.engine import EngineEffect, Rng
from truing.trial.engines.robot import GRAVITY, EngineRobot

Pair = tuple[float, float]
RobotT = TypeVar("RobotT", bound=EngineRobot)


def sides(rng: Rng) -> Pair:
    """How strong an effect is left and right."""
    left, right = rng.uniform(0.75, 1.25, 2)
    return float(left), float(right)


def of_stall(robot: EngineRobot, share: float, factors: Pair) -> Pair:
    """Torques that are this share of each stall torque, times a factor each."""
    left, right = robot.nominal.stalls_nm
    return share * left * factors[0], share * right * factors[1]


def as_effort(robot: EngineRobot, torques_nm: Pair) -> dict[str, float]:
    """Torques over the stall torques."""
    left, right = robot.nominal.stalls_nm
    return {"left": torques_nm[0] / left, "right": torques_nm[1] / right}


def mean_stall_n(robot: EngineRobot) -> float:
    """Rim force at full effort, mean of both wheels."""
    return float(np.mean(robot.nominal.stalls_nm)) / robot.nominal.radius_m


def _joint_friction(robot: RobotT, raw: float, rng: Rng) -> RobotT:
    return replace(robot, friction_nm=of_stall(robot, 0.2 * raw, sides(rng)))


def _rolling_friction(robot: RobotT, raw: float, _rng: Rng) -> RobotT:
    torque = 0.2 * raw * float(np.mean(robot.nominal.stalls_nm))
    return replace(robot, rolling_m=2.0 * torque / (robot.nominal.mass_kg * GRAVITY))


def _rolling_nm(robot: EngineRobot) -> float:
    return 0.5 * robot.rolling_m * robot.nominal.mass_kg * GRAVITY


def _tilt(robot: RobotT, raw: float, rng: Rng) -> RobotT:
    return replace(robot, slope_rad=0.15 * raw, uphill_rad=float(rng.uniform(-math.pi, math.pi)))


def _low_grip(robot: RobotT, raw: float, _rng: Rng) -> RobotT:
    return replace(robot, grip=0.05**raw)


def _load(robot: RobotT, raw: float, rng: Rng) -> RobotT:
    return replace(robot, load_kg=1.5 * raw * robot.nominal.mass_kg, load_from_run=int(rng.integers(3, 6)))


def _load_expected(robot: EngineRobot) -> Mapping[str, float]:
    axle = robot.nominal.axle_inertia_kgm2
    return {"time_constant_ratio": 1.0 + 0.5 * robot.load_kg * robot.nominal.radius_m**2 / axle}


def _yaw_inertia(robot: RobotT, raw: float, rng: Rng) -> RobotT:
    return replace(robot, yaw_factor=1.0 + 1.5 * raw if rng.random() < 0.5 else 1.0 - 0.8 * raw)


def _coupling(robot: EngineRobot) -> Mapping[str, float]:
    """Share of the other wheel's own acceleration: off-diagonal over diagonal of the inverted inertia."""
    nominal = robot.nominal
    quarter = 0.25 * nominal.mass_kg
    turning = nominal.axle_inertia_kgm2 / nominal.radius_m**2 - 2.0 * quarter
    yaw = quarter * robot.yaw_factor
    return {"coupling": (yaw - quarter) / (turning + quarter + yaw)}


def _delay(robot: RobotT, raw: float, _rng: Rng) -> RobotT:
    return replace(robot, delay_s=round(0.3 * raw, 3))


def _torsion(robot: RobotT, raw: float, _rng: Rng) -> RobotT:
    force = 0.25 * raw * mean_stall_n(robot)
    # Both tyres' moments turn the robot on its track: 2 μ N = F W.
    return replace(robot, torsion_m=force * robot.track_m / (robot.nominal.mass_kg * GRAVITY))


def _torsion_expected(robot: EngineRobot) -> Mapping[str, float]:
    force = robot.torsion_m * robot.nominal.mass_kg * GRAVITY / robot.track_m
    return {"scrub": force / mean_stall_n(robot)}


def _tyres(robot: RobotT, raw: float, rng: Rng) -> RobotT:
    left, right = rng.uniform(-1.0, 1.0, 2)
    apart = 0.15 * raw * (1.0 if left > right else -1.0)
    both = 0.05 * raw * float(left + right)
    return replace(robot, radius_factor=(1.0 + both + 0.5 * apart, 1.0 + both - 0.5 * apart))


def _track(robot: RobotT, raw: float, rng: Rng) -> RobotT:
    return replace(robot, track_factor=1.0 + 0.25 * raw * float(rng.choice([-1.0, 1.0])))


def _joint_damping(robot: RobotT, raw: float, _rng: Rng) -> RobotT:
    """The same share of both: unequal sides would be an effect where a baseline has one value."""
    left, right = (raw * robot.nominal.damping_nms(wheel) for wheel in range(2))
    return replace(robot, damping_nms=(left, right))


def _ballast(robot: RobotT, raw: float, _rng: Rng) -> RobotT:
    return replace(robot, load_kg=raw * robot.nominal.mass_kg)


def _bump(robot: RobotT, raw: float, rng: Rng) -> RobotT:
    at = float(rng.uniform(0.25, 0.5)) * max(0.5, float(np.mean(robot.nominal.gain_mps)))
    return replace(robot, bump_m=0.08 * raw * robot.nominal.radius_m, bump_at_m=at)


def _pendulum(robot: RobotT, raw: float, rng: Rng) -> RobotT:
    length = float(rng.uniform(0.06, 0.25))
    return replace(robot, pendulum_kg=0.6 * raw * robot.nominal.mass_kg, pendulum_m=length)


_SHARED: tuple[EngineEffect[Any], ...] = (
    EngineEffect(
        "joint_friction", "catalogue", "coulomb_friction", "", _joint_friction,
        lambda robot: as_effort(robot, robot.friction_nm),
    ),
    EngineEffect(
        "rolling_friction", "catalogue", "coulomb_friction", "", _rolling_friction,
        lambda robot: as_effort(robot, (_rolling_nm(robot), _rolling_nm(robot))), within=1.5,
    ),
    EngineEffect(
        "gravity_tilt", "catalogue", "floor_slope", "", _tilt, lambda robot: {"slope": robot.slope_rad}
    ),
    EngineEffect(
        "low_grip", "catalogue", "wheel_slip", "", _low_grip,
        lambda robot: {"grip": robot.grip}, within=1.5, start=0.6,
    ),
    EngineEffect("added_mass", "catalogue", "payload_change", "", _load, _load_expected),
    EngineEffect("yaw_inertia", "catalogue", "inertia_coupling", "", _yaw_inertia, _coupling),
    EngineEffect("delay", "catalogue", "input_delay", "", _delay, lambda robot: {"delay": robot.delay_s}),
    EngineEffect("torsion", "catalogue", "turning_scrub", "", _torsion, _torsion_expected, within=1.5),
    EngineEffect(
        "tyre_radius", "catalogue", "wheel_radius_error", "", _tyres,
        lambda robot: {"left": robot.radius_factor[0], "right": robot.radius_factor[1]},
        within=1.02, domain="pose",
    ),
    EngineEffect(
        "track", "catalogue", "wheelbase_error", "", _track,
        lambda robot: {"factor": robot.track_factor}, within=1.02, domain="pose",
    ),
    EngineEffect("joint_damping", "form", "", "", _joint_damping),
    EngineEffect("ballast", "form", "", "", _ballast),
    EngineEffect("floor_step", "outside", "floor_step", "", _bump),
    EngineEffect("pendulum", "outside", "pendulum", "", _pendulum),
)  # fmt: skip
_BY_NAME = {effect.name: effect for effect in _SHARED}


def shared(key: str, means: str, *, name: str = "", incompatible: tuple[str, ...] = ()) -> EngineEffect[Any]:
    """One of these effects with an engine's means, under the engine's own name for it where it has one."""
    return replace(_BY_NAME[key], name=name or key, means=means, incompatible=incompatible)
