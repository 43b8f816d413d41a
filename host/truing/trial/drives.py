"""Drives a trial's plans on a robot and brings its logs down the link, whichever robot it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from hil_sim.host_robot import HOLDING_NM, HostRobot, Placing
from hil_sim.recorded import Samples
from truing.arrays import FloatArray
from truing.board.device import Device, UploadedSequence
from truing.board.drive import board_fault
from truing.board.run_saver import fetch_log
from truing.errors import Refused
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream
from truing.log.columns import run_from_records
from truing.plan import Kind, Plan
from truing.recording.run import Run
from truing.trial.robot import Robot

# Device time 0 is this long after the plant's creation (hil_sim/host_robot); the virtual board boots alike.
_DEVICE_ZERO_S = 0.0146 + 38.6e-6 - 0.001
_LONGEST_PAUSE_S = 4.0
_HELD_US = 400_000
_MAX_HOLDS = 6
_AFTER_US = 50_000
# Until the supply has been measured a board does not start.
_SETTLING_US = 50_000


class SimulatedRobot(Protocol):
    """What `HostRobot` and `VirtualRobot` have in common."""

    @property
    def time_s(self) -> float: ...
    def run_us(self, n: int) -> None: ...
    def link_write(self, data: bytes) -> None: ...
    def link_read(self) -> bytes: ...
    def place(self, x_m: float, y_m: float, theta_rad: float) -> None: ...
    def hold_wheel(self, wheel: int, torque_nm: float) -> None: ...
    def record(self, longest_s: float, interval_s: float = 1e-3) -> None: ...
    def recorded(self) -> Samples: ...
    def close(self) -> None: ...


@dataclass(frozen=True)
class DrivenRun:
    """One run: what the board logged, and since when on the plant's clock."""

    run: Run
    start_s: float

    @property
    def row_times_s(self) -> FloatArray:
        """Plant time of each row, shape (n,)."""
        return self.start_s + self.run.t_s


@dataclass(frozen=True)
class DrivenSet:
    """All runs of a trial, and the truth at every millisecond from the first to the last."""

    runs: tuple[DrivenRun, ...]
    samples: Samples
    placings: tuple[Placing, ...]

    @property
    def asked(self) -> FloatArray:
        """Effort asked of the bridges, shape (ms, 2)."""
        asked: FloatArray = self.samples["asked"].astype(np.float64)
        return asked


class TrialDrive:
    """A robot with somebody beside it who drives plan after plan and puts it back to its line in between.

    The board is told the robot's nominal numbers, and that its wheels are known to be sound: a trial's
    robot may stand under effort, and that is what is being looked for.
    """

    def __init__(self, robot: SimulatedRobot, spec: Robot, placing_seed: int, longest_s: float) -> None:
        self._robot = robot
        self._spec = spec
        self._rng = np.random.default_rng([placing_seed, 0x706C61])
        self._runs: list[DrivenRun] = []
        self._placings: list[Placing] = []
        self._told: dict[str, float] = {}
        robot.record(longest_s)
        robot.run_us(_SETTLING_US)
        self._device = Device(Client(VirtualStream(robot)))
        self._device.arm()

    def drive(self, plan: Plan) -> DrivenRun:
        """Drive one more plan.

        Raises
        ------
        BoardFault : the board stopped.
        """
        velocity = any(segment.kind is not Kind.EFFORT for segment in plan.segments)
        for name, value in _settings(self._spec, velocity=velocity).items():
            if self._told.get(name) != value:
                self._device.set_parameter(name, value)
                self._told[name] = value
        number = len(self._runs) + 1
        run, placing = _one_run(self._robot, self._device, plan, number, self._rng)
        self._runs.append(run)
        self._placings.append(placing)
        return run

    def so_far(self) -> DrivenSet:
        """All runs until now."""
        return DrivenSet(tuple(self._runs), self._robot.recorded().copy(), tuple(self._placings))

    def close(self) -> None:
        """Put the robot away."""
        self._device.close()
        self._robot.close()


