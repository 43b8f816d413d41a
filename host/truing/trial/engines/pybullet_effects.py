"""What Bullet can hide in its robot by its own means."""

from __future__ import annotations

from collections.abc import Mapping

from truing.trial.engines.engine import EngineEffect
from truing.trial.engines.pybullet_robot import BulletRobot
from truing.trial.engines.shared_effects import shared

_CONTACT = ("rolling_friction", "spinning_friction")

EFFECTS: Mapping[str, EngineEffect[BulletRobot]] = {
    effect.name: effect
    for effect in (
        shared("joint_friction", "motor constraint at speed zero"),
        shared("rolling_friction", "rollingFriction", incompatible=_CONTACT),
        shared("gravity_tilt", "setGravity"),
        shared("low_grip", "lateralFriction"),
        shared("added_mass", "link mass"),
        shared("yaw_inertia", "link inertia"),
        shared("delay", "a buffer in the stepping loop", name="command_delay"),
        shared("torsion", "spinningFriction", name="spinning_friction", incompatible=_CONTACT),
        shared("tyre_radius", "collision geometry"),
        shared("track", "joint origin"),
        shared("joint_damping", "jointDamping"),
        shared("ballast", "link mass from the start"),
        shared("floor_step", "a box on the floor"),
        shared("pendulum", "a mass on a hinge"),
    )
}
