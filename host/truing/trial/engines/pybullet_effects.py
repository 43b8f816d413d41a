"""What Bullet can hide in its robot by its own means, and what the catalogue calls it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from truing.trial.engines.engine import EngineEffect, Rng
from truing.trial.engines.pybullet_robot import GRAVITY, BulletRobot

Pair = tuple[float, float]


def _sides(rng: Rng) -> Pair:
    left, right = rng.uniform(0.75, 1.25, 2)
    return float(left), float(right)


def _as_effort(robot: BulletRobot, torques_nm: Pair) -> dict[str, float]:
    left, right = robot.nominal.stalls_nm
    return {"left": torques_nm[0] / left, "right": torques_nm[1] / right}


def _mean_stall_nm(robot: BulletRobot) -> float:
    return float(np.mean(robot.nominal.stalls_nm))


def _joint_friction(robot: BulletRobot, raw: float, rng: Rng) -> BulletRobot:
    (left, right), sides = robot.nominal.stalls_nm, _sides(rng)
    return replace(robot, friction_nm=(0.2 * raw * left * sides[0], 0.2 * raw * right * sides[1]))


def _rolling(robot: BulletRobot, raw: float, _rng: Rng) -> BulletRobot:
    return replace(
        robot, rolling_m=2.0 * 0.2 * raw * _mean_stall_nm(robot) / (robot.nominal.mass_kg * GRAVITY)
    )


def _rolling_expected(robot: BulletRobot) -> Mapping[str, float]:
    each = 0.5 * robot.rolling_m * robot.nominal.mass_kg * GRAVITY
    return _as_effort(robot, (each, each))


def _tilt(robot: BulletRobot, raw: float, rng: Rng) -> BulletRobot:
    return replace(robot, slope_rad=0.15 * raw, uphill_rad=float(rng.uniform(-math.pi, math.pi)))


def _low_grip(robot: BulletRobot, raw: float, _rng: Rng) -> BulletRobot:
    return replace(robot, grip=0.05**raw)


def _load(robot: BulletRobot, raw: float, rng: Rng) -> BulletRobot:
    return replace(robot, load_kg=1.5 * raw * robot.nominal.mass_kg, load_from_run=int(rng.integers(3, 6)))


def _load_expected(robot: BulletRobot) -> Mapping[str, float]:
    axle = robot.nominal.axle_inertia_kgm2
    return {"time_constant_ratio": 1.0 + 0.5 * robot.load_kg * robot.nominal.radius_m**2 / axle}


def _yaw_inertia(robot: BulletRobot, raw: float, rng: Rng) -> BulletRobot:
    return replace(robot, yaw_factor=1.0 + 1.5 * raw if rng.random() < 0.5 else 1.0 - 0.8 * raw)


def _coupling(robot: BulletRobot) -> Mapping[str, float]:
    """Share of the other wheel's own acceleration: off-diagonal over diagonal of the inverted inertia."""
    nominal = robot.nominal
    quarter = 0.25 * nominal.mass_kg
    turning = nominal.axle_inertia_kgm2 / nominal.radius_m**2 - 2.0 * quarter
    yaw = quarter * robot.yaw_factor
    return {"coupling": (yaw - quarter) / (turning + quarter + yaw)}


def _delay(robot: BulletRobot, raw: float, _rng: Rng) -> BulletRobot:
    return replace(robot, delay_s=round(0.3 * raw, 3))


def _spinning(robot: BulletRobot, raw: float, _rng: Rng) -> BulletRobot:
    force = 0.25 * raw * _mean_stall_nm(robot) / robot.nominal.radius_m
    # Both tyres' moments turn the robot on its track: 2 μ N = F W.
    return replace(robot, spinning_m=force * robot.track_m / (robot.nominal.mass_kg * GRAVITY))


def _spinning_expected(robot: BulletRobot) -> Mapping[str, float]:
    force = robot.spinning_m * robot.nominal.mass_kg * GRAVITY / robot.track_m
    return {"scrub": force * robot.nominal.radius_m / _mean_stall_nm(robot)}


