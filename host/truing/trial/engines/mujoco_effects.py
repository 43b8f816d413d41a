"""What MuJoCo can hide in its robot by its own means, and what the catalogue calls it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from truing.trial.engines.engine import EngineEffect, Rng
from truing.trial.engines.mujoco_robot import GRAVITY, Brush, MujocoRobot

Pair = tuple[float, float]


def _sides(rng: Rng) -> Pair:
    """How strong an effect is left and right."""
    left, right = rng.uniform(0.75, 1.25, 2)
    return float(left), float(right)


def _of_stall(robot: MujocoRobot, share: float, sides: Pair) -> Pair:
    left, right = robot.nominal.stalls_nm
    return share * left * sides[0], share * right * sides[1]


def _as_effort(robot: MujocoRobot, torques_nm: Pair) -> dict[str, float]:
    left, right = robot.nominal.stalls_nm
    return {"left": torques_nm[0] / left, "right": torques_nm[1] / right}


def _mean_stall_n(robot: MujocoRobot) -> float:
    """Rim force at full effort, mean of both wheels."""
    return float(np.mean(robot.nominal.stalls_nm)) / robot.nominal.radius_m


# In the catalogue -----------------------------------------------------------------------------------


def _joint_friction(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    return replace(robot, friction_nm=_of_stall(robot, 0.2 * raw, _sides(rng)))


def _rolling_friction(robot: MujocoRobot, raw: float, _rng: Rng) -> MujocoRobot:
    torque = 0.2 * raw * float(np.mean(robot.nominal.stalls_nm))
    return replace(robot, rolling_m=2.0 * torque / (robot.nominal.mass_kg * GRAVITY))


def _brush_friction(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    breakaway = _of_stall(robot, 0.3 * raw, _sides(rng))
    share, fading = float(rng.uniform(0.25, 0.5)), float(rng.uniform(0.03, 0.1)) / robot.nominal.radius_m
    left, right = (Brush(share * each, each, fading) for each in breakaway)
    return replace(robot, brush=(left, right))


def _brush_expected(robot: MujocoRobot) -> Mapping[str, float]:
    assert robot.brush is not None
    left, right = robot.brush
    breakaway = _as_effort(robot, (left.breakaway_nm, right.breakaway_nm))
    return {f"breakaway_{side}": value for side, value in breakaway.items()}


def _cogging(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    torques = _of_stall(robot, 0.3 * raw, _sides(rng))
    return replace(robot, cogging_nm=torques, cogging_per_rev=int(rng.integers(3, 13)))


def _cogging_expected(robot: MujocoRobot) -> Mapping[str, float]:
    amplitudes = _as_effort(robot, robot.cogging_nm)
    out = {f"amplitude_{side}": value for side, value in amplitudes.items()}
    return out | {"per_revolution": float(robot.cogging_per_rev)}


def _tilt(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    return replace(robot, slope_rad=0.15 * raw, uphill_rad=float(rng.uniform(-math.pi, math.pi)))


def _low_grip(robot: MujocoRobot, raw: float, _rng: Rng) -> MujocoRobot:
    return replace(robot, grip=0.05**raw)


def _load(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    return replace(robot, load_kg=1.5 * raw * robot.nominal.mass_kg, load_from_run=int(rng.integers(3, 6)))


def _load_expected(robot: MujocoRobot) -> Mapping[str, float]:
    axle = robot.nominal.axle_inertia_kgm2
    return {"time_constant_ratio": 1.0 + 0.5 * robot.load_kg * robot.nominal.radius_m**2 / axle}


def _yaw_inertia(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    return replace(robot, yaw_factor=1.0 + 1.5 * raw if rng.random() < 0.5 else 1.0 - 0.8 * raw)


def _coupling(robot: MujocoRobot) -> Mapping[str, float]:
    """Share of the other wheel's own acceleration: off-diagonal over diagonal of the inverted inertia."""
    nominal = robot.nominal
    quarter = 0.25 * nominal.mass_kg
    turning = nominal.axle_inertia_kgm2 / nominal.radius_m**2 - 2.0 * quarter
    yaw = quarter * robot.yaw_factor
    return {"coupling": (yaw - quarter) / (turning + quarter + yaw)}


