"""An explanation that came second in one step is compared beside the other effects of the model."""

from __future__ import annotations

import pytest

from support.simulated_runs import RICH, noisy_robot
from truing.diagnose.applicable import applicable_effects
from truing.diagnose.engine import initial_fit, investigate
from truing.diagnose.exchanges import extended_exchange
from truing.diagnose.search import Search
from truing.diagnose.simulation.simulator import SetSimulator

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


def test_an_exchanged_effect_takes_what_only_it_can_be_extended_by() -> None:
    """A dead band and friction are alike; only friction differs between directions."""
    friction = {"coulomb_friction": {"left": 0.05, "right": 0.05}}
    directions = {"direction_asymmetry": {"friction_left": 1.5, "friction_right": 1.5}}
    data = noisy_robot(SIX_RUNS, friction | directions, NOISE_MPS, 3)
    stage = initial_fit(data, SetSimulator(data, data.baseline))
    search = Search.from_baseline(stage.problem, stage.base, applicable_effects(data), 1)
    for name in ("driver_deadband", "coulomb_friction"):
        search.fits[name,] = search.with_effect(stage.base, name)
    _, best = extended_exchange(search, search.fits["driver_deadband",])
    assert set(best.effects) == {"coulomb_friction", "direction_asymmetry"}
