"""The controller's core compiled for this machine, on a simulated robot: no chip is emulated."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt

from hil_sim.hidden import HiddenEffects, hidden_to_native
from hil_sim.plant import (
    LIBRARY,
    PlantState,
    RobotParameters,
    new_native_state,
    state_from_native,
    to_native,
)
from hil_sim.recorded import SAMPLE, Samples, steps_of
from hil_sim.robot import DEFAULT_BOARD_ID, VirtualRobotError

CORE_LIBRARY = LIBRARY.with_name("libhil_core.so")
"""Where the build puts it."""

_P, _U64, _SIZE, _BOOL = ctypes.c_void_p, ctypes.c_uint64, ctypes.c_size_t, ctypes.c_bool
_BUFFER_SIZE = 65536
_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "core_robot_create": (_P, [_P, _U64, ctypes.c_char_p]),
    "core_robot_set_phases": (None, [_P, ctypes.c_double, ctypes.c_double]),
    "core_robot_destroy": (None, [_P]),
    "core_robot_run_us": (None, [_P, _U64]),
    "core_robot_time_us": (_U64, [_P]),
    "core_robot_link_write": (None, [_P, ctypes.c_char_p, _SIZE]),
    "core_robot_link_read": (_SIZE, [_P, _P, _SIZE]),
    "core_robot_plant": (_P, [_P]),
    "plant_state": (None, [_P, _P]),
    "plant_hide": (_BOOL, [_P, _P]),
    "plant_hidden_problem": (ctypes.c_char_p, [_P]),
    "plant_hold_wheel": (None, [_P, ctypes.c_int, ctypes.c_double]),
    "plant_place": (None, [_P, ctypes.c_double, ctypes.c_double, ctypes.c_double]),
    "plant_record": (_BOOL, [_P, _P, _SIZE, _U64]),
    "plant_recorded": (_SIZE, [_P]),
    "plant_replay": (None, [_P, _P, _SIZE, _U64]),
    "plant_create": (_P, [_P, _U64]),
    "plant_destroy": (None, [_P]),
}


@functools.cache
def load_core(path: Path = CORE_LIBRARY) -> ctypes.CDLL:
    """Return the library with its functions declared.

    Raises
    ------
    OSError : the library is not built or cannot be loaded.
    """
    library = ctypes.CDLL(str(path))
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments
    return library


class CoreRobot:
    """A robot whose controller runs as this machine's code, hundreds of times faster than real time.

    The same face to the host as `VirtualRobot` has: virtual time, a link, a robot's truth.

    Parameters
    ----------
    robot : its numbers; the paper's robot when left out.
    seed : decides noise; the same seed gives the same run.
    hidden : effects beyond `robot`.
    board_id : the controller's 12-byte unique id.
    phases_us : when the first tick comes, and how long after a tick its efforts reach the bridges;
        by default about as on the board.

    Raises
    ------
    VirtualRobotError : the robot's parameters or the hidden effects are bad.
    OSError : the native library is not built.
    """

    def __init__(
        self,
        robot: RobotParameters | None = None,
        seed: int = 1,
        hidden: HiddenEffects | None = None,
        board_id: bytes = DEFAULT_BOARD_ID,
        phases_us: tuple[float, float] | None = None,
    ) -> None:
        self._robot: int | None = None
        self._library = load_core()
        self._buffer = ctypes.create_string_buffer(_BUFFER_SIZE)
        self.robot = robot or RobotParameters.msrp()
        problem = self.robot.problem()
        if problem is not None:
            raise VirtualRobotError(problem)
        parameters = ctypes.byref(to_native(self.robot))
        self._robot = self._library.core_robot_create(parameters, seed & (2**64 - 1), board_id)
        if self._robot is None:
            raise MemoryError("core_robot_create")
        if phases_us is not None:
            self._library.core_robot_set_phases(self._robot, *phases_us)
        self._plant: int = self._library.core_robot_plant(self._robot)
        self._samples: Samples = np.zeros(0, SAMPLE)
        if hidden is not None:
            self.hide(hidden)

    def close(self) -> None:
        """Free the robot; nothing may be called afterwards."""
        if self._robot is not None:
            self._library.core_robot_destroy(self._robot)
            self._robot = None

    def __enter__(self) -> CoreRobot:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()

    @property
    def time_us(self) -> int:
        """Virtual time since creation, microseconds."""
        return int(self._library.core_robot_time_us(self._robot))

    @property
    def time_s(self) -> float:
        """Virtual time since creation, seconds."""
        return self.time_us * 1e-6

    def run_us(self, n: int) -> None:
        """Advance virtual time by `n` microseconds."""
        self._library.core_robot_run_us(self._robot, n)

    def link_write(self, data: bytes) -> None:
        """Send bytes to the controller; they are there at once."""
        self._library.core_robot_link_write(self._robot, bytes(data), len(data))

    def link_read(self) -> bytes:
        """Return the bytes that the controller has sent and that were not yet read."""
        received = b""
        while (n := int(self._library.core_robot_link_read(self._robot, self._buffer, _BUFFER_SIZE))) > 0:
            received += ctypes.string_at(self._buffer, n)
        return received

    def truth(self) -> PlantState:
        """Return the true state of the robot, which no sensor sees."""
        state = new_native_state()
        self._library.plant_state(self._plant, ctypes.byref(state))
        return state_from_native(state)

    def hide(self, hidden: HiddenEffects) -> None:
        """Give the robot these effects from now on."""
        native = hidden_to_native(hidden)
        if not self._library.plant_hide(self._plant, ctypes.byref(native)):
            raise VirtualRobotError(self._library.plant_hidden_problem(ctypes.byref(native)).decode())

    def place(self, x_m: float, y_m: float, theta_rad: float) -> None:
        """Lift the robot and put it down elsewhere."""
        self._library.plant_place(self._plant, x_m, y_m, theta_rad)

    def hold_wheel(self, wheel: int, torque_nm: float) -> None:
        """Hold a wheel with dry friction at its axle, as a hand does; 0 lets go."""
        self._library.plant_hold_wheel(self._plant, wheel, torque_nm)

    def record(self, longest_s: float, interval_s: float = 1e-3) -> None:
        """Write down the robot's truth from now on, for so long at most."""
        self._samples = np.zeros(round(longest_s / interval_s) + 2, SAMPLE)
        self._library.plant_record(
            self._plant, self._samples.ctypes.data, self._samples.size, steps_of(interval_s)
        )

    def recorded(self) -> Samples:
        """Return what has been written down since `record`."""
        return self._samples[: int(self._library.plant_recorded(self._plant))]


