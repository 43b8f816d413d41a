"""The view's state: one board, one world, one driver; all pages look at the same."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from truing.device import Device
from truing.errors import TruingError
from truing.link.client import Client, Timing
from truing.link.connect import VirtualOptions, open_stream
from truing.web.board_worker import BoardWorker, RunOrder
from truing.web.diagnosis_job import DiagnosisJob
from truing.web.driver_lock import DriverLock
from truing.web.error_model import Kind, ModelChoice, load_model
from truing.web.live_source import POLL_HZ, open_source
from truing.web.pose import Pose
from truing.web.sensing import Sensing
from truing.web.side_process import SideProcess
from truing.web.virtual_process import VirtualProcess
from truing.web.world_map import WorldMap
from truing.workspace import out_folder, recording_folder

# A page shows a dead link after this long; requests are repeated several times within it.
_PATIENCE_S = 1.5
# The paper's experiment starts at (0.5, 0.5, 45 degrees); the view's own at the origin, heading along x.
_START = Pose()


@dataclass(frozen=True, slots=True)
class ViewOptions:
    """What the user chose on the command line."""

    port: str = "sim"
    virtual: VirtualOptions = field(default_factory=VirtualOptions)
    folder: Path | None = None
    rate_hz: float = POLL_HZ


class ViewSession:
    """Everything behind the pages, and nothing of them."""

    def __init__(self, options: ViewOptions) -> None:
        self.options = options
        self.virtual = VirtualProcess(options.virtual) if options.port == "sim" else None
        self.port = options.port if self.virtual is None else self.virtual.port
        self.lock = DriverLock(self._left_the_wheel)
        self.worker = BoardWorker(
            self._connect,
            _START,
            source=lambda device: open_source(device, options.rate_hz),
            each_step=self.lock.drop_silent,
        )
        self.world = _first_world()
        self.sensing = Sensing(self.world, self.poses)
        self.sensing.warm_up()
        self.share = 0.4
        self._stopped = False
        self.start_pose = _START
        self.truth_base: Pose | None = None
        self.model = load_model(self.model_file) or ModelChoice()
        self.comparison_start = _START
        self.simulation = SideProcess("truing.web.simulate_process")
        self.diagnosis = DiagnosisJob(self.diagnosis_folder)

    def start(self) -> None:
        """Begin to connect and to scan."""
        self.worker.start()
        self.sensing.start()

    def close(self) -> None:
        """Stop the wheels, then everything else."""
        self.worker.close()
        self.sensing.close()
        self.simulation.close()
        self.diagnosis.close()
        if self.virtual is not None:
            self.virtual.close()

    # ---- where the robot is

    def odometry_pose(self) -> Pose | None:
        """Where its own counting says it is, in the world."""
        latest = self.worker.history.latest()
        return None if latest is None else latest.pose

    def corrected_pose(self) -> Pose | None:
        """Where it truly is: the virtual robot's truth; on a real one, its odometry is all there is."""
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
        """Put the robot at a pose: both kinds of pose start from there."""
        self.start_pose, self.truth_base = pose, None
        self.worker.place(pose)

    # ---- driving

    def drive_keys(self, session: str, keys: tuple[str, ...]) -> bool:
        """Drive as the held keys say; False when another session has the wheel."""
        if not self.lock.holds(session):
            return False
        self.lock.heard(session)
        if not keys:
            self._stopped = False
        elif self._stopped:
            keys = ()
        limits = self.worker.limits
        ahead = ("forward" in keys) - ("back" in keys)
        aside = ("left" in keys) - ("right" in keys)
        v, omega = ahead * self.share * limits.speed_mps, aside * self.share * limits.turn_radps
        fastest = abs(v) + 0.5 * limits.wheelbase_m * abs(omega)
        shrink = min(1.0, limits.wheel_mps / fastest) if fastest else 1.0
        self.worker.drive(v * shrink, omega * shrink)
        return True

    def claim(self, session: str) -> bool:
        """Take the wheel when it is free."""
        if self.lock.session is None:
            self._stopped = False
        return self.lock.claim(session)

    def stop(self) -> None:
        """Brake now, whoever asks; a key that is still held moves nothing until it has been let go."""
        self._stopped = True
        self.worker.stop()

    def change_speed(self, session: str, faster: bool) -> None:
        """One step faster or slower."""
        if self.lock.holds(session):
            self.share = min(1.0, max(0.1, round(self.share + (0.1 if faster else -0.1), 1)))

    def run(self, session: str, order: RunOrder) -> None:
        """Drive a plan.

        Raises
        ------
        TruingError : somebody else drives, or the board is busy or not there.
        """
        if not self.claim(session):
            raise TruingError("somebody else drives this robot", "wait until they leave the wheel")
        self.worker.run_plan(order)

    def _left_the_wheel(self, _session: str) -> None:
        self.worker.stop("stopped: the page that drove has left the wheel, is gone, or is silent")

    # ---- models

    def set_model(self, *, kind: Kind) -> None:
        """Which error model is in force; its numbers stay."""
        self.model = replace(self.model, kind=kind)

    # ---- files

    @property
    def run_folder(self) -> Path:
        """Where runs go."""
        if self.options.folder is not None:
            return self.options.folder
        info = self.worker.snapshot.info
        virtual = self.virtual is not None or info is None
        return recording_folder(None if virtual or info is None else info.board_id)

    @property
    def sequence_folder(self) -> Path:
        """Where sequences go."""
        return out_folder() / "sequences"

    @property
    def map_folder(self) -> Path:
        """Where maps go."""
        return out_folder() / "maps"

    @property
    def model_folder(self) -> Path:
        """Where models go."""
        return out_folder() / "models"

    @property
    def model_file(self) -> Path:
        """The robot's own model."""
        return self.model_folder / "robot.toml"

    @property
    def diagnosis_folder(self) -> Path:
        """Where diagnoses go."""
        return out_folder() / "diagnoses"

    @property
    def dropped_folder(self) -> Path:
        """Where files that were dropped onto a page go."""
        return out_folder() / "dropped"

    def _connect(self) -> Device:
        stream = open_stream(self.port, self.options.virtual)
        client = Client(stream, timing=Timing(patience_s=_PATIENCE_S))
        try:
            return Device(client)
        except BaseException:
            client.close()
            raise


def _first_world() -> WorldMap:
    """A room with a few things in it, so that the sensors see something at once."""
    world = WorldMap.empty(8.0, 8.0)
    world.paint_room((-3.5, -3.0), (3.5, 3.0), 0.05)
    world.paint_stroke([(1.5, -3.0), (1.5, -1.2)], 0.05, True)
    world.paint_stroke([(-1.5, 1.0), (-1.5, 1.6), (-0.9, 1.6)], 0.05, True)
    world.paint_stroke([(2.4, 1.4)], 0.4, True)
    return world
