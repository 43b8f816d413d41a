"""A user's own robot model, and what of a wheel's model goes into it in its own scale.

With the user's torque T at full effort, damping b and inertia J of an axle (rotor, wheel, and half of the
robot's mass m as the wheel feels it, J = I + m r^2 / 2), the joint turns by (see `joint`)

    J dw/dt = T u - b w - c sign(w),    K = r T / b,    tau = J / b,    c = f T

Gain K and time constant tau of the recordings fix two of T, b and J: their common scale is in no speed.
Either the masses are right and the motors are not (`KEEP_MASSES`), or the torques are and the masses are not
(`KEEP_MOTORS`):

    b = J / tau,  T = K b / r          or          b = r T / K,  J = tau b

The user says which. Without a word it is what changes the user's numbers less, as the sum of the absolute
logarithms of the ratios: a heavier chassis on known motors, for one, changes the mass alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from truing.errors import TruingError
from truing.model.robot_model import RobotModel

from .terms import wheels

KEEP_MASSES, KEEP_MOTORS = "masses", "motors"
KEEPS = (KEEP_MASSES, KEEP_MOTORS)
# A chassis of less than this share of the user's is no plausible correction.
SMALLEST_MASS = 0.1


@dataclass(frozen=True, slots=True)
class OwnAxle:
    """One driven wheel of the user's model: torque at full effort (N m), damping (N m s), friction (N m)."""

    joint: str
    torque_nm: float
    damping_nms: float
    friction_nm: float


@dataclass(frozen=True, slots=True)
class OwnRobot:
    """What of the user's model bears on driving straight.

    Attributes
    ----------
    left, right : the driven wheels.
    inertia_kgm2 : of each axle when the robot drives straight, the robot's mass included: J.
    chassis_kg : mass of the body that carries the wheels; 0 where it stands still (a bench).
    radius_m : of the wheels.
    """

    left: OwnAxle
    right: OwnAxle
    inertia_kgm2: float
    chassis_kg: float
    radius_m: float


@dataclass(frozen=True, slots=True)
class AxlePatch:
    """The numbers that an axle gets."""

    joint: str
    torque_nm: float
    damping_nms: float
    friction_nm: float
    delay_s: float
    lag_s: float


@dataclass(frozen=True, slots=True)
class Patch:
    """What changes in the user's model.

    Attributes
    ----------
    kept : what was taken to be right, one of `KEEPS`.
    inertia_kgm2 : of each axle, J.
    chassis_factor : chassis mass and inertia over the user's.
    """

    left: AxlePatch
    right: AxlePatch
    kept: str
    inertia_kgm2: float
    chassis_factor: float

    def lines(self, own: OwnRobot) -> list[str]:
        """What was done, in sentences."""
        said = [
            f"the {self.kept} are kept"
            + ("" if self.kept == KEEP_MASSES else f": chassis mass x {self.chassis_factor:.3f}")
            + f" (--keep {KEEP_MOTORS if self.kept == KEEP_MASSES else KEEP_MASSES} for the other way)"
        ]
        for before, after in ((own.left, self.left), (own.right, self.right)):
            said.append(
                f"{after.joint}: torque at full effort {before.torque_nm:.4g} -> {after.torque_nm:.4g} N m, "
                f"damping {before.damping_nms:.4g} -> {after.damping_nms:.4g} N m s, "
                f"friction {before.friction_nm:.4g} -> {after.friction_nm:.4g} N m, "
                f"delay {1e3 * after.delay_s:.4g} ms"
            )
        return said


def patch_for(model: RobotModel, own: OwnRobot, keep: str | None = None) -> Patch:
    """The numbers for the user's robot; `keep`: which of them are right, or None for the smaller change.

    Raises
    ------
    TruingError : a wheel drives backward, or the masses that would be needed are none.
    """
    for side, wheel in wheels(model):
        if wheel.gain_mps <= 0.0:
            raise TruingError(
                f"the {side} wheel's gain is {wheel.gain_mps:g} m/s: a joint's torque must drive it forward",
                "Effort and speed have opposite signs in the recordings; turn one of them round",
            )
    found = [_with_masses(model, own)]
    try:
        found.append(_with_motors(model, own))
    except TruingError:
        if keep == KEEP_MOTORS:
            raise
    wanted = [patch for patch in found if keep in (None, patch.kept)]
    return min(wanted, key=lambda patch: _change(patch, own))


def _with_masses(model: RobotModel, own: OwnRobot) -> Patch:
    axles = []
    for (_, wheel), axle in zip(wheels(model), (own.left, own.right), strict=True):
        damping = own.inertia_kgm2 / wheel.time_constant_s
        torque = wheel.gain_mps * damping / own.radius_m
        friction = wheel.friction * torque
        axles.append(AxlePatch(axle.joint, torque, damping, friction, wheel.delay_s, wheel.lag_s))
    return Patch(axles[0], axles[1], KEEP_MASSES, own.inertia_kgm2, 1.0)


def _with_motors(model: RobotModel, own: OwnRobot) -> Patch:
    axles, inertias = [], []
    for (_, wheel), axle in zip(wheels(model), (own.left, own.right), strict=True):
        if axle.torque_nm <= 0.0:
            raise TruingError(f"{axle.joint}: its torque at full effort is not known", "Give --keep masses")
        damping = own.radius_m * axle.torque_nm / wheel.gain_mps
        inertias.append(wheel.time_constant_s * damping)
        torque = axle.torque_nm
        friction = wheel.friction * torque
        axles.append(AxlePatch(axle.joint, torque, damping, friction, wheel.delay_s, wheel.lag_s))
    inertia = 0.5 * sum(inertias)
    if own.chassis_kg <= 0.0:
        raise TruingError("the model's chassis stands still: it has no mass to change", "Give --keep masses")
    chassis_kg = own.chassis_kg + 2.0 * (inertia - own.inertia_kgm2) / own.radius_m**2
    if chassis_kg < SMALLEST_MASS * own.chassis_kg:
        raise TruingError(
            f"with these motors the chassis would weigh {chassis_kg:.3g} kg instead of {own.chassis_kg:.3g}",
            "Give --keep masses, or look at the motors' torque",
        )
    return Patch(axles[0], axles[1], KEEP_MOTORS, inertia, chassis_kg / own.chassis_kg)


def _change(patch: Patch, own: OwnRobot) -> float:
    """How far a patch is from the user's numbers; those that the user's model lacks count nothing."""

    def far(before: float, after: float) -> float:
        return abs(math.log(after / before)) if before > 0.0 and after > 0.0 else 0.0

    pairs = ((own.left, patch.left), (own.right, patch.right))
    per_axle = [
        far(before.torque_nm, after.torque_nm) + far(before.damping_nms, after.damping_nms)
        for before, after in pairs
    ]
    return 0.5 * sum(per_axle) + abs(math.log(patch.chassis_factor))
