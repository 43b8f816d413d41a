"""The firmware core built for this machine, on a simulated robot: no chip is emulated."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hil_sim import native
from hil_sim.plant import PlantState, RobotParameters, params_of
from hil_sim.recorded import SAMPLE, Samples, steps_of
from hil_sim.robot import DEFAULT_BOARD_ID, VirtualRobotError
from hil_sim.simulated import Simulated
from hil_sim.unmodelled_effects import UnmodelledEffects

_BUFFER_SIZE = 65536


class HostRobot(Simulated):
    """A robot whose controller runs as this machine's code, hundreds of times faster than real time.

    The same face to the host as `VirtualRobot` has: virtual time, a link, a robot's truth.

    Parameters
    ----------
    robot : its numbers; the paper's robot when left out.
    seed : decides noise; the same seed gives the same run.
    effects : unmodelled effects, beyond `robot`.
    board_id : the controller's 12-byte unique id.
    phases_us : when the first tick comes, and how long after a tick its efforts reach the bridges;
        by default about as on the board.

    Raises
    ------
    VirtualRobotError : the robot's parameters or the effects are bad.
    OSError : the native library is not built.
    """

    def __init__(
        self,
        robot: RobotParameters | None = None,
        seed: int = 1,
        effects: UnmodelledEffects | None = None,
        board_id: bytes = DEFAULT_BOARD_ID,
        phases_us: tuple[float, float] | None = None,
    ) -> None:
        self._robot: int | None = None
        self._library = native.load(native.HOST_ROBOT_LIBRARY)
        self._buffer = ctypes.create_string_buffer(_BUFFER_SIZE)
        self.robot = robot or RobotParameters.msrp()
        problem = self.robot.problem()
        if problem is not None:
            raise VirtualRobotError(problem)
        parameters = ctypes.byref(params_of(self.robot))
        self._robot = self._library.host_robot_create(parameters, seed & (2**64 - 1), board_id)
        if self._robot is None:
            raise MemoryError("host_robot_create")
        if phases_us is not None:
            self._library.host_robot_set_phases(self._robot, *phases_us)
        self._plant: int = self._library.host_robot_plant(self._robot)
        self._samples: Samples = np.zeros(0, SAMPLE)
        if effects is not None:
            self.set_unmodelled_effects(effects)

    def close(self) -> None:
        """Free the robot; nothing may be called afterwards."""
        if self._robot is not None:
            self._library.host_robot_destroy(self._robot)
            self._robot = None

    @property
    def time_us(self) -> int:
        """Virtual time since creation, microseconds."""
        return int(self._library.host_robot_time_us(self._robot))

    def run_us(self, n: int) -> None:
        """Advance virtual time by `n` microseconds."""
        self._library.host_robot_run_us(self._robot, n)

    def link_write(self, data: bytes) -> None:
        """Send bytes to the controller; they are there at once."""
        self._library.host_robot_link_write(self._robot, bytes(data), len(data))

    def link_read(self) -> bytes:
        """Return the bytes that the controller has sent and that were not yet read."""
        received = b""
        while (n := int(self._library.host_robot_link_read(self._robot, self._buffer, _BUFFER_SIZE))) > 0:
            received += ctypes.string_at(self._buffer, n)
        return received

    def truth(self) -> PlantState:
        """Return the true state of the robot, which no sensor measures."""
        state = native.new(PlantState)
        self._library.plant_state(self._plant, ctypes.byref(state))
        return native.from_struct(PlantState, state)

    def set_unmodelled_effects(self, effects: UnmodelledEffects) -> None:
        """Give the robot these effects from now on."""
        wanted = native.to_struct(effects)
        if not self._library.plant_set_unmodelled_effects(self._plant, ctypes.byref(wanted)):
            problem = self._library.plant_unmodelled_effects_problem(ctypes.byref(wanted))
            raise VirtualRobotError(problem.decode())

    def place(self, x_m: float, y_m: float, theta_rad: float) -> None:
        """Move the robot to another pose."""
        self._library.plant_place(self._plant, x_m, y_m, theta_rad)

    def hold_wheel(self, wheel: int, torque_nm: float) -> None:
        """Hold a wheel with dry friction at its axle, as a hand does; 0 lets go."""
        self._library.plant_hold_wheel(self._plant, wheel, torque_nm)

    def record(self, longest_s: float, interval_s: float = 1e-3) -> None:
        """Record the robot's true state from now on, for at most this long."""
        self._samples = np.zeros(round(longest_s / interval_s) + 2, SAMPLE)
        self._library.plant_record(
            self._plant, self._samples.ctypes.data, self._samples.size, steps_of(interval_s)
        )

    def recorded(self) -> Samples:
        """Return the samples recorded since `record`."""
        return self._samples[: int(self._library.plant_recorded(self._plant))]


DRIVE_LATE_S = 0.00065
"""A command of one millisecond of `HostRobot` reaches the bridges this long after the plant's millisecond."""


HOLDING_NM = 100.0
"""More than any wheel's torque here."""


@dataclass(frozen=True)
class Placing:
    """A robot moved to a pose and held there until it is released; times since its creation."""

    at_s: float
    release_s: float
    x_m: float
    y_m: float
    theta_rad: float


def replay(
    robot: RobotParameters,
    effects: UnmodelledEffects,
    asked: npt.NDArray[np.float64],
    seed: int = 1,
    placings: Sequence[Placing] = (),
) -> Samples:
    """Drive a robot without its controller, with efforts recorded every millisecond.

    Parameters
    ----------
    asked : shape (n, 2), `asked` of the samples, the first one millisecond after creation.
    placings : in order of time.

    Returns
    -------
    shape (n,), every millisecond.
    """
    library = native.load(native.HOST_ROBOT_LIBRARY)
    samples = np.zeros(len(asked), SAMPLE)
    asked = np.ascontiguousarray(asked, dtype=np.float64)
    plant = library.plant_create(ctypes.byref(params_of(robot)), seed & (2**64 - 1))
    if plant is None:
        raise VirtualRobotError(robot.problem() or "no memory")
    done = 0

    def drive_until(time_s: float) -> None:
        nonlocal done
        # The first part of each command's millisecond still has the command before.
        end = min(max(round((time_s - DRIVE_LATE_S) * 1000), done), len(asked))
        library.plant_replay(plant, asked[done:end].ctypes.data, end - done, steps_of(1e-3))
        done = end

    try:
        wanted = native.to_struct(effects)
        if not library.plant_set_unmodelled_effects(plant, ctypes.byref(wanted)):
            raise VirtualRobotError(library.plant_unmodelled_effects_problem(ctypes.byref(wanted)).decode())
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
