"""The view's shared state: one board, one world, one driver, common to all pages."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

from truing.board.connect import open_stream
from truing.board.device import Device
from truing.errors import TruingError
from truing.link.client import Client, Timing
from truing.virtual.options import VirtualOptions
from truing.web.access.driver_lock import DriverLock
from truing.web.models.error_model import Kind, ModelChoice, load_model
from truing.web.path.history import History
from truing.web.pose import Pose
from truing.web.process.diagnosis_job import DiagnosisJob
from truing.web.process.helper import HelperProcess
from truing.web.process.robot_side import RobotSide, served_robot
from truing.web.process.tuning_job import TuningJob
from truing.web.process.virtual_board import VirtualBoardProcess
from truing.web.process.wiring_job import WiringJob
from truing.web.worker.board_worker import BoardWorker
from truing.web.worker.source import POLL_HZ, open_source
from truing.web.worker.state import RunRequest
from truing.web.world.sensing import Sensing
from truing.web.world.world_map import FrozenWorld, WorldMap
from truing.workspace import out_folder, recording_folder

# A page reports a lost link after this time; requests are repeated several times within it.
_PATIENCE_S = 1.5
# The paper's experiment starts at (0.5, 0.5, 45 degrees); the view's own at the origin, heading along x.
_START = Pose()


StopState: TypeAlias = Literal["none", "pending", "stopped"]


@dataclass(frozen=True, slots=True)
class ViewOptions:
    """Options from the command line."""

    port: str = "sim"
    virtual: VirtualOptions = field(default_factory=VirtualOptions)
    folder: Path | None = None
    rate_hz: float = POLL_HZ


class ViewSession:
    """Everything that the pages share; knows nothing of the pages themselves.

    Attributes
    ----------
    virtual : the robot of a virtual board, this view's own or a served one; None for a real robot.
    stops : how often a user has pressed STOP, on any page.
    """

    def __init__(self, options: ViewOptions) -> None:
        self.options = options
        self._own_board = VirtualBoardProcess(options.virtual) if options.port == "sim" else None
        self.port = options.port if self._own_board is None else self._own_board.port
        self.virtual: RobotSide | None = self._own_board
        self.lock = DriverLock(self._driver_released)
        self.worker = BoardWorker(
            self._connect,
            _START,
            source=lambda device: open_source(device, options.rate_hz),
            each_step=self._each_step,
        )
        self.world = _default_world()
        self.world_history: History[FrozenWorld] = History()
        self.sensing = Sensing(self.world, self.poses)
        self.sensing.warm_up()
        self.speed_fraction = 0.4
        self._keys_blocked = False
        self._latched_stop = 0
        self.stops = 0
        self._walls: tuple[int, Pose | None] | None = None
        self.start_pose = _START
        self.truth_base: Pose | None = None
        self.model = load_model(self.model_file) or ModelChoice()
        self.comparison_start = _START
        self.simulation = HelperProcess("truing.web.process.simulation_main")
        self.diagnosis = DiagnosisJob(self.diagnosis_folder)
        self.tuning = TuningJob(self.worker, self.simulation)
        self.wiring = WiringJob(self.worker, lambda: self.virtual)

    def start(self) -> None:
        """Start to connect and to scan."""
        self.worker.start()
        self.sensing.start()

    def close(self) -> None:
        """Stop the wheels, then everything else."""
        self.tuning.close()
        self.worker.close()
        self.sensing.close()
        self.simulation.close()
        self.diagnosis.close()
        if self.virtual is not None:
            self.virtual.close()

    # ---- pose

    def odometry_pose(self) -> Pose | None:
        """The odometry pose in the world."""
        latest = self.worker.history.latest()
        return None if latest is None else latest.pose

    def corrected_pose(self) -> Pose | None:
        """The true pose of a virtual robot; for a real one, the odometry pose."""
        truth = None if self.virtual is None else self.virtual.truth
        if truth is None:
            return self.odometry_pose()
        if self.truth_base is None:
            self.truth_base = self.start_pose.compose(truth.inverse())
        return self.truth_base.compose(truth)

    def poses(self) -> tuple[Pose, Pose] | None:
        """Odometry and corrected pose."""
        odometry, corrected = self.odometry_pose(), self.corrected_pose()
        return None if odometry is None or corrected is None else (odometry, corrected)

    def place(self, pose: Pose) -> None:
        """Set the robot's pose: odometry and true pose both continue from there."""
        self.start_pose, self.truth_base = pose, None
        self.worker.place(pose)

    # ---- driving

    def drive_keys(self, session: str, keys: tuple[str, ...]) -> bool:
        """Drive by the held keys; False when this session is not in control."""
        if not self.lock.holds(session):
            return False
        self.lock.refresh(session)
        if not keys:
            self._keys_blocked = False
        elif self._keys_blocked:
            keys = ()
        else:
            self._latched_stop = 0
        limits = self.worker.limits
        forward = ("forward" in keys) - ("back" in keys)
        left = ("left" in keys) - ("right" in keys)
        v, omega = (
            forward * self.speed_fraction * limits.speed_mps,
            left * self.speed_fraction * limits.yaw_rate_radps,
        )
        wheel_speed = abs(v) + 0.5 * limits.wheelbase_m * abs(omega)
        scale = min(1.0, limits.wheel_mps / wheel_speed) if wheel_speed else 1.0
        self.worker.drive(v * scale, omega * scale)
        return True

    def claim(self, session: str) -> bool:
        """Take control if it is free."""
        if self.lock.session is None:
            self._keys_blocked = False
        return self.lock.claim(session)

    def stop(self) -> int:
        """Brake now, for any page; a key still held has no effect until it is released.

        Returns the number of the stop: it is delivered when `worker.stop_acknowledged` has reached it.
        """
        self._keys_blocked = True
        self.stops += 1
        self._latched_stop = self.worker.stop()
        return self._latched_stop

    @property
    def stop_state(self) -> StopState:
        """The last stop by a user; it stays `stopped` until someone drives again."""
        if not self._latched_stop:
            return "none"
        return "stopped" if self.worker.stop_acknowledged >= self._latched_stop else "pending"

    def change_speed(self, session: str, faster: bool) -> None:
        """Change the speed by one step."""
        if self.lock.holds(session):
            self.speed_fraction = min(
                1.0, max(0.1, round(self.speed_fraction + (0.1 if faster else -0.1), 1))
            )

    def run(self, session: str, request: RunRequest) -> None:
        """Drive a plan.

        Raises
        ------
        TruingError : another page drives, or the board is busy or not connected.
        """
        if not self.claim(session):
            raise TruingError("another page drives this robot", "wait until it releases control")
        if self.virtual is not None:
            # In the run's metadata it says that the run is a virtual robot's, and which.
            request = replace(request, seed=self.virtual.seed)
        self.worker.run_plan(request)
        self._latched_stop = 0

    def _driver_released(self, _session: str) -> None:
        self.worker.stop("stopped: the driving page released control, was closed, or timed out")

    def _each_step(self) -> None:
        """In the board's thread, many times a second."""
        self.lock.expire()
        if self.virtual is None or self.virtual.truth is None:
            return
        self.corrected_pose()  # determines where the robot's own coordinates begin
        known = (self.world.version, self.truth_base)
        if known != self._walls and self.truth_base is not None:
            with self.sensing.world_lock:
                self.virtual.set_walls(self.world, self.truth_base)
            self._walls = known

    # ---- models

    def set_model(self, *, kind: Kind) -> None:
        """Select the active error model; its parameters are kept."""
        self.model = replace(self.model, kind=kind)

    # ---- files

    @property
    def run_folder(self) -> Path:
        """Folder for recorded runs."""
        if self.options.folder is not None:
            return self.options.folder
        info = self.worker.snapshot.info
        virtual = self.virtual is not None or info is None
        return recording_folder(None if virtual or info is None else info.board_id)

    def own_set(self, path: Path) -> Path:
        """A set's folder, if runs of this board may be added to it.

        Raises
        ------
        TruingError : its runs are another robot's.
        """
        own = (self.run_folder.parent.resolve(), out_folder().resolve())
        if not any(path.resolve().is_relative_to(folder) for folder in own):
            raise TruingError(
                f"{path.name}: these runs are from another robot; nothing is added to them",
                "choose a set that was recorded with this board",
            )
        return path

    @property
    def sequence_folder(self) -> Path:
        """Folder for sequences."""
        return out_folder() / "sequences"

    @property
    def map_folder(self) -> Path:
        """Folder for maps."""
        return out_folder() / "maps"

    @property
    def model_folder(self) -> Path:
        """Folder for models."""
        return out_folder() / "models"

    @property
    def model_file(self) -> Path:
        """File of the robot's model."""
        return self.model_folder / "robot.toml"

    @property
    def parameter_folder(self) -> Path:
        """Folder for copies of the board's parameters."""
        return out_folder() / "parameters"

    @property
    def diagnosis_folder(self) -> Path:
        """Folder for diagnoses."""
        return out_folder() / "diagnoses"

    @property
    def dropped_folder(self) -> Path:
        """Folder for files dropped onto a page."""
        return out_folder() / "dropped"

    async def take_file(self, query: dict[str, str], part: Path) -> dict[str, Any]:
        """Check a file dropped onto a page and put it where it belongs; its path, a question, or the error.

        In a process that ends afterwards: reading a long recording takes much memory for a moment.
        """
        helper = HelperProcess("truing.web.process.arrival_main")
        name = query.get("name", "")
        request = {
            "name": name,
            "query": query,
            "part": str(part),
            "dropped": str(self.dropped_folder),
            "diagnoses": str(self.diagnosis_folder),
        }
        try:
            return await helper.ask(request)
        except TruingError as error:
            return {"error": f"{name}: {error.message}"}
        finally:
            await asyncio.to_thread(helper.close)

    def _connect(self) -> Device:
        stream = open_stream(self.port, self.options.virtual)
        client = Client(stream, timing=Timing(patience_s=_PATIENCE_S))
        try:
            device = Device(client)
        except BaseException:
            client.close()
            raise
        self._meet_robot()
        return device

    def _meet_robot(self) -> None:
        """Find out whether a virtual robot is behind the port; one that was started anew is another one."""
        if self.virtual is not None and self.virtual.is_open:
            return
        if self.virtual is not None:
            self.virtual.close()
        self.virtual = served_robot(self.port)
        self.truth_base = self._walls = None


def _default_world() -> WorldMap:
    """A room with a few obstacles, so that the sensors have something to detect."""
    world = WorldMap.empty(8.0, 8.0)
    world.paint_room((-3.5, -3.0), (3.5, 3.0), 0.05)
    world.paint_stroke([(1.5, -3.0), (1.5, -1.2)], 0.05, True)
    world.paint_stroke([(-1.5, 1.0), (-1.5, 1.6), (-0.9, 1.6)], 0.05, True)
    world.paint_stroke([(2.4, 1.4)], 0.4, True)
    return world
