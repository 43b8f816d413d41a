"""The thread that simulates the range sensors at the robot's pose and builds the global maps."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.web.pose import Pose
from truing.web.world.occupancy import OccupancyGrid
from truing.web.world.range_sensors import RangeSensor, laser_scanner, sonar_ring
from truing.web.world.world_map import WorldMap

_EMPTY: FloatArray = np.zeros(0)


@dataclass(frozen=True, slots=True)
class Settings:
    """Sensor settings of the World page; see `sonar_ring` and `laser_scanner`."""

    sonar_on: bool = True
    sonar_count: int = 16
    sonar_cone_deg: float = 25.0
    sonar_range_m: float = 4.0
    laser_on: bool = True
    laser_fov_deg: float = 180.0
    laser_range_m: float = 8.0
    rate_hz: float = 10.0
    noise_m: float = 0.01
    seed: int = 1


@dataclass(frozen=True, slots=True)
class Scan:
    """Newest distances of both sensors (m, NaN without a return) and the pose of the measurement."""

    number: int
    pose: Pose
    sonar: FloatArray
    laser: FloatArray

    def to_json(self, sensors: tuple[RangeSensor, RangeSensor]) -> dict[str, Any]:
        """For the page: pose of the measurement, and distances in millimetres, null without a return."""
        sonar, laser = sensors
        return {
            "pose": self.pose.as_list(),
            "sonar": _millimetres(self.sonar),
            "sonar_cone": sonar.cone_rad,
            "sonar_mount": sonar.mount_m,
            "laser": _millimetres(self.laser),
            "laser_from": float(laser.angles_rad[0]),
            "laser_step": float(laser.angles_rad[1] - laser.angles_rad[0]),
        }


class Sensing:
    """Simulated sensors on the robot, in a world that can be edited while they run.

    Two global maps are built from the same scans: one placed by odometry alone, one by the corrected
    pose. Their difference shows the odometry drift.

    Parameters
    ----------
    poses : the robot's odometry pose and its corrected one, in the world; None while unknown.
    """

    def __init__(self, world: WorldMap, poses: Callable[[], tuple[Pose, Pose] | None]) -> None:
        self.world = world
        self.world_lock = threading.Lock()
        self.settings = Settings()
        self._poses = poses
        self._sensors = (sonar_ring(), laser_scanner())
        self.odometry_map = OccupancyGrid(world.size_m, world.resolution_m, world.origin_m)
        self.corrected_map = OccupancyGrid(world.size_m, world.resolution_m, world.origin_m)
        self._scan = Scan(0, Pose(), _EMPTY, _EMPTY)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="sensors", daemon=True)

    @property
    def scan(self) -> Scan:
        """The newest scan."""
        return self._scan

    @property
    def sensors(self) -> tuple[RangeSensor, RangeSensor]:
        """Sonar ring and laser as configured."""
        return self._sensors

    def warm_up(self) -> None:
        """Compile in advance: compiling blocks every thread, including the board's."""
        grid = OccupancyGrid((1.0, 1.0), 0.1, (0.0, 0.0))
        for sensor in self._sensors:
            grid.add(sensor, Pose(), sensor.scan(self.world, Pose(), 0))

    def start(self) -> None:
        """Start to scan."""
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(2.0)

    def configure(self, **changes: Any) -> None:
        """Change settings, effective from the next scan."""
        new = replace(self.settings, **changes)
        sonar = sonar_ring(
            max(1, int(new.sonar_count)),
            cone_deg=new.sonar_cone_deg,
            max_range_m=new.sonar_range_m,
            noise_m=new.noise_m,
            rate_hz=new.rate_hz,
            seed=new.seed,
        )
        beams = max(2, round(new.laser_fov_deg) + 1)
        laser = laser_scanner(
            beams,
            field_of_view_deg=new.laser_fov_deg,
            max_range_m=new.laser_range_m,
            noise_m=new.noise_m,
            rate_hz=new.rate_hz,
            seed=new.seed,
        )
        self.settings, self._sensors = new, (sonar, laser)

    def clear_maps(self) -> None:
        """Reset both global maps, with the extent of the present world."""
        world = self.world
        self.odometry_map = OccupancyGrid(world.size_m, world.resolution_m, world.origin_m)
        self.corrected_map = OccupancyGrid(world.size_m, world.resolution_m, world.origin_m)

    def step(self) -> None:
        """Scan once."""
        poses = self._poses()
        if poses is None:
            return
        odometry, corrected = poses
        settings, (sonar, laser) = self.settings, self._sensors
        number = self._scan.number + 1
        with self.world_lock:
            sonar_m = sonar.scan(self.world, corrected, number) if settings.sonar_on else _EMPTY
            laser_m = laser.scan(self.world, corrected, number) if settings.laser_on else _EMPTY
        for grid, pose in ((self.odometry_map, odometry), (self.corrected_map, corrected)):
            if laser_m.size:
                grid.add(laser, pose, laser_m)
            elif sonar_m.size:
                grid.add(sonar, pose, sonar_m)
        self._scan = Scan(number, corrected, sonar_m, laser_m)

    def _run(self) -> None:
        due = time.monotonic()
        while not self._closing.is_set():
            self.step()
            due = max(due + 1.0 / self.settings.rate_hz, time.monotonic() + 0.005)
            self._closing.wait(due - time.monotonic())


def _millimetres(distances_m: FloatArray) -> list[int | None]:
    return [None if d != d else round(1000 * d) for d in distances_m.tolist()]
