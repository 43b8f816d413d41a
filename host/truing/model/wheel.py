"""One wheel's continuous model: its physical parameters, and what the recorder makes of its speed."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import TruingError
from truing.model import kernel
from truing.model.excitation import Excitation

# Largest piece (s) where friction depends on speed; halving it moves no result of the tests by 1e-4 m/s.
MAX_STEP_S = 2.5e-3


@dataclass(frozen=True, slots=True)
class WheelPhysics:
    """A first-order wheel with delay and dry friction; the defaults leave all but the first two out.

    Attributes
    ----------
    gain_mps : steady speed per unit of effort beyond friction, forward, m/s.
    time_constant_s : forward, s.
    delay_s : pure delay from command to torque (or in measuring, which is not distinguishable), s.
    friction : running (Coulomb) friction, as the effort that balances it.
    breakaway_excess : how far breakaway friction lies above running friction, effort.
    stribeck_mps : speed over which the excess fades; 0: it acts at rest only.
    stribeck_shape : exponent of the fading, 1 or 2.
    drag : effort at 1 m/s that resists in proportion to speed squared.
    offset : effort that acts at all times (slope, driver offset).
    reverse_gain, reverse_time_constant, reverse_friction, reverse_excess : reverse over forward.
    lag_s : first-order lag ahead of the motor (driver filter, winding inductance), s.
    supply_share : share of the relative change of the supply that reaches the motor; 1 when effort
        is a duty cycle, 0 when the recorder gives effort as a voltage.
    recorder_lag_s : first-order filter between the wheel's speed and the reported one, s.
    recorder_window_s : the reported speed is a mean over this long, s; 0: over the interval.
    deadband : effort below which the driver gives nothing, and which it takes off above.
    """

    gain_mps: float
    time_constant_s: float
    delay_s: float = 0.0
    friction: float = 0.0
    breakaway_excess: float = 0.0
    stribeck_mps: float = 0.0
    stribeck_shape: float = 1.0
    drag: float = 0.0
    offset: float = 0.0
    reverse_gain: float = 1.0
    reverse_time_constant: float = 1.0
    reverse_friction: float = 1.0
    reverse_excess: float = 1.0
    lag_s: float = 0.0
    supply_share: float = 0.0
    recorder_lag_s: float = 0.0
    recorder_window_s: float = 0.0
    deadband: float = 0.0

    def to_vector(self) -> FloatArray:
        """Values in the order of the fields, shape (18,)."""
        return np.array([getattr(self, name) for name in PHYSICS_FIELDS], dtype=np.float64)

    @classmethod
    def from_vector(cls, values: FloatArray) -> WheelPhysics:
        """Inverse of `to_vector`."""
        return cls(*(float(value) for value in values))

    @classmethod
    def from_table(cls, table: dict[str, Any], where: str) -> WheelPhysics:
        """From one table of a TOML file; `where` names it in errors."""
        unknown = sorted(set(table) - set(PHYSICS_FIELDS))
        if unknown:
            raise TruingError(f"{where}: {unknown[0]!r} is not a parameter of a wheel")
        values: dict[str, float] = {}
        for name, value in table.items():
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
                raise TruingError(f"{where}: {name} must be a finite number, not {value!r}")
            values[name] = float(value)
        for name in ("gain_mps", "time_constant_s"):
            if name not in values:
                raise TruingError(f"{where}: {name} is missing")
        for name in ("time_constant_s", "reverse_time_constant"):
            if values.get(name, 1.0) <= 0.0:
                raise TruingError(f"{where}: {name} must be above zero")
        for name in ("delay_s", "friction", "breakaway_excess", "stribeck_mps", "lag_s", "deadband"):
            if values.get(name, 0.0) < 0.0:
                raise TruingError(f"{where}: {name} must not be below zero")
        return cls(**values)

    def to_table(self) -> dict[str, float]:
        """Every parameter that differs from its default, for one table of a TOML file."""
        return {
            item.name: getattr(self, item.name)
            for item in fields(self)
            if item.name in ("gain_mps", "time_constant_s") or getattr(self, item.name) != item.default
        }


PHYSICS_FIELDS: tuple[str, ...] = tuple(item.name for item in fields(WheelPhysics))
_INDEX = {name: position for position, name in enumerate(PHYSICS_FIELDS)}


def kernel_vector(values: FloatArray) -> FloatArray:
    """The kernel's parameter vector for values in the order of `PHYSICS_FIELDS`."""
    p = np.zeros(kernel.PARAMETER_COUNT)
    get = _INDEX

    def value(name: str) -> float:
        return float(values[get[name]])

    p[kernel.GAIN_FORWARD] = value("gain_mps")
    p[kernel.GAIN_REVERSE] = value("gain_mps") * value("reverse_gain")
    p[kernel.TAU_FORWARD] = value("time_constant_s")
    p[kernel.TAU_REVERSE] = value("time_constant_s") * value("reverse_time_constant")
    p[kernel.FRICTION_FORWARD] = value("friction")
    p[kernel.FRICTION_REVERSE] = value("friction") * value("reverse_friction")
    p[kernel.EXCESS_FORWARD] = value("breakaway_excess")
    p[kernel.EXCESS_REVERSE] = value("breakaway_excess") * value("reverse_excess")
    p[kernel.STRIBECK_MPS] = value("stribeck_mps")
    p[kernel.STRIBECK_SHAPE] = value("stribeck_shape")
    p[kernel.DRAG] = value("drag")
    p[kernel.OFFSET] = value("offset")
    p[kernel.DELAY_S] = value("delay_s")
    p[kernel.RECORDER_LAG_S] = value("recorder_lag_s")
    p[kernel.RECORDER_WINDOW_S] = value("recorder_window_s")
    p[kernel.SUPPLY_SHARE] = value("supply_share")
    p[kernel.LAG_S] = value("lag_s")
    p[kernel.DEADBAND] = value("deadband")
    return p


@dataclass(frozen=True, slots=True)
class Response:
    """A free-run simulation: `speed_mps` and `travel_m`, each of shape (n,).

    Travel counts from each segment's first row and is the wheel's own, without the recorder's filter.
    """

    speed_mps: FloatArray
    travel_m: FloatArray


def simulate_physics(
    values: FloatArray, excitation: Excitation, initial_mps: FloatArray, max_step_s: float = MAX_STEP_S
) -> Response:
    """Free-run simulation: efforts in, never a measured speed.

    Parameters
    ----------
    values : shape (18,), in the order of `PHYSICS_FIELDS`.
    initial_mps : shape (segments,), m/s, speed at the first row of every segment.
    """
    inputs = kernel.Inputs(
        excitation.t_s,
        excitation.starts,
        excitation.pieces.end_s,
        excitation.pieces.effort,
        excitation.pieces.supply,
        excitation.pieces.starts,
        excitation.interval_s,
        np.ascontiguousarray(initial_mps, dtype=np.float64),
    )
    outputs = kernel.new_outputs(len(excitation.t_s))
    kernel.rollout(kernel_vector(values), inputs, outputs, excitation.mean_over_interval, max_step_s)
    return Response(outputs.speed, outputs.travel)
