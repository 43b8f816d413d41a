"""Where control inputs lead under what a diagnosis found: a controller holds the simulated wheels to them.

On the board a controller does. So friction or a tired battery bends the path no more than a controller lets
them, while what no encoder sees (ground, geometry, slip) bends it as it is. The controller here is the
board's in form, feedforward of speed and acceleration with a PI term, and knows what the baseline knows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from truing.baseline import Baseline
from truing.errors import TruingError
from truing.recording import FloatArray, Run
from truing.web.effect_rollout import effect_rollout
from truing.web.pose import Pose
from truing.web.trajectory import Cycle

_ROW_S = 0.05
# Each row is simulated from the start on, since an effect's memory is the simulator's own: longer drives take
# longer rows.
_MOST_ROWS = 800
_FIRST_ROW = 6
# At rest before the drive, and time for the wheels to come to rest after it.
_REST_S = 0.5
# Shares of the gain that would make up for a missing speed at once, and within a time constant.
_PROPORTIONAL, _INTEGRAL = 0.5, 0.5


def plan_rollout(cycles: Sequence[Cycle], known: Baseline, robot: Baseline, start: Pose) -> FloatArray:
    """X (m), y (m), theta (rad) along the drive, shape (n, 3), from `start` on.

    Parameters
    ----------
    known : what the controller knows of the robot.
    robot : what is driven: the same with what was found.

    Raises
    ------
    TruingError : the robot has no wheelbase, or an effect is nothing that can be simulated.
    """
    if not known.wheelbase_m:
        raise TruingError("the model has no wheelbase", "put [robot] wheelbase_m into its baseline.toml")
    wheels = (known.left, known.right)
    gains = np.array([wheel.gain_mps for wheel in wheels])
    taus = np.array([wheel.time_constant_s for wheel in wheels])
    t, wanted = _wanted(cycles, known.wheelbase_m)
    row_s = t[1] - t[0]
    rates = np.diff(wanted, axis=0, prepend=0.0) / row_s
    efforts = np.clip((wanted + taus * rates) / gains, -1.0, 1.0)
    sums = np.zeros(2)
    for row in range(_FIRST_ROW, len(t)):
        _, speeds, _ = effect_rollout(_run(t[:row], efforts[:row]), robot, start)
        missing = wanted[row - 1] - speeds[-1]
        asked = wanted[row] + taus * rates[row] + _PROPORTIONAL * missing + sums
        # No winding up: at the end of the effort's range the integral stands still.
        free = np.abs(asked) < gains
        sums += np.where(free, _INTEGRAL * missing * row_s / taus, 0.0)
        efforts[row] = np.clip(asked / gains, -1.0, 1.0)
    return effect_rollout(_run(t, efforts), robot, start)[2]


def _wanted(cycles: Sequence[Cycle], width: float) -> tuple[FloatArray, FloatArray]:
    """Time of each row (n,), and each wheel's mean commanded speed over it (n, 2)."""
    ends = _REST_S + np.concatenate(([0.0], np.cumsum([cycle.duration_s for cycle in cycles])))
    sides = np.array(
        [(c.v_mps - 0.5 * width * c.omega_radps, c.v_mps + 0.5 * width * c.omega_radps) for c in cycles]
    )
    travel = np.concatenate((np.zeros((1, 2)), np.cumsum(sides * np.diff(ends)[:, None], axis=0)))
    whole = ends[-1] + _REST_S
    row_s = max(_ROW_S, whole / _MOST_ROWS)
    t = np.arange(0.0, whole + 0.5 * row_s, row_s)
    at = np.column_stack([np.interp(t, ends, travel[:, wheel]) for wheel in (0, 1)])
    return t, np.diff(at, axis=0, prepend=0.0) / row_s


def _run(t: FloatArray, efforts: FloatArray) -> Run:
    still = np.zeros(len(t))
    columns = {
        "t_s": t,
        "effort_left": efforts[:, 0],
        "effort_right": efforts[:, 1],
        "vel_left_mps": still,
        "vel_right_mps": still,
    }
    return Run("drive", columns)
