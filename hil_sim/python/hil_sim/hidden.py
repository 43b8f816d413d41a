"""Effects hidden in a simulated robot: `struct plant_hidden` of hidden.h, name by name; zero is off."""

from __future__ import annotations

import ctypes
import dataclasses
from dataclasses import dataclass, field
from typing import Any, TypeAlias

Pair: TypeAlias = tuple[float, float]
"""Left, right."""


@dataclass(frozen=True)
class HiddenDriver:
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
class HiddenSupply:
    """The battery's slow part: a resistance bridged by a capacitance."""

    polarisation_ohm: float = 0.0
    polarisation_s: float = 0.0


@dataclass(frozen=True)
class HiddenThermal:
    """Copper that warms: a winding within a case."""

    resistance_per_k: float = 0.0
    winding_j_per_k: float = 0.0
    winding_w_per_k: float = 0.0
    case_j_per_k: float = 0.0
    case_w_per_k: float = 0.0
    emf_per_k: float = 0.0


@dataclass(frozen=True)
class HiddenBristle:
    """Dry friction of bristles that bend before they slide."""

    coulomb_nm: Pair = (0.0, 0.0)
    breakaway_nm: Pair = (0.0, 0.0)
    stribeck_radps: float = 0.0
    bend_rad: float = 0.0


@dataclass(frozen=True)
class HiddenGear:
    """What lies between the motor, where the encoder sits, and the wheel."""

    lash_rad: Pair = (0.0, 0.0)
    stiffness_nm_per_rad: float = 0.0
    damping: float = 0.0
    slip_nm: Pair = (0.0, 0.0)
    forward_flywheel_kgm2: Pair = (0.0, 0.0)


@dataclass(frozen=True)
class HiddenTyre:
    """Tyres of finite grip; grip 0: they roll without slip."""

    grip: float = 0.0
    slip_at_peak: float = 0.0
    load_on_wheels: float = 0.0


@dataclass(frozen=True)
class HiddenLoad:
    """Forces that the robot meets on its way."""

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
class HiddenEncoder:
    """What the encoder gets wrong."""

    eccentricity_rad: Pair = (0.0, 0.0)
    eccentricity_phase_rad: Pair = (0.0, 0.0)
    dropout: Pair = (0.0, 0.0)
    dropout_at_radps: float = 0.0


@dataclass(frozen=True)
class HiddenCreep:
    """Ways of the body over the floor that no wheel knows of."""

    drift_rad_per_m: float = 0.0
    distance_scale: float = 0.0


@dataclass(frozen=True)
class HiddenPayload:
    """A load put onto the robot."""

    mass_kg: float = 0.0
    yaw_inertia_kgm2: float = 0.0
    at_s: float = 0.0


@dataclass(frozen=True)
class HiddenDisturbance:
    """Torque that nobody commanded, coloured and seeded."""

    torque_nm: Pair = (0.0, 0.0)
    correlation_s: float = 0.0
    resting_mps: float = 0.0


@dataclass(frozen=True)
class HiddenEffects:
    """Everything that a robot may have beyond `RobotParameters`; as made here: nothing."""

    driver: HiddenDriver = field(default_factory=HiddenDriver)
    supply: HiddenSupply = field(default_factory=HiddenSupply)
    thermal: HiddenThermal = field(default_factory=HiddenThermal)
    bristle: HiddenBristle = field(default_factory=HiddenBristle)
    gear: HiddenGear = field(default_factory=HiddenGear)
    tyre: HiddenTyre = field(default_factory=HiddenTyre)
    load: HiddenLoad = field(default_factory=HiddenLoad)
    encoder: HiddenEncoder = field(default_factory=HiddenEncoder)
    creep: HiddenCreep = field(default_factory=HiddenCreep)
    payload: HiddenPayload = field(default_factory=HiddenPayload)
    disturbance: HiddenDisturbance = field(default_factory=HiddenDisturbance)

    def changed(self, **values: float | Pair) -> HiddenEffects:
        """A copy with some values changed, named by path with `__` for the dot.

        Examples
        --------
        >>> HiddenEffects().changed(driver__delay_s=0.05, encoder__dropout=(0.0, 0.1))
        """
        parts: dict[str, Any] = {}
        for path, value in values.items():
            part, _, name = path.partition("__")
            parts[part] = dataclasses.replace(parts.get(part, getattr(self, part)), **{name: value})
        return dataclasses.replace(self, **parts)

    def to_dict(self) -> dict[str, Any]:
        """What is not zero."""
        return {
            part: kept
            for part, values in dataclasses.asdict(self).items()
            if (kept := {name: value for name, value in values.items() if value not in (0.0, (0.0, 0.0))})
        }


def _native_of(kind: type[Any]) -> type[ctypes.Structure]:
    fields: list[tuple[str, Any]] = [
        (each.name, ctypes.c_double * 2 if str(each.type) == "Pair" else ctypes.c_double)
        for each in dataclasses.fields(kind)
    ]
    return type(f"_{kind.__name__}", (ctypes.Structure,), {"_fields_": fields})


_PARTS = {
    each.name: _native_of(type(getattr(HiddenEffects(), each.name)))
    for each in dataclasses.fields(HiddenEffects)
}
_Native = type("_HiddenEffects", (ctypes.Structure,), {"_fields_": list(_PARTS.items())})


def hidden_to_native(hidden: HiddenEffects) -> ctypes.Structure:
    """`struct plant_hidden`, to be passed by reference."""
    parts = {name: native(*dataclasses.astuple(getattr(hidden, name))) for name, native in _PARTS.items()}
    made: ctypes.Structure = _Native(**parts)
    return made
