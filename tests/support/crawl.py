"""A robot that is told to crawl, and how evenly it does: its true wheel speed, which no sensor of it sees."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hil_sim import EncoderNoise, VirtualRobot
from hil_sim.plant import RobotParameters
from truing.board.device import Device
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream
from truing.plan import Kind, Plan, Segment

SETTLE_S = 10.0
SPAN_S = 15.0
_SAMPLE_US = 2000


@dataclass(frozen=True)
class Crawl:
    """Both wheels' true speeds after settling.

    Attributes
    ----------
    commanded_mps : what velocity mode was told.
    speed_mps : shape (n, 2), every 2 ms.
    """

    commanded_mps: float
    speed_mps: npt.NDArray[np.float64]

    @property
    def ripple_mps(self) -> float:
        """RMS about its own mean, of the worse wheel."""
        return float(self.speed_mps.std(axis=0).max())

    @property
    def mean_mps(self) -> float:
        """Mean of the wheel that is further from the command."""
        means = self.speed_mps.mean(axis=0)
        return float(means[np.argmax(abs(means - self.commanded_mps))])

    @property
    def slowest_mps(self) -> float:
        """The slowest moment of either wheel."""
        return float(self.speed_mps.min())

    @property
    def fastest_mps(self) -> float:
        """The fastest moment of either wheel."""
        return float(self.speed_mps.max())


def crawl(
    image: Path,
    speed_mps: float,
    *,
    from_edges: bool,
    counts_per_rev: int = 64,
    seed: int = 1,
    noise: EncoderNoise | None = None,
) -> Crawl:
    """Hold a speed in velocity mode with default gains, on the paper's robot with coarser encoders."""
    robot = RobotParameters.msrp().changed(
        left__encoder__counts_per_rev=float(counts_per_rev),
        right__encoder__counts_per_rev=float(counts_per_rev),
    )
    with VirtualRobot(image, robot=robot, seed=seed) as board, Device(Client(VirtualStream(board))) as device:
        device.set_parameter("counts_per_rev", counts_per_rev)
        device.set_parameter("speed_from_edges", float(from_edges))
        device.client.stream.sleep(0.3)
        for wheel in (0, 1):
            board.set_encoder_noise(wheel, noise or EncoderNoise())
        segment = Segment(Kind.VELOCITY, SETTLE_S + SPAN_S + 5.0, speed_mps, speed_mps)
        device.start(device.upload(Plan("crawl", "crawl", (segment,))), unattended=True)
        board.run_us(round(SETTLE_S * 1e6))
        speeds = []
        for _ in range(round(SPAN_S * 1e6 / _SAMPLE_US)):
            board.run_us(_SAMPLE_US)
            speeds.append(board.truth().wheel_speed_radps)
        return Crawl(speed_mps, np.array(speeds) * robot.left.radius_m)
