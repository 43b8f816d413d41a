"""How strong an effect is (S), and how close a healthy robot is to the baseline's form.

Both come from motion without noise. S is what an effect leaves when gain and time constant are refitted, over
the noise of the same recordings, as in the campaign on the own plant: in mean speeds over 50 ms, whatever the
recorder's rate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.errors import WeakEffectError
from truing.trial.engines.engine import TICK_S, Motion
from truing.trial.engines.nominal import NominalRobot
from truing.trial.engines.recorder import counted
from truing.trial.refit import displacements, fit_first_order

ROW_TICKS = 10
_ROW_S = ROW_TICKS * TICK_S
_POSE_TICKS = 200
# Simulations that a search may take, and how near S must come, in its logarithm.
_MAX_STEPS, _NEAR = 9, 0.25
_MIN_RAW = 1e-3


@dataclass(frozen=True)
class Closeness:
    """A robot beside the first-order model that fits it best.

    Attributes
    ----------
    rms_mps : free-run error over both wheels.
    share : of the mean full-effort speed.
    gain_mps, time_constant_s : of that model, left and right.
    """

    rms_mps: float
    share: float
    gain_mps: tuple[float, float]
    time_constant_s: tuple[float, float]


def closeness(motions: Sequence[Motion], nominal: NominalRobot) -> Closeness:
    """Fit gain and time constant of each wheel to noise-free motion."""
    found = [_refit(motions, wheel, nominal) for wheel in (0, 1)]
    rms = float(np.sqrt(np.mean([np.mean(residual**2) for _, _, residual in found])))
    gains, constants = (found[0][0], found[1][0]), (found[0][1], found[1][1])
    return Closeness(rms, rms / float(np.mean(gains)), gains, constants)


def added_mps(both: Sequence[Motion], one: Sequence[Motion], nominal: NominalRobot) -> float:
    """RMS of what an effect adds to another one under the same efforts, each refitted."""
    apart = [_refit(both, wheel, nominal)[2] - _refit(one, wheel, nominal)[2] for wheel in (0, 1)]
    return float(np.sqrt(np.mean(np.square(apart))))


def row_speeds(angle_rad: FloatArray, nominal: NominalRobot) -> FloatArray:
    """Mean rim speeds over rows of 50 ms, shape (rows, 2)."""
    speeds: FloatArray = np.diff(angle_rad[::ROW_TICKS], axis=0) * (nominal.radius_m / _ROW_S)
    return speeds


def noise_mps(seen: Sequence[Motion], quiet: Sequence[Motion], nominal: NominalRobot) -> float:
    """RMS of what counts and disturbance add to the rows' speeds, both robots under the same efforts."""
    step = 2.0 * np.pi / nominal.counts_per_rev
    apart = [
        row_speeds(counted(one.angle_rad, nominal) * step, nominal) - row_speeds(other.angle_rad, nominal)
        for one, other in zip(seen, quiet, strict=True)
    ]
    return float(np.sqrt(np.mean(np.concatenate(apart) ** 2)))


def pose_strength(
    motions: Sequence[Motion],
    nominal: NominalRobot,
    truth_mm: float,
    truth_mrad: float,
    *,
    beside: Sequence[Motion] | None = None,
) -> float:
    """S in the pose: what odometry misses in windows of a second, over the noise of the outside pose.

    Parameters
    ----------
    beside : S of what is missed beyond these motions under the same efforts.
    """
    missed = np.concatenate([_missed(motion, nominal) for motion in motions])
    if beside is not None:
        missed = missed - np.concatenate([_missed(motion, nominal) for motion in beside])
    noise = np.sqrt(2.0) * np.array([truth_mm, truth_mm, truth_mrad]) * 1e-3
    return float(np.max(np.sqrt(np.mean(missed**2, axis=0)) / noise))


def find_raw(
    name: str, measure: Callable[[float], float], wanted: float, limits: tuple[float, float], start: float
) -> tuple[float, float]:
    """Raw strength at which S is about what is wanted and within the limits, and S there.

    Raises
    ------
    WeakEffectError : this robot cannot have the effect at that strength.
    """
    low, high, value = _MIN_RAW, 1.0, start
    tried: list[tuple[float, float]] = []
    for _ in range(_MAX_STEPS):
        reached = max(measure(value), 1e-6)
        tried.append((value, reached))
        if abs(np.log(reached / wanted)) < _NEAR and limits[0] <= reached < limits[1]:
            return value, reached
        low, high = (value, high) if reached < wanted else (low, value)
        guess = value * wanted / reached
        # Proportional where that stays between what was too little and too much; halving where it does not.
        value = guess if len(tried) < 4 and low < guess < high else float(np.sqrt(low * high))
    value, reached = min(tried, key=lambda pair: abs(float(np.log(pair[1] / wanted))))
    if not limits[0] <= reached < limits[1]:
        raise WeakEffectError(
            f"{name}: S reaches {reached:.2f} on this robot, {wanted:.2f} was wanted", "take another seed"
        )
    return value, reached


def _refit(motions: Sequence[Motion], wheel: int, nominal: NominalRobot) -> tuple[float, float, FloatArray]:
    """Gain, time constant and residual of the first-order wheel that fits best."""
    target = np.concatenate([row_speeds(motion.angle_rad, nominal)[:, wheel] for motion in motions])
    efforts = [motion.effort[1:, wheel] for motion in motions]
    return fit_first_order(
        lambda constant_s: np.concatenate([_unit_speeds(effort, constant_s) for effort in efforts]),
        target,
        max_s=4.0,
        tolerance=0.002,
    )


def _unit_speeds(effort: FloatArray, constant_s: float) -> FloatArray:
    """Mean speeds over rows of 50 ms of a first-order wheel of gain 1, from rest."""
    from scipy.signal import lfilter

    kept = np.exp(-TICK_S / constant_s)
    speed = lfilter([1.0 - kept], [1.0, -kept], effort)
    before = np.concatenate([[0.0], speed[:-1]])
    # Mean of an exponential over its interval.
    mean = effort + (before - effort) * (1.0 - kept) * constant_s / TICK_S
    whole = len(mean) // ROW_TICKS
    out: FloatArray = mean[: whole * ROW_TICKS].reshape(whole, ROW_TICKS).mean(axis=1)
    return out


def _missed(motion: Motion, nominal: NominalRobot) -> FloatArray:
    """Displacements over windows that the pose has beyond odometry, each in the frame of its beginning."""
    moved = np.diff(motion.angle_rad, axis=0) * nominal.radius_m
    turn = (moved[:, 1] - moved[:, 0]) / nominal.wheelbase_m
    heading = np.concatenate([[0.0], np.cumsum(turn)])
    middle, forward = 0.5 * (heading[1:] + heading[:-1]), moved.mean(axis=1)
    x = np.concatenate([[0.0], np.cumsum(forward * np.cos(middle))])
    y = np.concatenate([[0.0], np.cumsum(forward * np.sin(middle))])
    driven = np.column_stack([x, y, heading])
    return displacements(motion.pose[::_POSE_TICKS]) - displacements(driven[::_POSE_TICKS])
