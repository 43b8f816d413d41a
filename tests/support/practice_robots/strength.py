"""How strongly an effect shows: its RMS after the baseline is refitted, over the RMS of the noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from support.practice_robots.first_order import refit
from support.practice_robots.kernel import HEADING, X
from support.practice_robots.physics import Physics
from support.practice_robots.recorder import Drive, Layout, drive

Array: TypeAlias = NDArray[np.float64]
POSE_WINDOW_S = 1.0


@dataclass(frozen=True)
class Experiment:
    """A robot on a plan with its disturbance: everything that strengths are measured against."""

    healthy: Physics
    layout: Layout
    torque: Array
    nominal_counts: float
    time_constant: Array
    pose_noise_m: float
    heading_noise_rad: float
    seed: int
    sides_equal: bool

    def clean(self, physics: Physics) -> Drive:
        """Without disturbance and quantisation."""
        return drive(
            physics,
            self.layout,
            np.zeros_like(self.torque),
            nominal_counts=self.nominal_counts,
            quantised=False,
            seed=self.seed,
        )

    def disturbed(self, physics: Physics, *, quantised: bool) -> Drive:
        """With the disturbance; whole counts where `quantised`."""
        return drive(
            physics,
            self.layout,
            self.torque,
            nominal_counts=self.nominal_counts,
            quantised=quantised,
            seed=self.seed,
        )

    def wheel_noise(self, physics: Physics) -> float:
        """RMS of noise, disturbance and quantisation in the reported speeds, m/s."""
        noisy, clean = self.disturbed(physics, quantised=True), self.clean(physics)
        return _rms(noisy.speed - clean.speed)

    def wheel_effect(self, physics: Physics) -> float:
        """RMS that the refitted baseline leaves of the noise-free speeds, m/s.

        A filter is read at the rows' times. What that changes is no part of the filter's strength.
        """
        speed = self.clean(physics).speed
        instant = physics.speed_filter_s > 0.0
        left = speed - refit(
            self.layout, speed, self.time_constant, sides_equal=self.sides_equal, instant=instant
        )
        return _rms(left)

    def pose_effect(self, physics: Physics) -> Array:
        """RMS (3,) of truth less odometry over windows: forward, lateral (m), heading (rad)."""
        driven = self.clean(physics)
        return self._pose_rms(driven.rows[:, X : HEADING + 1], driven.travel_m)

    def pose_noise(self) -> Array:
        """The same for the healthy robot with everything that is noise."""
        noisy = self.disturbed(self.healthy, quantised=True)
        pose = add_pose_noise(
            noisy.rows[:, X : HEADING + 1],
            self.pose_noise_m,
            self.heading_noise_rad,
            np.random.default_rng(self.seed),
        )
        return self._pose_rms(pose, noisy.travel_m)

    def _pose_rms(self, pose: Array, travel: Array) -> Array:
        layout, step = self.layout, round(POSE_WINDOW_S / self.layout.dt_s)
        squares, windows = np.zeros(3), 0
        for run in range(layout.runs):
            rows = np.flatnonzero(layout.row_run == run)
            path = np.vstack([np.zeros(3), pose[rows]])
            odometry = dead_reckoning(travel[rows], self.healthy.wheelbase)
            for at in range(0, len(path) - step, step):
                gap = _seen(path, at, at + step) - _seen(odometry, at, at + step)
                squares += gap**2
                windows += 1
        return np.asarray(np.sqrt(squares / max(windows, 1)), dtype=np.float64)


def _seen(path: Array, first: int, last: int) -> Array:
    """Displacement from row `first` to `last` in the body frame at `first`."""
    dx, dy, turn = path[last] - path[first]
    c, s = np.cos(path[first, 2]), np.sin(path[first, 2])
    return np.array([c * dx + s * dy, -s * dx + c * dy, turn])


def dead_reckoning(travel: Array, wheelbase: float) -> Array:
    """Midpoint odometry (rows + 1, 3) from rim travel per row, from zero."""
    ahead = travel.mean(axis=1)
    turn = (travel[:, 1] - travel[:, 0]) / wheelbase
    heading = np.concatenate([[0.0], np.cumsum(turn)])
    middle = heading[:-1] + turn / 2
    x = np.concatenate([[0.0], np.cumsum(ahead * np.cos(middle))])
    y = np.concatenate([[0.0], np.cumsum(ahead * np.sin(middle))])
    return np.stack([x, y, heading], axis=1)


def add_pose_noise(pose: Array, noise_m: float, noise_rad: float, rng: Generator) -> Array:
    """A pose as a camera sees it."""
    scale = np.array([noise_m, noise_m, noise_rad])
    return np.asarray(pose + rng.standard_normal(pose.shape) * scale, dtype=np.float64)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def find_size(
    strength_of: Callable[[float], float], target: float, low: float, high: float
) -> tuple[float, float] | None:
    """Size in (0, 1] whose strength is near `target` and inside [low, high]; None if it is out of reach."""
    below, above = 0.0, 1.0
    at_below, at_above = 0.0, np.inf
    size = 0.15
    for trying in range(12):
        got = strength_of(size)
        close = 0.08 if trying < 4 else 0.5  # a threshold that only a few peaks reach grows in jumps
        if abs(np.log(max(got, 1e-9) / target)) < close and low <= got <= high:
            return size, got
        if got < target:
            if size >= 1.0:
                return None
            below, at_below = size, got
            guess = size * float(np.clip(target / max(got, 1e-9), 1.05, 12.0))
        else:
            above, at_above = size, got
            guess = size * float(np.clip(target / got, 0.05, 0.95))
        if at_above < np.inf:
            if below > 0 and not below < guess < above:
                share = np.log(target / at_below) / np.log(at_above / at_below)
                guess = below * (above / below) ** float(np.clip(share, 0.1, 0.9))
            elif below == 0.0:
                guess = min(guess, above * 0.95)
        size = min(guess, 1.0)
        if size < 1e-4:
            return None
    return None
