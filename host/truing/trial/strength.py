"""How strong an effect is in recordings: what it leaves when the baseline's numbers are refitted, over noise.

The plant is played back without noise under the very efforts of the recordings; the first-order
model here is fitted to that, at a millisecond, and is nobody else's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hil_sim.host_robot import replay
from hil_sim.recorded import Samples
from truing.arrays import FloatArray
from truing.recording.run import ODOMETRY_COLUMNS
from truing.trial.drives import DrivenSet
from truing.trial.refit import displacements, fit_first_order
from truing.trial.robot import Robot

POSE_WINDOW_ROWS = 20
_LATE_S = 0.00065


@dataclass(frozen=True)
class RowMotion:
    """What happens in the rows of all runs, without noise; N rows in all.

    Attributes
    ----------
    speed_mps : shape (N, 2), mean rim speed by the encoders' angle and the nominal radius.
    recorded_mps : shape (N, 2), the same as a recorder with a speed filter reports it.
    pose : shape (N, 3), true x, y (m), heading (rad).
    run : shape (N,), number of the run.
    """

    speed_mps: FloatArray
    recorded_mps: FloatArray
    pose: FloatArray
    run: npt.NDArray[np.intp]


def row_motion(driven: DrivenSet, samples: Samples, robot: Robot) -> RowMotion:
    """Return what the samples say at the rows of a driven set."""
    time_s = (np.arange(len(samples)) + 1.0) * 1e-3
    travel = samples["measured_rad"] * robot.radius_m * robot.counts_share
    filtered = filtered_travel(travel, robot.filter_s) if robot.filter_s > 0.0 else travel
    speeds, recorded, poses, numbers = [], [], [], []
    for number, run in enumerate(driven.runs):
        at = run.row_times_s

        def seen(what: FloatArray, at: FloatArray = at) -> FloatArray:
            return np.column_stack([np.interp(at, time_s, what[:, i]) for i in range(what.shape[1])])

        speeds.append(mean_speed(at, seen(travel)))
        recorded.append(mean_speed(at, seen(filtered)) if robot.filter_s > 0.0 else speeds[-1])
        poses.append(seen(np.column_stack([samples[name] for name in ODOMETRY_COLUMNS])))
        numbers.append(np.full(len(at), number))
    return RowMotion(
        np.concatenate(speeds), np.concatenate(recorded), np.concatenate(poses), np.concatenate(numbers)
    )


def mean_speed(at_s: FloatArray, travel_m: FloatArray) -> FloatArray:
    """Mean speed over the interval that ends at each row, shape (n, 2); the first row stands."""
    speed = np.zeros_like(travel_m)
    gap = np.diff(at_s)
    speed[1:] = np.where(gap[:, None] > 0.0, np.diff(travel_m, axis=0) / np.maximum(gap, 1e-9)[:, None], 0.0)
    return speed


def filtered_travel(travel_m: FloatArray, constant_s: float) -> FloatArray:
    """Sum of the speed behind a filter of first order, shape (ms, 2)."""
    from scipy.signal import lfilter

    kept = np.exp(-1e-3 / constant_s)
    out: FloatArray = lfilter([1.0 - kept], [1.0, -kept], travel_m - travel_m[:1], axis=0) + travel_m[:1]
    return out


def play(driven: DrivenSet, robot: Robot, seed: int) -> Samples:
    """Return the robot's motion under the efforts of a driven set, without disturbance.

    Parameters
    ----------
    seed : the driven robot's, so that what comes when it likes comes at the same moments.
    """
    quiet = dict(robot.hidden)
    quiet["disturbance__torque_nm"] = (0.0, 0.0)
    plain = Robot(**{**robot.__dict__, "hidden": quiet})
    parameters, hidden = plain.build()
    return replay(parameters, hidden, driven.asked, seed, driven.placings)


@dataclass(frozen=True)
class Refit:
    """The baseline's numbers as they fit best, and what they leave."""

    gain_mps: tuple[float, float]
    time_constant_s: tuple[float, float]
    residual_mps: FloatArray


