"""The simulated robot without a board: parameters, terminals and true state, from the C library."""

from __future__ import annotations

import ctypes
import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil_sim import native

STEP_S = native.HEADERS.constants["PLANT_STEP_US"] / 1e6
"""One step of the plant and one PWM period, s."""


class PlantError(ValueError):
    """A robot that cannot be built from these parameters, or a plant library that is not there."""


@dataclass(frozen=True)
class MotorParameters:
    """A brushed motor and its gearbox; quantities at the motor's own shaft."""

    resistance_ohm: float
    inductance_h: float
    emf_v_per_radps: float
    rotor_inertia_kgm2: float
    gear_ratio: float


@dataclass(frozen=True)
class FrictionParameters:
    """Friction of motor, gearbox and rolling tyre, as torque at the wheel."""

    coulomb_nm: float
    breakaway_nm: float
    stribeck_radps: float
    viscous_nms_per_rad: float


@dataclass(frozen=True)
class EncoderParameters:
    """Quadrature counts (x4) per wheel turn and the largest misplacement of an edge, counts."""

    counts_per_rev: float
    edge_error_count: float


@native.mirror("plant_wheel_params")
@dataclass(frozen=True)
class WheelParameters:
    """One driven wheel with all that turns with it."""

    radius_m: float
    inertia_kgm2: float
    motor: MotorParameters
    friction: FrictionParameters
    encoder: EncoderParameters


@native.mirror("plant_chassis_params")
@dataclass(frozen=True)
class ChassisParameters:
    """The body between the wheels and the ground's resistance to turning."""

    mass_kg: float
    yaw_inertia_kgm2: float
    wheelbase_m: float
    scrub_nm: float
    scrub_curvature_per_m: float


@native.mirror("plant_battery_params")
@dataclass(frozen=True)
class BatteryParameters:
    """Open-circuit voltage over charge, resistance, the electronics' current, the sense line's noise."""

    full_v: float
    empty_v: float
    capacity_ah: float
    initial_charge: float
    resistance_ohm: float
    electronics_a: float
    sense_noise_v: float


@native.mirror("plant_bridge_params")
@dataclass(frozen=True)
class BridgeParameters:
    """Drop of each of the two diodes that carry the current when both inputs are low."""

    diode_drop_v: float


@dataclass(frozen=True)
class RobotParameters:
    """All parameters of one robot, in SI units: `struct plant_params`, its wheels as left and right."""

    left: WheelParameters
    right: WheelParameters
    chassis: ChassisParameters
    battery: BatteryParameters
    bridge: BridgeParameters

    @staticmethod
    def msrp(library: Path | None = None) -> RobotParameters:
        """The robot of Bakirci 2023 as the C library has it."""
        params = _Params()
        load_library(library).plant_params_msrp(ctypes.byref(params))
        return _robot_of(params)

    def problem(self, library: Path | None = None) -> str | None:
        """A description of the first invalid parameter, or None."""
        text = load_library(library).plant_params_problem(ctypes.byref(params_of(self)))
        if text is None:
            return None
        assert isinstance(text, bytes)
        return text.decode().replace("wheel[0].", "left.").replace("wheel[1].", "right.")

    def changed(self, **values: float) -> RobotParameters:
        """A copy with some values changed, named by path with `__` for each dot.

        Examples
        --------
        >>> robot.changed(chassis__mass_kg=6.0, left__friction__coulomb_nm=0.02)
        """
        robot: Any = self
        for path, value in values.items():
            robot = _changed(robot, path.split("__"), value)
        assert isinstance(robot, RobotParameters)
        return robot


def _changed(node: Any, path: list[str], value: float) -> Any:
    name, *rest = path
    if name not in {field.name for field in dataclasses.fields(node)}:
        raise PlantError(f"{type(node).__name__} has no {name}")
    inner = _changed(getattr(node, name), rest, value) if rest else value
    return dataclasses.replace(node, **{name: inner})


