"""What MuJoCo can hide in its robot by its own means, and what the catalogue calls it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from truing.trial.engines.engine import EngineEffect, Rng
from truing.trial.engines.mujoco_robot import Brush, MujocoRobot
from truing.trial.engines.shared_effects import as_effort, mean_stall_n, of_stall, shared, sides


def _brush_friction(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    breakaway = of_stall(robot, 0.3 * raw, sides(rng))
    share, fading = float(rng.uniform(0.25, 0.5)), float(rng.uniform(0.03, 0.1)) / robot.nominal.radius_m
    left, right = (Brush(share * each, each, fading) for each in breakaway)
    return replace(robot, brush=(left, right))


def _brush_expected(robot: MujocoRobot) -> Mapping[str, float]:
    assert robot.brush is not None
    left, right = robot.brush
    breakaway = as_effort(robot, (left.breakaway_nm, right.breakaway_nm))
    return {f"breakaway_{side}": value for side, value in breakaway.items()}


def _cogging(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    torques = of_stall(robot, 0.3 * raw, sides(rng))
    return replace(robot, cogging_nm=torques, cogging_per_rev=int(rng.integers(3, 13)))


def _cogging_expected(robot: MujocoRobot) -> Mapping[str, float]:
    amplitudes = as_effort(robot, robot.cogging_nm)
    out = {f"amplitude_{side}": value for side, value in amplitudes.items()}
    return out | {"per_revolution": float(robot.cogging_per_rev)}


def _play(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    left, right = sides(rng)
    return replace(robot, play_rad=(0.4 * raw * left, 0.4 * raw * right))


def _filter(robot: MujocoRobot, raw: float, _rng: Rng) -> MujocoRobot:
    return replace(robot, filter_s=0.3 * raw)


def _force_limit(robot: MujocoRobot, raw: float, _rng: Rng) -> MujocoRobot:
    return replace(robot, torque_limit=1.6 - 1.45 * raw)


def _drag(robot: MujocoRobot, raw: float, _rng: Rng) -> MujocoRobot:
    # At 1 m/s the medium takes this share of the stall force of both wheels.
    force = 0.6 * raw * 2.0 * mean_stall_n(robot)
    return replace(robot, air_kgpm3=force / _drag_per_density(robot))


def _drag_per_density(robot: MujocoRobot) -> float:
    """Force at 1 m/s over density: 2 r_y r_z of each body's box of equal inertia (MuJoCo, Fluid forces)."""
    kilograms, (roll, pitch, yaw) = robot.chassis
    y = math.sqrt(1.5 / kilograms * max(roll + yaw - pitch, 0.0))
    z = math.sqrt(1.5 / kilograms * max(roll + pitch - yaw, 0.0))
    return 2.0 * y * z


def _drag_expected(robot: MujocoRobot) -> Mapping[str, float]:
    each = robot.air_kgpm3 * _drag_per_density(robot) / 2.0 * robot.nominal.radius_m
    return as_effort(robot, (each, each))


def _trail(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    trail = float(rng.uniform(0.3, 0.6)) * robot.nominal.radius_m
    return replace(robot, caster_trail_m=trail, caster_load=0.05 + 0.55 * raw)


def _shaft(robot: MujocoRobot, raw: float, _rng: Rng) -> MujocoRobot:
    # Resonance of the rotor on the shaft, from 30 Hz down to 2 Hz.
    frequency = 30.0 * (1.0 / 15.0) ** raw
    rotor = robot.nominal.rotor_share * robot.nominal.axle_inertia_kgm2
    return replace(robot, shaft_nm_per_rad=rotor * (2.0 * math.pi * frequency) ** 2)


_DCMOTOR = ("brush_friction", "cogging", "actuator_filter")
_SHAFTS = ("hinge_play", "compliant_shaft")

EFFECTS: Mapping[str, EngineEffect[MujocoRobot]] = {
    effect.name: effect
    for effect in (
        shared("joint_friction", "joint frictionloss"),
        shared("rolling_friction", "contact condim 6, rolling friction", incompatible=("tyre_torsion",)),
        EngineEffect(
            "brush_friction",
            "catalogue",
            "stribeck_friction",
            "dcmotor lugre",
            _brush_friction,
            _brush_expected,
            within=1.5,
            incompatible=_DCMOTOR,
        ),
        EngineEffect(
            "cogging",
            "catalogue",
            "torque_ripple",
            "dcmotor cogging",
            _cogging,
            _cogging_expected,
            incompatible=_DCMOTOR,
        ),
        shared("gravity_tilt", "option gravity"),
        shared("low_grip", "contact friction"),
        shared("added_mass", "body mass"),
        shared("yaw_inertia", "body inertia"),
        EngineEffect(
            "hinge_play",
            "catalogue",
            "gear_backlash",
            "two hinges, the second with limits",
            _play,
            lambda robot: {"left": robot.play_rad[0], "right": robot.play_rad[1]},
            within=1.5,
            incompatible=_SHAFTS,
        ),
        shared("delay", "actuator delay", name="actuator_delay"),
        EngineEffect(
            "actuator_filter",
            "catalogue",
            "driver_lag",
            "actuator dyntype filterexact",
            _filter,
            lambda robot: {"time_constant": robot.filter_s},
            incompatible=_DCMOTOR,
        ),
        EngineEffect(
            "force_limit",
            "catalogue",
            "current_limit",
            "actuator forcerange",
            _force_limit,
            lambda robot: {"limit": robot.torque_limit},
        ),
        EngineEffect(
            "fluid_drag", "catalogue", "quadratic_drag", "option density", _drag, _drag_expected, within=1.5
        ),
        shared(
            "torsion",
            "contact condim 4, torsional friction",
            name="tyre_torsion",
            incompatible=("rolling_friction",),
        ),
        shared("tyre_radius", "geom size"),
        shared("track", "body pos"),
        shared("joint_damping", "joint damping"),
        shared("ballast", "body mass from the start"),
        EngineEffect("caster_trail", "outside", "caster_trail", "a swivel with a trailing wheel", _trail),
        EngineEffect(
            "compliant_shaft",
            "outside",
            "compliant_shaft",
            "two hinges, the second with stiffness",
            _shaft,
            incompatible=_SHAFTS,
        ),
        shared("floor_step", "a box on the floor"),
        shared("pendulum", "a mass on a hinge"),
    )
}
