"""An explanation that came second in one step is compared beside the other effects of the model."""

from __future__ import annotations

import pytest

from support.simulated_runs import RICH, noisy_robot
from truing.diagnose.engine import investigate

pytestmark = pytest.mark.slow

NOISE_MPS = 0.004
SIX_RUNS = tuple(scale * run for scale in (1.0, 0.8, 0.9) for run in RICH)
EFFECTS = {
    "driver_deadband": {"deadband": 0.05},
    "input_delay": {"delay": 0.08},
    "quadratic_drag": {"left": 0.3, "right": 0.3},
}


def test_an_effect_of_a_model_is_exchanged_for_one_that_changes_the_signals_alike() -> None:
    found = investigate(noisy_robot(SIX_RUNS, EFFECTS, NOISE_MPS, 3), lambda _: None, 1)
    assert set(found.best.effects) == set(EFFECTS)
    exchanged = [set(names) ^ set(EFFECTS) for names in found.search.fits if len(names) == len(EFFECTS)]
    assert {"input_delay", "driver_lag"} in exchanged