def _tyres(robot: BulletRobot, raw: float, rng: Rng) -> BulletRobot:
    left, right = rng.uniform(-1.0, 1.0, 2)
    apart = 0.15 * raw * (1.0 if left > right else -1.0)
    both = 0.05 * raw * float(left + right)
    return replace(robot, radius_factor=(1.0 + both + 0.5 * apart, 1.0 + both - 0.5 * apart))


def _track(robot: BulletRobot, raw: float, rng: Rng) -> BulletRobot:
    return replace(robot, track_factor=1.0 + 0.25 * raw * float(rng.choice([-1.0, 1.0])))


def _joint_damping(robot: BulletRobot, raw: float, rng: Rng) -> BulletRobot:
    left, right = (raw * share * robot.nominal.damping_nms(i) for i, share in enumerate(_sides(rng)))
    return replace(robot, damping_nms=(left, right))


def _ballast(robot: BulletRobot, raw: float, _rng: Rng) -> BulletRobot:
    return replace(robot, load_kg=raw * robot.nominal.mass_kg)


def _bump(robot: BulletRobot, raw: float, rng: Rng) -> BulletRobot:
    at = float(rng.uniform(0.25, 0.5)) * max(0.5, float(np.mean(robot.nominal.gain_mps)))
    return replace(robot, bump_m=0.08 * raw * robot.nominal.radius_m, bump_at_m=at)


def _pendulum(robot: BulletRobot, raw: float, rng: Rng) -> BulletRobot:
    length = float(rng.uniform(0.06, 0.25))
    return replace(robot, pendulum_kg=0.6 * raw * robot.nominal.mass_kg, pendulum_m=length)


_CONTACT = ("rolling_friction", "spinning_friction")
_Effect = EngineEffect[BulletRobot]

EFFECTS: Mapping[str, EngineEffect[BulletRobot]] = {
    effect.name: effect
    for effect in (
        _Effect(
            "joint_friction", "catalogue", "coulomb_friction", "motor constraint at speed zero",
            _joint_friction, lambda robot: _as_effort(robot, robot.friction_nm),
        ),
        _Effect(
            "rolling_friction", "catalogue", "coulomb_friction", "rollingFriction",
            _rolling, _rolling_expected, within=1.5, incompatible=_CONTACT,
        ),
        _Effect(
            "gravity_tilt", "catalogue", "floor_slope", "setGravity", _tilt,
            lambda robot: {"slope": robot.slope_rad},
        ),
        _Effect(
            "low_grip", "catalogue", "wheel_slip", "lateralFriction", _low_grip,
            lambda robot: {"grip": robot.grip}, within=1.5, start=0.6,
        ),
        _Effect("added_mass", "catalogue", "payload_change", "link mass", _load, _load_expected),
        _Effect("yaw_inertia", "catalogue", "inertia_coupling", "link inertia", _yaw_inertia, _coupling),
        _Effect(
            "command_delay", "catalogue", "input_delay", "a buffer in the stepping loop", _delay,
            lambda robot: {"delay": robot.delay_s},
        ),
        _Effect(
            "spinning_friction", "catalogue", "turning_scrub", "spinningFriction",
            _spinning, _spinning_expected, within=1.5, incompatible=_CONTACT,
        ),
        _Effect(
            "tyre_radius", "catalogue", "wheel_radius_error", "collision geometry", _tyres,
            lambda robot: {"left": robot.radius_factor[0], "right": robot.radius_factor[1]},
            within=1.02, domain="pose",
        ),
        _Effect(
            "track", "catalogue", "wheelbase_error", "joint origin", _track,
            lambda robot: {"factor": robot.track_factor}, within=1.02, domain="pose",
        ),
        _Effect("joint_damping", "form", "", "jointDamping", _joint_damping),
        _Effect("ballast", "form", "", "link mass from the start", _ballast),
        _Effect("floor_step", "outside", "floor_step", "a box on the floor", _bump),
        _Effect("pendulum", "outside", "pendulum", "a mass on a hinge", _pendulum),
    )
}  # fmt: skip