def _play(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    left, right = _sides(rng)
    return replace(robot, play_rad=(0.4 * raw * left, 0.4 * raw * right))


def _delay(robot: MujocoRobot, raw: float, _rng: Rng) -> MujocoRobot:
    return replace(robot, delay_s=round(0.3 * raw, 3))


def _filter(robot: MujocoRobot, raw: float, _rng: Rng) -> MujocoRobot:
    return replace(robot, filter_s=0.3 * raw)


def _force_limit(robot: MujocoRobot, raw: float, _rng: Rng) -> MujocoRobot:
    return replace(robot, torque_limit=1.6 - 1.45 * raw)


def _drag(robot: MujocoRobot, raw: float, _rng: Rng) -> MujocoRobot:
    # At 1 m/s the medium takes this share of the stall force of both wheels.
    force = 0.6 * raw * 2.0 * _mean_stall_n(robot)
    return replace(robot, air_kgpm3=force / _drag_per_density(robot))


def _drag_per_density(robot: MujocoRobot) -> float:
    """Force at 1 m/s over density: 2 r_y r_z of each body's box of equal inertia (MuJoCo, Fluid forces)."""
    kilograms, (roll, pitch, yaw) = robot.chassis
    y = math.sqrt(1.5 / kilograms * max(roll + yaw - pitch, 0.0))
    z = math.sqrt(1.5 / kilograms * max(roll + pitch - yaw, 0.0))
    return 2.0 * y * z


def _drag_expected(robot: MujocoRobot) -> Mapping[str, float]:
    each = robot.air_kgpm3 * _drag_per_density(robot) / 2.0 * robot.nominal.radius_m
    return _as_effort(robot, (each, each))


def _torsion(robot: MujocoRobot, raw: float, _rng: Rng) -> MujocoRobot:
    force = 0.25 * raw * _mean_stall_n(robot)
    # Both tyres' moments turn the robot on its track: 2 μ N = F W.
    return replace(robot, torsion_m=force * robot.track_m / (robot.nominal.mass_kg * GRAVITY))


def _torsion_expected(robot: MujocoRobot) -> Mapping[str, float]:
    force = robot.torsion_m * robot.nominal.mass_kg * GRAVITY / robot.track_m
    return {"scrub": force / _mean_stall_n(robot)}


def _tyres(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    left, right = rng.uniform(-1.0, 1.0, 2)
    apart = 0.15 * raw * (1.0 if left > right else -1.0)
    both = 0.05 * raw * float(left + right)
    return replace(robot, radius_factor=(1.0 + both + 0.5 * apart, 1.0 + both - 0.5 * apart))


def _track(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    return replace(robot, track_factor=1.0 + 0.25 * raw * float(rng.choice([-1.0, 1.0])))


# The baseline's form can follow ---------------------------------------------------------------------


def _joint_damping(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    left, right = (raw * share * robot.nominal.damping_nms(i) for i, share in enumerate(_sides(rng)))
    return replace(robot, damping_nms=(left, right))


def _ballast(robot: MujocoRobot, raw: float, _rng: Rng) -> MujocoRobot:
    return replace(robot, load_kg=raw * robot.nominal.mass_kg)


# Outside the catalogue ------------------------------------------------------------------------------


def _trail(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    trail = float(rng.uniform(0.3, 0.6)) * robot.nominal.radius_m
    return replace(robot, caster_trail_m=trail, caster_load=0.05 + 0.55 * raw)


def _shaft(robot: MujocoRobot, raw: float, _rng: Rng) -> MujocoRobot:
    # Resonance of the rotor on the shaft, from 30 Hz down to 2 Hz.
    frequency = 30.0 * (1.0 / 15.0) ** raw
    rotor = robot.nominal.rotor_share * robot.nominal.axle_inertia_kgm2
    return replace(robot, shaft_nm_per_rad=rotor * (2.0 * math.pi * frequency) ** 2)


def _bump(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    at = float(rng.uniform(0.25, 0.5)) * max(0.5, float(np.mean(robot.nominal.gain_mps)))
    return replace(robot, bump_m=0.08 * raw * robot.nominal.radius_m, bump_at_m=at)


def _pendulum(robot: MujocoRobot, raw: float, rng: Rng) -> MujocoRobot:
    length = float(rng.uniform(0.06, 0.25))
    return replace(robot, pendulum_kg=0.6 * raw * robot.nominal.mass_kg, pendulum_m=length)


_DCMOTOR = ("brush_friction", "cogging", "actuator_filter")
_SHAFTS = ("hinge_play", "compliant_shaft")

EFFECTS: Mapping[str, EngineEffect[MujocoRobot]] = {
    effect.name: effect
    for effect in (
        EngineEffect(
            "joint_friction",
            "catalogue",
            "coulomb_friction",
            "joint frictionloss",
            _joint_friction,
            lambda robot: _as_effort(robot, robot.friction_nm),
        ),
        EngineEffect(
            "rolling_friction",
            "catalogue",
            "coulomb_friction",
            "contact condim 6, rolling friction",
            _rolling_friction,
            lambda robot: _as_effort(robot, (_rolling_nm(robot), _rolling_nm(robot))),
            within=1.5,
            incompatible=("tyre_torsion",),
        ),
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
        EngineEffect(
            "gravity_tilt",
            "catalogue",
            "floor_slope",
            "option gravity",
            _tilt,
            lambda robot: {"slope": robot.slope_rad},
        ),
        EngineEffect(
            "low_grip",
            "catalogue",
            "wheel_slip",
            "contact friction",
            _low_grip,
            lambda robot: {"grip": robot.grip},
            within=1.5,
            start=0.6,
        ),
        EngineEffect("added_mass", "catalogue", "payload_change", "body mass", _load, _load_expected),
        EngineEffect("yaw_inertia", "catalogue", "inertia_coupling", "body inertia", _yaw_inertia, _coupling),
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
        EngineEffect(
            "actuator_delay",
            "catalogue",
            "input_delay",
            "actuator delay",
            _delay,
            lambda robot: {"delay": robot.delay_s},
        ),
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
        EngineEffect(
            "tyre_torsion",
            "catalogue",
            "turning_scrub",
            "contact condim 4, torsional friction",
            _torsion,
            _torsion_expected,
            within=1.5,
            incompatible=("rolling_friction",),
        ),
        EngineEffect(
            "tyre_radius",
            "catalogue",
            "wheel_radius_error",
            "geom size",
            _tyres,
            lambda robot: {"left": robot.radius_factor[0], "right": robot.radius_factor[1]},
            within=1.02,
            domain="pose",
        ),
        EngineEffect(
            "track",
            "catalogue",
            "wheelbase_error",
            "body pos",
            _track,
            lambda robot: {"factor": robot.track_factor},
            within=1.02,
            domain="pose",
        ),
        EngineEffect("joint_damping", "form", "", "joint damping", _joint_damping),
        EngineEffect("ballast", "form", "", "body mass from the start", _ballast),
        EngineEffect("caster_trail", "outside", "caster_trail", "a swivel with a trailing wheel", _trail),
        EngineEffect(
            "compliant_shaft",
            "outside",
            "compliant_shaft",
            "two hinges, the second with stiffness",
            _shaft,
            incompatible=_SHAFTS,
        ),
        EngineEffect("floor_step", "outside", "floor_step", "a box on the floor", _bump),
        EngineEffect("pendulum", "outside", "pendulum", "a mass on a hinge", _pendulum),
    )
}


def _rolling_nm(robot: MujocoRobot) -> float:
    return 0.5 * robot.rolling_m * robot.nominal.mass_kg * GRAVITY
