"""Compiles all that a diagnosis compiles, so that nobody waits for it; run as a module by `./run setup`.

    python -m truing.diagnose.compile_ahead

The machine code is kept (`truing.model.code_cache`). `simulation/warm.py` compiles the simulation; the rest
is compiled by a diagnosis of two small runs that have every signal.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.diagnosis_input import Options
from truing.diagnose.engine import diagnose
from truing.diagnose.simulation.warm import compile_once
from truing.model.correction import Correction, Rows, corrected_speeds
from truing.recording.baseline import Baseline, RobotGeometry, WheelModel
from truing.recording.run import RecordingSet, Run

ROW_S, GAIN_MPS, TAU_S, WHEELBASE_M = 0.05, 1.0, 0.3, 0.3
LEVELS = (0.0, 0.5, -0.4, 0.8, 0.0, 0.3, -0.7, 0.0)


def small_set() -> RecordingSet:
    """Two runs of a first-order robot with positions, speeds and a pose from outside."""
    runs = tuple(_run(name, scale) for name, scale in (("ahead", 1.0), ("turning", -0.6)))
    wheel = WheelModel(0.9 * GAIN_MPS, TAU_S)
    geometry = RobotGeometry("small", 0.05, WHEELBASE_M, 2400.0)
    return RecordingSet("small", runs, Baseline(Path("baseline.toml"), wheel, wheel, geometry, 1.0 / ROW_S))


def simulate_corrected() -> None:
    """A few rows with an empty correction, which calls its compiled free run."""
    rest = np.zeros((4, 2))
    rows = Rows(np.array([0, 4]), np.full(4, ROW_S), rest, False)
    corrected_speeds(Correction((GAIN_MPS, GAIN_MPS), (TAU_S, TAU_S), ()), rows, rest)


def _run(name: str, right_share: float) -> Run:
    effort = np.repeat(LEVELS, 20)
    columns: dict[str, FloatArray] = {"t_s": np.asarray(np.arange(len(effort)) * ROW_S, dtype=np.float64)}
    speeds = {"left": _driven(effort), "right": _driven(right_share * effort)}
    for side, scale in (("left", 1.0), ("right", right_share)):
        columns |= {
            f"effort_{side}": scale * effort,
            f"pos_{side}_m": np.cumsum(speeds[side]) * ROW_S,
            f"vel_{side}_mps": speeds[side],
        }
    yaw_radps = (speeds["right"] - speeds["left"]) / WHEELBASE_M
    heading: FloatArray = np.cumsum(yaw_radps) * ROW_S
    ahead = 0.5 * (speeds["left"] + speeds["right"]) * ROW_S
    columns |= {
        "truth_x_m": np.cumsum(ahead * np.cos(heading)),
        "truth_y_m": np.cumsum(ahead * np.sin(heading)),
        "truth_theta_rad": heading,
        "gyro_z_radps": yaw_radps,
    }
    return Run(name, columns)


def _driven(effort: FloatArray) -> FloatArray:
    """Speed at each row, m/s, with a little noise."""
    speed = np.zeros(len(effort))
    for row in range(1, len(effort)):
        goal = GAIN_MPS * effort[row]
        speed[row] = goal + (speed[row - 1] - goal) * np.exp(-ROW_S / TAU_S)
    return np.asarray(speed + np.random.default_rng(1).normal(0.0, 0.003, len(speed)))


if __name__ == "__main__":
    for wheels in (2, 1):
        compile_once(print, wheels=wheels)
    diagnose(small_set(), Options(learn=True))
    simulate_corrected()
