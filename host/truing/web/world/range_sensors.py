"""Simulated range sensors: a ring of sonars and a scanning laser, with seeded noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from truing.arrays import FloatArray
from truing.web.pose import Pose
from truing.web.world.ray_casting import cast
from truing.web.world.world_map import WorldMap

# A cone is sampled by rays this far apart; a table leg of 4 cm is then detected up to 2.3 m away.
_CONE_STEP_RAD = math.radians(1.0)


@dataclass(frozen=True, slots=True)
class RangeSensor:
    """A sensor of several beams in the robot's own frame.

    Attributes
    ----------
    name : seeds the noise, together with `seed` and the scan's number.
    angles_rad : shape (n,), direction of each beam.
    cone_rad : opening angle of one beam; 0 is a ray.
    mount_m : distance of each beam's origin from the robot's centre along the beam.
    min_range_m, max_range_m : measuring range.
    noise_m : standard deviation of a measured distance.
    rate_hz : scans per second.
    """

    name: str
    angles_rad: FloatArray = field(repr=False)
    cone_rad: float
    mount_m: float
    min_range_m: float
    max_range_m: float
    noise_m: float
    rate_hz: float
    seed: int = 1

    def scan(self, world: WorldMap, pose: Pose, number: int) -> FloatArray:
        """Distances from the sensor's origin, shape (n,), m; NaN where nothing is within range.

        The same seed and number give the same noise, independent of earlier scans.
        """
        count = self.angles_rad.size
        rays = 1 + 2 * math.ceil(0.5 * self.cone_rad / _CONE_STEP_RAD)
        spread = np.linspace(-0.5, 0.5, rays) * self.cone_rad if rays > 1 else np.zeros(1)
        headings = self.angles_rad + pose.theta_rad
        distances = np.empty(count)
        if self.mount_m:
            for i, heading in enumerate(headings.tolist()):
                x = pose.x_m + self.mount_m * math.cos(heading)
                y = pose.y_m + self.mount_m * math.sin(heading)
                distances[i] = cast(world, x, y, heading + spread, self.max_range_m).min()
        else:
            all_rays = (headings[:, None] + spread).ravel()
            found = cast(world, pose.x_m, pose.y_m, all_rays, self.max_range_m)
            distances = found.reshape(count, rays).min(axis=1)
        missed = distances >= self.max_range_m
        noise = np.random.default_rng([self.seed, _hash(self.name), number]).normal(0.0, self.noise_m, count)
        measured: FloatArray = np.clip(distances + noise, self.min_range_m, self.max_range_m)
        measured[missed] = np.nan
        return measured

    def hits(self, pose: Pose, distances_m: FloatArray) -> FloatArray:
        """End points of the beams for a robot at `pose`, shape (n, 2), m; NaN without a return."""
        headings = self.angles_rad + pose.theta_rad
        ranges = distances_m + self.mount_m
        return np.column_stack((pose.x_m + ranges * np.cos(headings), pose.y_m + ranges * np.sin(headings)))


def sonar_ring(
    count: int = 16,
    *,
    cone_deg: float = 25.0,
    max_range_m: float = 4.0,
    noise_m: float = 0.01,
    rate_hz: float = 10.0,
    seed: int = 1,
) -> RangeSensor:
    """Sonars evenly spaced around the body."""
    angles: FloatArray = np.arange(count, dtype=np.float64) * (2.0 * math.pi / count)
    return RangeSensor(
        "sonar", angles, math.radians(cone_deg), 0.18, 0.05, max_range_m, noise_m, rate_hz, seed
    )


def laser_scanner(
    beams: int = 181,
    *,
    field_of_view_deg: float = 180.0,
    max_range_m: float = 8.0,
    noise_m: float = 0.01,
    rate_hz: float = 10.0,
    seed: int = 1,
) -> RangeSensor:
    """A planar laser at the centre, facing forward; a full circle has no duplicate beam."""
    half = math.radians(0.5 * field_of_view_deg)
    angles: FloatArray = np.linspace(-half, half, beams, endpoint=field_of_view_deg < 360.0)
    return RangeSensor("laser", angles, 0.0, 0.0, 0.02, max_range_m, noise_m, rate_hz, seed)


def _hash(name: str) -> int:
    """A hash of a name that is the same in every process."""
    return int.from_bytes(name.encode()[:4], "little")
