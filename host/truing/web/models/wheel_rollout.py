"""Wheel odometry: integration of wheel speeds to a path, exactly along arcs."""

from __future__ import annotations

import math

import numpy as np

from truing.arrays import FloatArray
from truing.web.pose import Pose


def rollout(
    t_s: FloatArray, left_mps: FloatArray, right_mps: FloatArray, wheelbase_m: float, start: Pose
) -> FloatArray:
    """X (m), y (m), theta (rad) at each row, shape (n, 3), from mean speeds of shape (n,); row 0 is the
    start.
    """
    spans = np.diff(t_s)
    ahead = 0.5 * (left_mps + right_mps)[1:] * spans
    turn = (right_mps - left_mps)[1:] / wheelbase_m * spans
    theta = start.theta_rad + np.concatenate(([0.0], np.cumsum(turn)))
    # The chord of an arc lies along the heading of its middle and is sin(T/2)/(T/2) times as long.
    chord = ahead * np.sinc(turn / (2.0 * math.pi))
    middle = theta[:-1] + 0.5 * turn
    x = start.x_m + np.concatenate(([0.0], np.cumsum(chord * np.cos(middle))))
    y = start.y_m + np.concatenate(([0.0], np.cumsum(chord * np.sin(middle))))
    return np.column_stack((x, y, theta))
