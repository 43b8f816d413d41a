"""What the robots of all engines have in common, and can have changed about them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from truing.trial.engines.nominal import NominalRobot

GRAVITY = 9.81
# Of tyre on floor where nothing is hidden: no drive of the nominal robots slips.
GRIP = 2.0


@dataclass(frozen=True)
class EngineRobot:
    """The robot as it is built; left at its defaults it is healthy.

    Attributes
    ----------
    friction_nm, damping_nms : of the axles' joints, left and right, beyond the nominal ones.
    slope_rad, uphill_rad : inclination of the floor, and the heading that points uphill.
    grip, torsion_m, rolling_m : the tyres' contact: sliding, torsional and rolling friction.
    load_kg, load_from_run : a load over the wheels, from this run on.
    yaw_factor : yaw inertia over the nominal one.
    delay_s : of the commands.
    radius_factor, track_factor : tyres and track over the nominal ones.
    bump_m, bump_at_m : height of a step in the floor, and where it lies.
    pendulum_kg, pendulum_m : mass that hangs inside, and on what length.
    """

    nominal: NominalRobot
    friction_nm: tuple[float, float] = (0.0, 0.0)
    damping_nms: tuple[float, float] = (0.0, 0.0)
    slope_rad: float = 0.0
    uphill_rad: float = 0.0
    grip: float = GRIP
    torsion_m: float = 0.0
    rolling_m: float = 0.0
    load_kg: float = 0.0
    load_from_run: int = 0
    yaw_factor: float = 1.0
    delay_s: float = 0.0
    radius_factor: tuple[float, float] = (1.0, 1.0)
    track_factor: float = 1.0
    bump_m: float = 0.0
    bump_at_m: float = 0.0
    pendulum_kg: float = 0.0
    pendulum_m: float = 0.1

    @property
    def track_m(self) -> float:
        """Distance between the wheels."""
        return self.nominal.wheelbase_m * self.track_factor

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Gravity along the floor's axes, m/s²."""
        along = -GRAVITY * math.sin(self.slope_rad)
        return (
            along * math.cos(self.uphill_rad),
            along * math.sin(self.uphill_rad),
            -GRAVITY * math.cos(self.slope_rad),
        )
