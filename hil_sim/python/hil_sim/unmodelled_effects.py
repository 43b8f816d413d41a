"""Effects that a simpler model leaves out: `struct plant_unmodelled_effects`, name by name; zero is off."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from hil_sim import native

Pair: TypeAlias = tuple[float, float]
"""Left, right."""


@dataclass(frozen=True)
class DriverEffects:
    """Between the effort that the bridge inputs ask for and the voltage that the motor gets."""

    delay_s: float = 0.0
    lag_s: float = 0.0
    deadband: float = 0.0
    current_limit_a: float = 0.0
    speed_limit_mps: float = 0.0
    reverse_gain: Pair = (0.0, 0.0)
    floats_at_zero: float = 0.0
    square_law: float = 0.0
    dropout_every_s: float = 0.0
    dropout_s: float = 0.0
    dropout_wheels: Pair = (0.0, 0.0)


@dataclass(frozen=True)
class SupplyEffects:
    """The battery's slow part: a resistance bridged by a capacitance."""

    polarisation_ohm: float = 0.0
    polarisation_s: float = 0.0


@dataclass(frozen=True)
class ThermalEffects:
    """Heating of the winding within its case."""

    resistance_per_k: float = 0.0
    winding_j_per_k: float = 0.0
    winding_w_per_k: float = 0.0
    case_j_per_k: float = 0.0
    case_w_per_k: float = 0.0
    emf_per_k: float = 0.0


@dataclass(frozen=True)
class BristleEffects:
    """Dry friction of bristles that bend before they slide."""

    coulomb_nm: Pair = (0.0, 0.0)
    breakaway_nm: Pair = (0.0, 0.0)
    stribeck_radps: float = 0.0
    bend_rad: float = 0.0


@dataclass(frozen=True)
class GearEffects:
    """The drive train between the motor, where the encoder sits, and the wheel."""

    lash_rad: Pair = (0.0, 0.0)
    stiffness_nm_per_rad: float = 0.0
    damping: float = 0.0
    slip_nm: Pair = (0.0, 0.0)
    forward_flywheel_kgm2: Pair = (0.0, 0.0)


@dataclass(frozen=True)
class TyreEffects:
    """Tyres of finite grip; grip 0: they roll without slip."""

    grip: float = 0.0
    slip_at_peak: float = 0.0
    load_on_wheels: float = 0.0


@dataclass(frozen=True)
class LoadEffects:
    """External forces."""

    quadratic_nms2: Pair = (0.0, 0.0)
    ripple_nm: Pair = (0.0, 0.0)
    ripple_per_turn: float = 0.0
    ripple_phase_rad: Pair = (0.0, 0.0)
    slope_rad: float = 0.0
    uphill_rad: float = 0.0
    patch_n: float = 0.0
    patch_pitch_m: float = 0.0
    spring_n_per_m: float = 0.0
    swing_kg: float = 0.0
    swing_hz: float = 0.0
    swing_damping: float = 0.0


@dataclass(frozen=True)
class EncoderEffects:
    """Encoder errors."""

    eccentricity_rad: Pair = (0.0, 0.0)
    eccentricity_phase_rad: Pair = (0.0, 0.0)
    dropout: Pair = (0.0, 0.0)
    dropout_at_radps: float = 0.0


@dataclass(frozen=True)
class CreepEffects:
    """Motion of the body over the floor that the wheels do not measure."""

    drift_rad_per_m: float = 0.0
    distance_scale: float = 0.0


@dataclass(frozen=True)
class PayloadEffects:
    """A payload put onto the robot."""

    mass_kg: float = 0.0
    yaw_inertia_kgm2: float = 0.0
    at_s: float = 0.0


@dataclass(frozen=True)
class DisturbanceEffects:
    """Torque disturbance: coloured noise, seeded."""

    torque_nm: Pair = (0.0, 0.0)
    correlation_s: float = 0.0
    resting_mps: float = 0.0


@dataclass(frozen=True)
class IntermittentEffects:
    """What acts for some time only, in runs that begin when both wheels are let go."""

    carpet_nm: Pair = (0.0, 0.0)
    carpet_from_s: float = 0.0
    carpet_room_s: float = 0.0
    carpet_for_s: float = 0.0
    carpet_from_m: float = 0.0
    carpet_for_m: float = 0.0
    push_n: Pair = (0.0, 0.0)
    push_share: float = 0.0
    push_from_s: float = 0.0
    push_room_s: float = 0.0
    push_for_s: float = 0.0
    bind_nm: Pair = (0.0, 0.0)
    bind_every_s: float = 0.0
    bind_for_s: float = 0.0
    knock_n: Pair = (0.0, 0.0)
    knock_every_s: float = 0.0
    knock_for_s: float = 0.0


@native.mirror("plant_unmodelled_effects")
@dataclass(frozen=True)
class UnmodelledEffects:
    """All effects beyond `RobotParameters`; by default none."""

    driver: DriverEffects = field(default_factory=DriverEffects)
    supply: SupplyEffects = field(default_factory=SupplyEffects)
    thermal: ThermalEffects = field(default_factory=ThermalEffects)
    bristle: BristleEffects = field(default_factory=BristleEffects)
    gear: GearEffects = field(default_factory=GearEffects)
    tyre: TyreEffects = field(default_factory=TyreEffects)
    load: LoadEffects = field(default_factory=LoadEffects)
    encoder: EncoderEffects = field(default_factory=EncoderEffects)
    creep: CreepEffects = field(default_factory=CreepEffects)
    payload: PayloadEffects = field(default_factory=PayloadEffects)
    disturbance: DisturbanceEffects = field(default_factory=DisturbanceEffects)
    intermittent: IntermittentEffects = field(default_factory=IntermittentEffects)

    def changed(self, **values: float | Pair) -> UnmodelledEffects:
        """A copy with some values changed, named by path with `__` for the dot.

        Examples
        --------
        >>> UnmodelledEffects().changed(driver__delay_s=0.05, encoder__dropout=(0.0, 0.1))
        """
        parts: dict[str, Any] = {}
        for path, value in values.items():
            part, _, name = path.partition("__")
            parts[part] = dataclasses.replace(parts.get(part, getattr(self, part)), **{name: value})
        return dataclasses.replace(self, **parts)

    def to_dict(self) -> dict[str, Any]:
        """Return the values that are not zero."""
        return {
            part: kept
            for part, values in dataclasses.asdict(self).items()
            if (kept := {name: value for name, value in values.items() if value not in (0.0, (0.0, 0.0))})
        }