class FirstOrder:
    """A first-order wheel under the efforts of a driven set, at a millisecond; each run starts at rest."""

    def __init__(self, driven: DrivenSet) -> None:
        self._rows = [run.row_times_s for run in driven.runs]
        self._asked = driven.asked
        self._spans = [
            (int(np.floor(at[0] * 1000)) - 1, int(np.ceil(at[-1] * 1000)) + 2) for at in self._rows
        ]

    def speed(self, wheel: int, constant_s: float) -> FloatArray:
        """Mean speed per row of a wheel of gain 1, shape (N,)."""
        from scipy.signal import lfilter

        kept = np.exp(-1e-3 / constant_s)
        out = []
        for (begin, end), at in zip(self._spans, self._rows, strict=True):
            effort = self._asked[max(begin, 0) : end, wheel]
            speed = lfilter([1.0 - kept], [1.0, -kept], effort)
            travel = np.concatenate([[0.0], np.cumsum(0.5e-3 * (np.append(0.0, speed[:-1]) + speed))])
            when = (max(begin, 0) + np.arange(len(travel))) * 1e-3 + _LATE_S
            out.append(mean_speed(at, np.interp(at, when, travel)[:, None])[:, 0])
        return np.concatenate(out)

    def refit(self, speed_mps: FloatArray, *, tied: bool = False) -> Refit:
        """Fit gain and time constant to speeds of shape (N, 2); `tied`: both sides alike."""
        groups = [(0, 1)] if tied else [(0,), (1,)]
        gain, constant = [0.0, 0.0], [0.0, 0.0]
        residual = np.zeros_like(speed_mps)
        for group in groups:

            def unit(constant_s: float, group: tuple[int, ...] = group) -> FloatArray:
                return np.column_stack([self.speed(i, constant_s) for i in group])

            value, value_s, left = fit_first_order(
                unit, speed_mps[:, list(group)], max_s=3.0, tolerance=0.003
            )
            for k, i in enumerate(group):
                gain[i], constant[i] = value, value_s
                residual[:, i] = left[:, k]
        return Refit((gain[0], gain[1]), (constant[0], constant[1]), residual)


def wheel_strength(first_order: FirstOrder, motion: RowMotion, noise_mps: float, *, tied: bool) -> float:
    """S in the wheels' speeds: RMS after the refit over that of noise and disturbance."""
    residual = first_order.refit(motion.speed_mps, tied=tied).residual_mps
    signal = motion.recorded_mps - motion.speed_mps
    return float(np.sqrt(np.mean(residual**2) + np.mean(signal**2))) / noise_mps


def window_moves(pose: FloatArray, run: npt.NDArray[np.intp]) -> FloatArray:
    """Displacement over windows in the frame of their beginnings: forward, lateral (m), heading (rad)."""
    return np.concatenate(
        [displacements(pose[run == number][::POSE_WINDOW_ROWS]) for number in np.unique(run)]
    )


def odometry(motion: RowMotion, driven: DrivenSet, robot: Robot) -> FloatArray:
    """Pose by measured travel and nominal geometry, shape (N, 3), each run from its true start."""
    out = np.zeros_like(motion.pose)
    at = 0
    for run in driven.runs:
        rows = slice(at, at + len(run.run))
        at += len(run.run)
        dt = np.diff(run.row_times_s, prepend=run.row_times_s[0])[:, None]
        moved = motion.speed_mps[rows] * dt
        turn = (moved[:, 1] - moved[:, 0]) / robot.wheelbase_m
        start = motion.pose[rows][0]
        heading = start[2] + np.cumsum(turn)
        middle = heading - 0.5 * turn
        forward = moved.mean(axis=1)
        out[rows] = np.column_stack(
            [
                start[0] + np.cumsum(forward * np.cos(middle)),
                start[1] + np.cumsum(forward * np.sin(middle)),
                heading,
            ]
        )
    return out


def pose_strength(
    motion: RowMotion, driven: DrivenSet, robot: Robot, truth_mm: float, truth_mrad: float
) -> float:
    """S in the pose: what odometry misses in windows of a second, over the noise of the external pose."""
    seen = window_moves(motion.pose, motion.run)
    believed = window_moves(odometry(motion, driven, robot), motion.run)
    missed = np.sqrt(np.mean((seen - believed) ** 2, axis=0))
    noise = np.sqrt(2.0) * np.array([truth_mm, truth_mm, truth_mrad]) * 1e-3
    return float(np.max(missed / noise))


def effect_energy(with_effect: Sequence[RowMotion], without: RowMotion) -> FloatArray:
    """Squared difference between robots with and without an effect, shape (N, 2), (m/s)^2."""
    energy: FloatArray = sum(
        ((each.recorded_mps - without.recorded_mps) ** 2 for each in with_effect), start=np.zeros((1, 1))
    )
    return energy
