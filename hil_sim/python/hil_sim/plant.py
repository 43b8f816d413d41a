"""The simulated robot without a board: its numbers, its terminals and its truth, from the C library."""

from __future__ import annotations

import ctypes
import dataclasses
import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

STEP_S = 50e-6
"""One step of the plant and one PWM period, s (PLANT_STEP_US of plant.h)."""

LIBRARY = Path(__file__).resolve().parents[3] / "build" / "host" / "hil_sim" / "libhil_sim.so"
"""Where the build puts the plant; see `load_library`."""


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


@dataclass(frozen=True)
class WheelParameters:
    """One driven wheel with all that turns with it."""

    radius_m: float
    inertia_kgm2: float
    motor: MotorParameters
    friction: FrictionParameters
    encoder: EncoderParameters


@dataclass(frozen=True)
class ChassisParameters:
    """The body between the wheels and what the ground does to it when it turns."""

    mass_kg: float
    yaw_inertia_kgm2: float
    wheelbase_m: float
    scrub_nm: float
    scrub_curvature_per_m: float


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


@dataclass(frozen=True)
class BridgeParameters:
    """Drop of each of the two diodes that carry the current when both inputs are low."""

    diode_drop_v: float


@dataclass(frozen=True)
class RobotParameters:
    """Everything that makes one robot, in SI units: `struct plant_params` of plant.h, name by name."""

    left: WheelParameters
    right: WheelParameters
    chassis: ChassisParameters
    battery: BatteryParameters
    bridge: BridgeParameters

    @staticmethod
    def msrp(library: Path | None = None) -> RobotParameters:
        """The robot of Bakirci 2023 as the C library has it."""
        native = _Params()
        load_library(library).plant_params_msrp(ctypes.byref(native))
        robot = _from_native(RobotParameters, native)
        assert isinstance(robot, RobotParameters)
        return robot

    def problem(self, library: Path | None = None) -> str | None:
        """What is wrong with the first parameter at fault, or None."""
        text = load_library(library).plant_params_problem(ctypes.byref(to_native(self)))
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


@dataclass(frozen=True)
class PlantState:
    """The truth, which no sensor of the robot sees; pairs are (left, right)."""

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


def _native_of(kind: Any) -> type[ctypes.Structure]:
    """The C struct of a dataclass: the same names in the same order."""
    types = {"float": ctypes.c_double, "int": ctypes.c_uint64, "tuple[float, float]": ctypes.c_double * 2}
    fields: list[tuple[str, Any]] = [
        (field.name, types.get(str(field.type)) or _native_of(globals()[str(field.type)]))
        for field in dataclasses.fields(kind)
    ]
    return type(f"_{kind.__name__}", (ctypes.Structure,), {"_fields_": fields})


# plant.h has wheel[2] where RobotParameters has left and right: the same bytes.
_Params = _native_of(RobotParameters)
_State = _native_of(PlantState)


def _from_native(kind: Any, native: ctypes.Structure) -> Any:
    values: dict[str, Any] = {}
    for field in dataclasses.fields(kind):
        value = getattr(native, field.name)
        if isinstance(value, ctypes.Structure):
            value = _from_native(globals()[str(field.type)], value)
        elif isinstance(value, ctypes.Array):
            value = tuple(value)
        values[field.name] = value
    return kind(**values)


def to_native(robot: RobotParameters) -> ctypes.Structure:
    """`struct plant_params`, to be passed by reference."""
    native = _Params()
    _fill(native, robot)
    return native


def _fill(native: ctypes.Structure, values: Any) -> None:
    for field in dataclasses.fields(values):
        value = getattr(values, field.name)
        if dataclasses.is_dataclass(value):
            _fill(getattr(native, field.name), value)
        else:
            setattr(native, field.name, value)


def state_from_native(native: ctypes.Structure) -> PlantState:
    """A `PlantState` from what `plant_state` filled."""
    state = _from_native(PlantState, native)
    assert isinstance(state, PlantState)
    return state


def new_native_state() -> ctypes.Structure:
    """An empty `struct plant_state`, to be passed by reference."""
    return _State()


def load_library(path: Path | None = None) -> ctypes.CDLL:
    """The library with the plant, its functions declared; `LIBRARY` unless another is named."""
    return _load(str(path or LIBRARY))


@functools.cache
def _load(path: str) -> ctypes.CDLL:
    try:
        library = ctypes.CDLL(path)
    except OSError as error:
        raise PlantError(f"no plant library at {path} ({error}); ./run setup builds it") from error
    pointer = ctypes.c_void_p
    signatures: dict[str, tuple[Any, list[Any]]] = {
        "plant_params_msrp": (None, [pointer]),
        "plant_params_problem": (ctypes.c_char_p, [pointer]),
        "plant_create": (pointer, [pointer, ctypes.c_uint64]),
        "plant_destroy": (None, [pointer]),
        "plant_set_bridge": (None, [pointer, ctypes.c_int, ctypes.c_double, ctypes.c_double]),
        "plant_advance": (None, [pointer, ctypes.c_uint64]),
        "plant_encoder_position": (ctypes.c_int64, [pointer, ctypes.c_int]),
        "plant_battery_v": (ctypes.c_double, [pointer]),
        "plant_state": (None, [pointer, pointer]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments
    return library


class Plant:
    """One robot on the ground, driven at its bridges' inputs.

    Parameters
    ----------
    robot
        Its numbers; the paper's robot when left out.
    seed
        Decides where the encoders' edges are misplaced and the noise of the sensed voltage.
    library
        Another build of the plant than `LIBRARY`.
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
        self._handle = self._library.plant_create(ctypes.byref(to_native(self.robot)), seed)
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
        """Quadrature counts (x4) since the start: the sensor, not the truth."""
        return int(self._library.plant_encoder_position(self._handle, wheel))

    def battery_v(self) -> float:
        """Terminal voltage with the sense line's noise, V."""
        return float(self._library.plant_battery_v(self._handle))

    def state(self) -> PlantState:
        """Return the truth."""
        native = new_native_state()
        self._library.plant_state(self._handle, ctypes.byref(native))
        return state_from_native(native)