def longest_drive_s(plans: Sequence[Plan], more_s: float = 0.0) -> float:
    """Time to record for these plans, and for others of `more_s` in all."""
    return sum(plan.duration_s + _LONGEST_PAUSE_S for plan in plans) + more_s + 5.0


def drive_set(robot: SimulatedRobot, plans: Sequence[Plan], spec: Robot, placing_seed: int) -> DrivenSet:
    """Drive the plans one right after the other, and close the robot."""
    drive = TrialDrive(robot, spec, placing_seed, longest_drive_s(plans))
    try:
        for plan in plans:
            drive.drive(plan)
        return drive.so_far()
    finally:
        drive.close()


def _one_run(
    robot: SimulatedRobot, device: Device, plan: Plan, number: int, rng: np.random.Generator
) -> tuple[DrivenRun, Placing]:
    """Put the robot to the line, hold it, start, let go, fetch the log."""
    sequence = device.upload(plan)
    x_m, y_m, theta_rad = (float(x) for x in rng.normal(0.0, (0.002, 0.002, 0.005)))
    at_s = robot.time_s
    robot.place(x_m, y_m, theta_rad)
    for wheel in (0, 1):
        robot.hold_wheel(wheel, HOLDING_NM)
    log_id = _start_when_still(robot, device, sequence)
    release_s = robot.time_s
    for wheel in (0, 1):
        robot.hold_wheel(wheel, 0.0)
    robot.run_us(round(sequence.duration_s * 1e6) + _AFTER_US)
    status = device.status()
    if status.latched:
        raise board_fault(status)
    fetched = fetch_log(device, log_id)
    run = run_from_records(fetched.decoded.records, f"{number:02d}_{plan.name.replace('/', '_')}")
    placing = Placing(at_s, release_s, x_m, y_m, theta_rad)
    return DrivenRun(run, _DEVICE_ZERO_S + fetched.log.start_s), placing


def _start_when_still(robot: SimulatedRobot, device: Device, sequence: UploadedSequence) -> int:
    """Hold the wheels until the board finds them still, and start; returns the log's number."""
    for held in range(_MAX_HOLDS):
        robot.run_us(_HELD_US)
        try:
            return device.start(sequence, unattended=True)
        except Refused:
            if held == _MAX_HOLDS - 1:
                raise
    raise AssertionError  # the last refusal has been raised


def _settings(spec: Robot, *, velocity: bool) -> dict[str, float]:
    values: dict[str, float] = {
        "wheel_radius_m": spec.radius_m,
        "wheelbase_m": spec.wheelbase_m,
        "counts_per_rev": spec.counts_per_rev,
        "log_rate_hz": 20,
        "overspeed_mps": 50.0,
        "encoder_speed_max_mps": 50.0,
        "stall_effort": 1.0,
        "battery_low_v": 0.0,
        "battery_high_v": 60.0,
        "speed_limit_mps": 10.0,
    }
    for i, side in enumerate(("left", "right")):
        for way in ("", "_reverse"):
            values[f"ff_ks_{side}{way}"] = 0.0
            values[f"ff_kv_{side}{way}"] = 1.0 / spec.gain_mps[i]
            # So much inertia that the watch for reversed encoders never minds; velocity mode needs the truth.
            lag = spec.time_constant_s[i] / spec.gain_mps[i]
            values[f"ff_ka_{side}{way}"] = lag if velocity else 50.0
    return values


def host_robot(spec: Robot, seed: int) -> HostRobot:
    """A robot whose controller runs as this machine's code."""
    parameters, hidden = spec.build()
    return HostRobot(parameters, seed, hidden)


def board_robot(spec: Robot, seed: int) -> Any:
    """A robot whose controller is the flashed image on the virtual board."""
    from hil_sim import VirtualRobot
    from truing.workspace import image_path

    parameters, hidden = spec.build()
    robot = VirtualRobot(image_path(), robot=parameters, seed=seed)
    robot.set_unmodelled_effects(hidden)
    return robot
