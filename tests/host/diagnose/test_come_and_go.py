"""Physics that comes and goes is never noise: a strip of carpet, a bearing that binds, a push.

The catalogue has none of these. A first-order robot is written out here, at 20 Hz with a small disturbance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from truing.arrays import FloatArray
from truing.diagnose.engine import diagnose
from truing.diagnose.result import Diagnosis
from truing.recording.baseline import Baseline, WheelModel
from truing.recording.run import RecordingSet, Run

GAIN_MPS, TAU_S, ROW_S, NOISE_MPS = 1.4, 0.3, 0.05, 0.003
# Steps per row of the robot's simulation.
FINE = 50


def on_carpet(t_s: float, speed: float) -> float:
    """Extra drag from 3 to 6 s of each run, in effort."""
    return -0.12 * np.sign(speed) if 3.0 < t_s < 6.0 and abs(speed) > 0.02 else 0.0


def binding(t_s: float, speed: float) -> float:
    """A bearing that grips for 0.2 s every 2 s."""
    return -0.15 * np.sign(speed) if t_s % 2.0 < 0.2 and abs(speed) > 0.02 else 0.0


def pushed(t_s: float, speed: float) -> float:
    """Somebody pushes once in each run, for half a second."""
    return 0.25 if 4.5 < t_s < 5.0 else 0.0


def nothing(t_s: float, speed: float) -> float:
    """The baseline's own robot."""
    return 0.0


class Shaken:
    """A random torque in effort, first-order Markov, that goes on from call to call."""

    def __init__(self, rms: float, correlation_s: float) -> None:
        self._decay = math.exp(-ROW_S / FINE / correlation_s)
        self._step = rms * math.sqrt(1.0 - self._decay**2)
        self._random = np.random.default_rng(5)
        self._torque = 0.0

    def __call__(self, t_s: float, speed: float) -> float:
        self._torque = self._decay * self._torque + self._step * self._random.normal()
        return self._torque


def robot(extra: Callable[[float, float], float]) -> Diagnosis:
    """Six runs of random steps, diagnosed from a baseline whose gain is 5 % off."""
    random = np.random.default_rng(21)
    runs = []
    for number in range(6):
        effort = np.repeat(random.uniform(-0.6, 0.6, 10), 20)
        columns = {"t_s": np.arange(len(effort)) * ROW_S}
        for side in ("left", "right"):
            speed = _driven(effort, extra) + random.normal(size=len(effort)) * NOISE_MPS
            columns |= {f"effort_{side}": effort, f"vel_{side}_mps": speed}
        runs.append(Run(f"{number + 1:02d}_steps", columns))
    wheel = WheelModel(1.05 * GAIN_MPS, TAU_S)
    return diagnose(RecordingSet("floor", tuple(runs), Baseline(Path("baseline.toml"), wheel, wheel)))


def _driven(effort: FloatArray, extra: Callable[[float, float], float]) -> FloatArray:
    """Mean speed over each row, m/s."""
    speed, out = 0.0, np.zeros(len(effort))
    for row in range(1, len(effort)):
        for k in range(FINE):
            t_s = (row - 1 + k / FINE) * ROW_S
            torque = effort[row] + extra(t_s, speed)
            speed += (GAIN_MPS * torque - speed) * ROW_S / FINE / TAU_S
            out[row] += speed / FINE
    return out


def test_the_plain_robot_has_only_other_parameters() -> None:
    assert robot(nothing).verdict == "parameters_only"


def test_a_slow_disturbance_is_no_missing_physics() -> None:
    """Its speed error is several times what second differences show, and no run repeats it."""
    found = robot(Shaken(rms=0.03, correlation_s=0.4))
    assert found.verdict == "parameters_only"
    assert found.fit.model_rmse > 3.0 * found.fit.noise_floor


@pytest.mark.parametrize("extra", [on_carpet, binding, pushed])
def test_what_comes_and_goes_is_unexplained_and_never_noise(extra: Callable[[float, float], float]) -> None:
    found = robot(extra)
    assert found.verdict in ("unexplained", "partly_explained")
    assert found.fit.noise_floor < 3.0 * NOISE_MPS
    assert found.mismatch
