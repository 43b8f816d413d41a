"""The path of control inputs on a robot with diagnosed effects, under closed-loop speed control.

The board has a speed controller, so friction or a low battery affect the path only as far as it cannot
compensate them, while effects that the encoders do not measure (ground, geometry, slip) act in full. The
controller here has the structure of the board's (feedforward of speed and acceleration, PI feedback) and the
baseline's parameters.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from truing.arrays import FloatArray
from truing.errors import TruingError
from truing.recording.baseline import Baseline
from truing.recording.run import Run
from truing.web.models.effect_rollout import effect_rollout
from truing.web.path.trajectory import Cycle
from truing.web.pose import Pose

_ROW_S = 0.05
# Each row is simulated from the start, since the simulator holds the effects' state: longer drives use longer
# rows.
_MAX_ROWS = 800
_FIRST_ROW = 6
# At rest before the drive, and time for the wheels to come to rest after it.
_REST_S = 0.5
# Controller gains relative to 1 / plant gain: proportional, and integral per time constant.
_PROPORTIONAL, _INTEGRAL = 0.5, 0.5


def plan_rollout(cycles: Sequence[Cycle], known: Baseline, robot: Baseline, start: Pose) -> FloatArray:
    """X (m), y (m), theta (rad) along the drive, shape (n, 3), starting at `start`.

    Parameters
    ----------
    known : the controller's model of the robot.
    robot : the simulated robot, including the diagnosed effects.

    Raises
    ------
    TruingError : the robot has no wheelbase, or an effect cannot be simulated.
    """
    if not known.wheelbase_m:
        raise TruingError("the model has no wheelbase", "add [robot] wheelbase_m to its baseline.toml")
    wheels = (known.left, known.right)
    gains = np.array([wheel.gain_mps for wheel in wheels])
    taus = np.array([wheel.time_constant_s for wheel in wheels])
    t, commanded = _commanded(cycles, known.wheelbase_m)
    row_s = t[1] - t[0]
    rates = np.diff(commanded, axis=0, prepend=0.0) / row_s
    efforts = np.clip((commanded + taus * rates) / gains, -1.0, 1.0)
    integrals = np.zeros(2)
    for row in range(_FIRST_ROW, len(t)):
        _, speeds, _ = effect_rollout(_run(t[:row], efforts[:row]), robot, start)
        error = commanded[row - 1] - speeds[-1]
        control = commanded[row] + taus * rates[row] + _PROPORTIONAL * error + integrals
        # Anti-windup: the integrator is frozen while the effort saturates.
        unsaturated = np.abs(control) < gains
        integrals += np.where(unsaturated, _INTEGRAL * error * row_s / taus, 0.0)
        efforts[row] = np.clip(control / gains, -1.0, 1.0)
    path = effect_rollout(_run(t, efforts), robot, start)[2]
    if path is None:
        raise TruingError("the model has no wheelbase", "add [robot] wheelbase_m to its baseline.toml")
    return path


def _commanded(cycles: Sequence[Cycle], width: float) -> tuple[FloatArray, FloatArray]:
    """Time of each row (n,), and each wheel's mean commanded speed over it (n, 2)."""
    ends = _REST_S + np.concatenate(([0.0], np.cumsum([cycle.duration_s for cycle in cycles])))
    sides = np.array(
        [(c.v_mps - 0.5 * width * c.omega_radps, c.v_mps + 0.5 * width * c.omega_radps) for c in cycles]
    )
    travel = np.concatenate((np.zeros((1, 2)), np.cumsum(sides * np.diff(ends)[:, None], axis=0)))
    duration_s = ends[-1] + _REST_S
    row_s = max(_ROW_S, duration_s / _MAX_ROWS)
    t = np.arange(0.0, duration_s + 0.5 * row_s, row_s)
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
