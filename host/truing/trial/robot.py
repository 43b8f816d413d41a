"""Robots that a first-order model explains down to their noise, and how one thing about them is changed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hil_sim.plant import (
    BatteryParameters,
    BridgeParameters,
    ChassisParameters,
    EncoderParameters,
    FrictionParameters,
    MotorParameters,
    RobotParameters,
    WheelParameters,
)
from hil_sim.unmodelled_effects import UnmodelledEffects
from truing.arrays import FloatArray

_GEAR_RATIO = 30.0
_INDUCTIVE_S = 0.0002
# Share of the inertia at a rim that is wheel and rotor; the rest is the body.
_WHEEL_SHARE = 0.03


@dataclass
class Robot:
    """A robot in the words of its baseline; `build` turns it into the plant's.

    Without friction, scrub, sag and coupling a wheel of the plant is first order: motor, viscous
    friction and inertia. The yaw inertia m W^2 / 4 is the one at which the wheels do not feel each
    other through the body. What effects change lies in `hidden` and `changes`.

    Attributes
    ----------
    gain_mps, time_constant_s : per wheel, left and right.
    viscous : share of viscous friction to back-EMF in what holds a running wheel back.
    stall_a : current of a stalled motor at full supply.
    rotor_share : part of the inertia at a rim that the rotor has.
    coupling_change : yaw inertia above m W^2 / 4, as a share of it.
    changes : parameters of the plant set after all else, by path.
    hidden : effects beyond the plant's parameters, by path.
    filter_s : time constant of the recorder's speed filter.
    """

    radius_m: float = 0.0635
    wheelbase_m: float = 0.283
    counts_per_rev: int = 2400
    supply_v: float = 12.0
    gain_mps: tuple[float, float] = (1.45, 1.45)
    time_constant_s: tuple[float, float] = (0.35, 0.35)
    viscous: float = 0.15
    stall_a: float = 2.0
    rotor_share: float = 0.3
    coupling_change: float = 0.0
    changes: dict[str, float] = field(default_factory=dict)
    hidden: dict[str, Any] = field(default_factory=dict)
    filter_s: float = 0.0

    @property
    def stall_nm(self) -> float:
        """Torque at the wheel at full effort and standstill, mean of both."""
        return float(np.mean([self._torque_constant(i) * self.stall_a for i in (0, 1)]))

    @property
    def inertia_kg(self) -> float:
        """Mass that a rim feels, mean of both."""
        return float(np.mean([self._rim_kg(i) for i in (0, 1)]))

    @property
    def body_kg(self) -> float:
        """The robot's mass without wheels and rotors."""
        lighter_kg = min(self._rim_kg(i) for i in (0, 1))
        return 2.0 * lighter_kg * (1.0 - self.rotor_share - _WHEEL_SHARE)

    @property
    def counts_share(self) -> FloatArray:
        """Counts of a turn over those that the baseline says, left and right, shape (2,)."""
        share: FloatArray = np.array(
            [
                float(self.changes.get(f"{side}__encoder__counts_per_rev", self.counts_per_rev))
                for side in ("left", "right")
            ]
        )
        return share / self.counts_per_rev

    def _torque_constant(self, wheel: int) -> float:
        """N m at the wheel per ampere; volts per rad/s as well."""
        return self.supply_v * self.radius_m / (self.gain_mps[wheel] * (1.0 + self.viscous))

    def _rim_kg(self, wheel: int) -> float:
        constant = self._torque_constant(wheel)
        resistance = self.supply_v / self.stall_a
        damping = constant**2 * (1.0 + self.viscous) / (resistance * self.radius_m**2)
        return self.time_constant_s[wheel] * damping

    def _wheel(self, wheel: int) -> WheelParameters:
        constant = self._torque_constant(wheel)
        resistance = self.supply_v / self.stall_a
        turning_kg = self._rim_kg(wheel) - 0.5 * self.body_kg
        wheel_kg = _WHEEL_SHARE * self._rim_kg(wheel)
        at_axle = self.radius_m**2
        return WheelParameters(
            radius_m=self.radius_m,
            inertia_kgm2=wheel_kg * at_axle,
            motor=MotorParameters(
                resistance_ohm=resistance,
                inductance_h=resistance * _INDUCTIVE_S,
                emf_v_per_radps=constant / _GEAR_RATIO,
                rotor_inertia_kgm2=(turning_kg - wheel_kg) * at_axle / _GEAR_RATIO**2,
                gear_ratio=_GEAR_RATIO,
            ),
            friction=FrictionParameters(0.0, 0.0, 1.0, self.viscous * constant**2 / resistance),
            encoder=EncoderParameters(float(self.counts_per_rev), 0.0),
        )

    def build(self) -> tuple[RobotParameters, UnmodelledEffects]:
        """Return the plant's parameters and its hidden effects."""
        inertia = 0.25 * self.body_kg * self.wheelbase_m**2 * (1.0 + self.coupling_change)
        parameters = RobotParameters(
            left=self._wheel(0),
            right=self._wheel(1),
            chassis=ChassisParameters(self.body_kg, inertia, self.wheelbase_m, 0.0, 1.0),
            battery=BatteryParameters(self.supply_v, self.supply_v, 100.0, 1.0, 0.0, 0.0, 0.01),
            bridge=BridgeParameters(0.7),
        ).changed(**self.changes)
        return parameters, UnmodelledEffects().changed(**self.hidden)

    def add_hidden(self, **values: Any) -> None:
        """Set hidden effects."""
        self.hidden.update(values)

    def effort_nm(self, effort: float) -> float:
        """Torque at the wheel that this effort balances."""
        return effort * self.stall_nm


def draw_robot(rng: np.random.Generator) -> Robot:
    """A robot between a palm-sized one and a small cart; its sides differ a little."""
    gain = math.exp(rng.uniform(math.log(0.7), math.log(1.7)))
    constant = math.exp(rng.uniform(math.log(0.12), math.log(0.45)))
    uneven = 0.04 if rng.random() < 0.7 else 0.0
    sides = 1.0 + uneven * rng.uniform(-1.0, 1.0, 2)
    radius = rng.uniform(0.03, 0.08)
    return Robot(
        radius_m=float(radius),
        wheelbase_m=float(radius * rng.uniform(3.5, 6.0)),
        counts_per_rev=int(rng.choice([1440, 2400, 3200, 4096])),
        supply_v=float(rng.choice([7.4, 12.0, 14.8])),
        gain_mps=(gain * float(sides[0]), gain / float(sides[0])),
        time_constant_s=(constant * float(sides[1]), constant / float(sides[1])),
        viscous=float(rng.uniform(0.08, 0.3)),
        stall_a=float(rng.uniform(1.5, 5.0)),
        rotor_share=float(rng.uniform(0.2, 0.45)),
    )
