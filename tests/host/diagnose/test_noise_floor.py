"""The noise floor comes from the recordings alone: what no model explains does not raise it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from truing.diagnose.data.set_data import SetData, set_data
from truing.diagnose.noise_floor import SLOW_FACTOR, noise_floor
from truing.recording.baseline import Baseline, WheelModel
from truing.recording.run import RecordingSet, Run

NOISE_MPS = 0.004


def recorded(extra: float = 0.0) -> SetData:
    """Steps of a first-order wheel at 50 Hz with white noise, and a disturbance for a third of the run."""
    random = np.random.default_rng(5)
    t_s = np.arange(1500) * 0.02
    effort = np.where(np.floor(t_s / 3.0) % 2 == 0, 0.4, -0.2)
    speed = np.zeros((len(t_s), 2))
    for row in range(1, len(t_s)):
        speed[row] = speed[row - 1] + (1.5 * effort[row] - speed[row - 1]) * (1.0 - np.exp(-0.02 / 0.25))
    speed += random.normal(size=speed.shape) * NOISE_MPS
    disturbed = (t_s > 10.0) & (t_s < 20.0)
    speed[disturbed] += extra * np.sin(0.8 * t_s[disturbed])[:, None]
    columns = {"t_s": t_s, "effort_left": effort, "effort_right": effort}
    columns |= {"vel_left_mps": speed[:, 0], "vel_right_mps": speed[:, 1]}
    wheel = WheelModel(1.5, 0.25)
    baseline = Baseline(Path("baseline.toml"), wheel, wheel)
    return set_data(RecordingSet("floor", (Run("one", columns),), baseline))


def test_white_noise_is_found_within_a_tenth() -> None:
    np.testing.assert_allclose(noise_floor(recorded()).fast, NOISE_MPS, rtol=0.1)


@pytest.mark.parametrize("extra", [0.05, 0.5])
def test_a_disturbance_that_no_model_has_does_not_raise_the_floor(extra: float) -> None:
    undisturbed, disturbed = noise_floor(recorded()), noise_floor(recorded(extra))
    np.testing.assert_allclose(disturbed.rms, undisturbed.rms, rtol=0.05)
    np.testing.assert_allclose(undisturbed.rms, SLOW_FACTOR * undisturbed.fast)