DRIVE_LATE_S = 0.00065
"""A command of one millisecond of `CoreRobot` reaches the bridges this long after the plant's millisecond."""


HOLDING_NM = 100.0
"""More torque than any wheel here has."""


@dataclass(frozen=True)
class Placing:
    """A robot taken up, put down somewhere and held until it is let go; times since its creation."""

    at_s: float
    release_s: float
    x_m: float
    y_m: float
    theta_rad: float


def replay(
    robot: RobotParameters,
    hidden: HiddenEffects,
    asked: npt.NDArray[np.float64],
    seed: int = 1,
    placings: Sequence[Placing] = (),
) -> Samples:
    """Drive a robot without its controller, as one that was recorded every millisecond was driven.

    Parameters
    ----------
    asked : shape (n, 2), `asked` of the samples, the first one millisecond after creation.
    placings : in order of time.

    Returns
    -------
    shape (n,), every millisecond.
    """
    library = load_core()
    samples = np.zeros(len(asked), SAMPLE)
    asked = np.ascontiguousarray(asked, dtype=np.float64)
    plant = library.plant_create(ctypes.byref(to_native(robot)), seed & (2**64 - 1))
    if plant is None:
        raise VirtualRobotError(robot.problem() or "no memory")
    done = 0

    def drive_until(time_s: float) -> None:
        nonlocal done
        # The first stretch of each command's millisecond belongs to the one before.
        end = min(max(round((time_s - DRIVE_LATE_S) * 1000), done), len(asked))
        library.plant_replay(plant, asked[done:end].ctypes.data, end - done, steps_of(1e-3))
        done = end

    try:
        native = hidden_to_native(hidden)
        if not library.plant_hide(plant, ctypes.byref(native)):
            raise VirtualRobotError(library.plant_hidden_problem(ctypes.byref(native)).decode())
        library.plant_record(plant, samples.ctypes.data, samples.size, steps_of(1e-3))
        none = np.zeros((1, 2))
        library.plant_replay(plant, none.ctypes.data, 1, steps_of(DRIVE_LATE_S))
        for placing in placings:
            drive_until(placing.at_s)
            library.plant_place(plant, placing.x_m, placing.y_m, placing.theta_rad)
            for wheel in (0, 1):
                library.plant_hold_wheel(plant, wheel, HOLDING_NM)
            drive_until(placing.release_s)
            for wheel in (0, 1):
                library.plant_hold_wheel(plant, wheel, 0.0)
        drive_until(len(asked) * 1e-3 + 1.0)
    finally:
        library.plant_destroy(plant)
    return samples