@native.mirror("plant_state")
@dataclass(frozen=True)
class PlantState:
    """The true state, which no sensor of the robot measures; pairs are (left, right)."""

    steps: int
    time_s: float
    wheel_angle_rad: tuple[float, float]
    wheel_speed_radps: tuple[float, float]
    motor_current_a: tuple[float, float]
    x_m: float
    y_m: float
    theta_rad: float
    speed_mps: float
    yaw_rate_radps: float
    battery_open_v: float
    battery_v: float
    battery_current_a: float
    battery_charge: float
    kinetic_energy_j: float
    magnetic_energy_j: float


_Params = native.HEADERS.structs["plant_params"]
_SHARED = {
    "chassis": ChassisParameters,
    "battery": BatteryParameters,
    "bridge": BridgeParameters,
}


def _robot_of(params: Any) -> RobotParameters:
    left, right = (native.from_struct(WheelParameters, wheel) for wheel in params.wheel)
    shared: dict[str, Any] = {
        name: native.from_struct(kind, getattr(params, name)) for name, kind in _SHARED.items()
    }
    return RobotParameters(left, right, **shared)


def params_of(robot: RobotParameters) -> ctypes.Structure:
    """`struct plant_params`, to be passed by reference."""
    params: Any = _Params()
    for wheel, values in zip(params.wheel, (robot.left, robot.right), strict=True):
        native.fill(wheel, values)
    for name in _SHARED:
        native.fill(getattr(params, name), getattr(robot, name))
    made: ctypes.Structure = params
    return made


def load_library(path: Path | None = None) -> ctypes.CDLL:
    """The library with the plant, its functions declared; `native.LIBRARY` unless another is named.

    Raises
    ------
    PlantError : it is not there.
    """
    path = path or native.LIBRARY
    try:
        return native.load(path)
    except OSError as error:
        raise PlantError(f"no plant library at {path} ({error}); ./run setup builds it") from error


class Plant:
    """One robot on the ground, driven at its bridges' inputs.

    Parameters
    ----------
    robot
        Its numbers; the paper's robot when left out.
    seed
        Decides where the encoders' edges are misplaced and the noise of the sensed voltage.
    library
        Another build of the plant than `native.LIBRARY`.
    """

    def __init__(
        self, robot: RobotParameters | None = None, seed: int = 1, library: Path | None = None
    ) -> None:
        self._handle: int | None = None
        self._library = load_library(library)
        self.robot = robot or RobotParameters.msrp(library)
        problem = self.robot.problem(library)
        if problem is not None:
            raise PlantError(problem)
        self._handle = self._library.plant_create(ctypes.byref(params_of(self.robot)), seed)
        if self._handle is None:
            raise MemoryError("plant_create")

    def __del__(self) -> None:
        if self._handle is not None:
            self._library.plant_destroy(self._handle)
            self._handle = None

    def set_bridge(self, wheel: int, in1_duty: float, in2_duty: float) -> None:
        """Set the fraction of the PWM period for which each input is high; wheel 0 is the left one."""
        self._library.plant_set_bridge(self._handle, wheel, in1_duty, in2_duty)

    def drive(self, left_effort: float, right_effort: float) -> None:
        """Drive and brake in turn (slow decay), effort -1..1 of the supply; 0 brakes."""
        for wheel, effort in enumerate((left_effort, right_effort)):
            low = 1.0 - abs(effort)
            self.set_bridge(wheel, *((1.0, low) if effort >= 0.0 else (low, 1.0)))

    def advance(self, steps: int) -> None:
        """Advance by steps of `STEP_S`."""
        self._library.plant_advance(self._handle, steps)

    def advance_s(self, duration_s: float) -> None:
        """Advance by a duration, rounded to whole steps of `STEP_S`."""
        self.advance(round(duration_s / STEP_S))

    def encoder(self, wheel: int) -> int:
        """Quadrature counts (x4) since the start, with the sensor's errors."""
        return int(self._library.plant_encoder_position(self._handle, wheel))

    def battery_v(self) -> float:
        """Terminal voltage with the sense line's noise, V."""
        return float(self._library.plant_battery_v(self._handle))

    def state(self) -> PlantState:
        """Return the true state."""
        state = native.new(PlantState)
        self._library.plant_state(self._handle, ctypes.byref(state))
        return native.from_struct(PlantState, state)
