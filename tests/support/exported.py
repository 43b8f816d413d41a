"""Models to export, the efforts they are driven with, and what our own simulation makes of them."""

from __future__ import annotations

import numpy as np

from truing.exporters.terms import without
from truing.model.excitation import excitation
from truing.model.robot_model import RobotModel
from truing.model.wheel import WheelPhysics, simulate_physics
from truing.recording.baseline import RobotGeometry

GEOMETRY = RobotGeometry("stingray", 0.0635, 0.283, 2400.0)
PLAIN = RobotModel(
    WheelPhysics(1.45, 0.21, delay_s=0.06, friction=0.05),
    WheelPhysics(1.52, 0.24, delay_s=0.04, friction=0.07),
    GEOMETRY,
    20.0,
)
RICH = RobotModel(
    WheelPhysics(
        1.45,
        0.21,
        delay_s=0.063,
        friction=0.05,
        breakaway_excess=0.03,
        stribeck_mps=0.1,
        drag=0.05,
        lag_s=0.02,
        deadband=0.03,
    ),
    WheelPhysics(
        1.52,
        0.24,
        delay_s=0.041,
        friction=0.07,
        breakaway_excess=0.02,
        stribeck_mps=0.06,
        stribeck_shape=2.0,
        offset=0.01,
        reverse_gain=0.9,
        reverse_friction=1.3,
        reverse_time_constant=1.1,
    ),
    GEOMETRY,
    20.0,
)
PERIOD_S = 0.02


def drive() -> tuple[np.ndarray, np.ndarray]:
    """Times, shape (n,), and efforts of both wheels, shape (2, n): each acts until its row.

    Rest, a step, efforts below friction (the wheel comes to rest and stays there), a reversal, a ramp.
    """
    levels = [0.0, 0.4, 0.8, 0.04, -0.03, -0.6, 0.0, 0.3, -0.3]
    left = np.concatenate([np.full(50, level) for level in levels] + [np.linspace(-0.3, 0.5, 100)])
    right = np.concatenate([np.full(50, level) for level in reversed(levels)] + [np.linspace(0.5, -0.3, 100)])
    right[:50] = 0.0
    return PERIOD_S * np.arange(left.size), np.array([left, right])


def ours(model: RobotModel, holds: frozenset[str], t: np.ndarray, efforts: np.ndarray) -> np.ndarray:
    """Speeds at the rows' instants, shape (2, n), by our own simulation of the terms that a format holds."""
    reduced = without(model, holds)
    speeds = []
    for wheel, effort in zip((reduced.left, reduced.right), efforts, strict=True):
        driven = excitation(
            t, effort, np.zeros_like(t), np.array([0, t.size], dtype=np.int64), np.array([t[1] - t[0]])
        )
        instants = type(driven)(
            driven.t_s, driven.effort, driven.supply, driven.starts, driven.interval_s, driven.pieces, False
        )
        speeds.append(simulate_physics(wheel.to_vector(), instants, np.zeros(1)).speed_mps)
    return np.array(speeds)


def scale(model: RobotModel) -> float:
    """The faster wheel's gain, m/s: what errors are shares of."""
    return max(model.left.gain_mps, model.right.gain_mps)
