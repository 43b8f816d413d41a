"""The robot in the words of its baseline, before an engine builds it: sizes, gains, time constants."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

# Share of a wheel's inertia at its axle that is the wheel itself; the rest is body and rotor.
WHEEL_SHARE = 0.03
# A body that accelerates harder than this lifts its weight off the wheels and slips: no first-order robot.
_HARDEST_MPS2 = 5.0


@dataclass(frozen=True)
class NominalRobot:
    """Two driven wheels that a first-order model describes, and the masses and torques that make them so.

    Without friction, and with the yaw inertia M W² / 4 at which the wheels do not feel each other through
    the body, the axle of each wheel has the inertia r² M / 2 + rotor + wheel and the damping of back-EMF and
    bearing; gain and time constant follow.

    Attributes
    ----------
    mass_kg : all of the robot.
    gain_mps, time_constant_s : left and right.
    viscous : share of the bearing's damping to that of back-EMF.
    rotor_share : part of the inertia at an axle that the rotor has.
    """

    radius_m: float
    wheelbase_m: float
    counts_per_rev: int
    mass_kg: float
    gain_mps: tuple[float, float]
    time_constant_s: tuple[float, float]
    viscous: float
    rotor_share: float

    @property
    def axle_inertia_kgm2(self) -> float:
        """Inertia that a wheel's torque accelerates, at the axle."""
        return 0.5 * self.mass_kg * self.radius_m**2 / (1.0 - self.rotor_share - WHEEL_SHARE)

    @property
    def yaw_inertia_kgm2(self) -> float:
        """Yaw inertia of all of the robot at which the wheels do not feel each other."""
        return 0.25 * self.mass_kg * self.wheelbase_m**2

    def damping_nms(self, wheel: int) -> float:
        """Back-EMF and bearing together, at the axle."""
        return self.axle_inertia_kgm2 / self.time_constant_s[wheel]

    def stall_nm(self, wheel: int) -> float:
        """Torque at the axle at full effort and standstill."""
        return self.damping_nms(wheel) * self.gain_mps[wheel] / self.radius_m

    @property
    def stalls_nm(self) -> tuple[float, float]:
        """The same of both wheels."""
        return self.stall_nm(0), self.stall_nm(1)

    @property
    def metres_per_count(self) -> float:
        """Rim travel per encoder count."""
        return 2.0 * math.pi * self.radius_m / self.counts_per_rev


def draw_nominal(rng: np.random.Generator) -> NominalRobot:
    """A robot between a palm-sized one and a small cart; its sides differ a little."""
    gain = math.exp(rng.uniform(math.log(0.6), math.log(1.5)))
    constant = max(math.exp(rng.uniform(math.log(0.14), math.log(0.45))), gain / _HARDEST_MPS2)
    uneven = 0.04 if rng.random() < 0.7 else 0.0
    sides = 1.0 + uneven * rng.uniform(-1.0, 1.0, 2)
    radius = float(rng.uniform(0.03, 0.08))
    return NominalRobot(
        radius_m=round(radius, 4),
        wheelbase_m=round(radius * float(rng.uniform(3.5, 6.0)), 4),
        counts_per_rev=int(rng.choice([1440, 2400, 3200, 4096])),
        mass_kg=math.exp(rng.uniform(math.log(0.6), math.log(6.0))),
        gain_mps=(gain * float(sides[0]), gain / float(sides[0])),
        time_constant_s=(constant * float(sides[1]), constant / float(sides[1])),
        viscous=float(rng.uniform(0.08, 0.3)),
        rotor_share=float(rng.uniform(0.15, 0.35)),
    )
