"""A wheel's first-order model as a joint that turns: inertia, damping, dry friction and torque.

Derivation. The model, for the speed v at the rim of a wheel of radius r, with effort u and friction f:

    tau dv/dt = K (u - f sign(v)) - v                                        (1)

A rigid axle of inertia J with a motor of torque T u, viscous damping b and dry friction c turns at w by

    J dw/dt = T u - b w - c sign(w)                                          (2)

With v = r w, (1) times J / (r tau) is (2) when

    b = J / tau,    T = K J / (r tau) = K b / r,    c = f T                   (3)

so that steady speed (T u - c) / b = K (u - f) / r, time constant J / b = tau and the effort that just moves
the wheel, c / T = f, all agree, whatever J is. Speeds and efforts therefore cannot tell J: it is the one free
choice, a scale of torque. Unless it is given, J is what half of a robot of 5 kg puts on each axle,
J = 1/2 (5 kg) r^2. All of J sits on the axle here (rotor, gears, wheel and the robot's mass as the wheel
feels it), and the robot's body stands still: (2) is then exact. On a floor, where the simulator moves a robot
of mass m, the wheel feels m r^2 / 2 through its contact; that share is then to be taken off the axle:

    J_axle = J - m r^2 / 2,    with b, c and T as they are                    (4)

for which m must be below 2 J / r^2; a yaw inertia of m (wheelbase / 2)^2 makes turning as quick as rolling.
"""

from __future__ import annotations

from dataclasses import dataclass

from truing.errors import TruingError
from truing.model.robot_model import RobotModel

from .terms import REFERENCE_MASS_KG, ExportOptions, headline, left_out, wheels

# The wheel's own share of J where a format separates the body's inertia from the joint's.
WHEEL_SHARE = 0.1


@dataclass(frozen=True, slots=True)
class Joint:
    """One axle in SI units.

    Attributes
    ----------
    inertia_kgm2, damping_nms, friction_nm, torque_nm : J, b, c and T (at full effort) of equation (2).
    top_radps : speed at full effort without friction, K / r.
    delay_s, lag_s : from effort to torque, pure and of first order.
    """

    side: str
    inertia_kgm2: float
    damping_nms: float
    friction_nm: float
    torque_nm: float
    top_radps: float
    delay_s: float
    lag_s: float

    @property
    def name(self) -> str:
        """The joint's name in every format."""
        return f"{self.side}_wheel_joint"


def joints(model: RobotModel, options: ExportOptions) -> tuple[Joint, Joint]:
    """Both axles, left first, by equation (3)."""
    radius = options.radius(model)
    inertia = options.inertia_kgm2 or 0.5 * REFERENCE_MASS_KG * radius**2
    made = []
    for side, wheel in wheels(model):
        if wheel.gain_mps <= 0.0:
            raise TruingError(
                f"the {side} wheel's gain is {wheel.gain_mps:g} m/s: a joint's torque must drive it forward",
                "Effort and speed have opposite signs in the recordings; turn one of them round",
            )
        damping = inertia / wheel.time_constant_s
        torque = wheel.gain_mps * damping / radius
        top = wheel.gain_mps / radius
        friction = wheel.friction * torque
        made.append(Joint(side, inertia, damping, friction, torque, top, wheel.delay_s, wheel.lag_s))
    return made[0], made[1]


def remarks(model: RobotModel, options: ExportOptions) -> tuple[str, ...]:
    """The free choice, and how to turn effort into torque."""
    inertia = joints(model, options)[0].inertia_kgm2
    mass = 2.0 * inertia / options.radius(model) ** 2
    source = "as asked" if options.inertia_kgm2 else "a free choice"
    return (
        f"inertia per axle is {inertia:.6g} kg m^2, {source}: torques scale with it, speeds do not change",
        f"that is half of a robot of {mass:.4g} kg whose body stands still; where a simulator moves a mass m "
        "on a floor, take m r^2 / 2 off the axle",
    )


def joint_notes(model: RobotModel, options: ExportOptions, holds: frozenset[str]) -> tuple[str, ...]:
    """What a file of joints says at its top."""
    return (
        headline(model),
        "joint torque = effort (-1..1) times the joint's effort limit",
        *remarks(model, options),
        *left_out(model, holds),
    )
