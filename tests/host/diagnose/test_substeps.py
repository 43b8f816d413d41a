"""The simulation's substeps are short enough: shorter ones, in any company, give the same speeds."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from support.simulated_runs import RICH, by_run, recordings
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.data.set_data import SetData
from truing.diagnose.simulation.simulator import SetSimulator

WHEEL_EFFECTS = sorted(name for name, effect in CATALOGUE.items() if effect.domain != "pose")
EXACT = sorted(name for name, effect in CATALOGUE.items() if effect.exact)
# Both are solved in closed form alone, and in substeps beside each other.
COMPANY = {"gear_backlash": 3e-3, "wheel_slip": 1e-3}


@cache
def driven() -> SetData:
    """A set whose measured speeds are those of a robot with dry friction: steady, lively and resting rows."""
    first = SetSimulator(recordings())
    theta = first.start()
    for side in ("left", "right"):
        theta[first.layout.index(f"coulomb_friction.{side}")] = 0.05
    return recordings(RICH, by_run(first.data, first.speeds(theta, first.enabled(["coulomb_friction"]))))


def speeds(names: tuple[str, ...], which: int, step_factor: float, off: tuple[str, ...] = ()) -> np.ndarray:
    """Speeds with the weak (0) or the strong (-1) start of these effects; `off` are on at nothing."""
    simulator = SetSimulator(driven(), step_factor=step_factor)
    theta = simulator.start()
    for name in names:
        for item in CATALOGUE[name].parameters:
            if item.starts and item.name != "per_revolution":
                theta[simulator.layout.index(f"{name}.{item.name}")] = item.starts[which]
    return simulator.speeds(theta, simulator.enabled((*names, *off)))


@pytest.mark.parametrize("which", [0, -1], ids=["weak", "strong"])
@pytest.mark.parametrize("name", WHEEL_EFFECTS)
def test_a_tenth_of_the_substep_gives_the_same_speeds(name: str, which: int) -> None:
    change = speeds((name,), which, 1.0) - speeds((name,), which, 0.1)
    assert np.sqrt(np.mean(change**2)) < 1e-4
    assert np.abs(change).max() < 1e-3


@pytest.mark.parametrize("dry", [(), ("coulomb_friction",)], ids=["free", "dry"])
@pytest.mark.parametrize("which", [0, -1], ids=["weak", "strong"])
@pytest.mark.parametrize("name", EXACT)
def test_what_is_solved_in_closed_form_alone_agrees_with_tiny_substeps(
    name: str, which: int, dry: tuple[str, ...]
) -> None:
    names = (name, *dry)
    alone = speeds(names, which, 1.0)
    # Drag of no size asks for substeps and does nothing else.
    np.testing.assert_allclose(alone, speeds(names, which, 0.05, off=("quadratic_drag",)), atol=2e-4)


@pytest.mark.parametrize("name", sorted(COMPANY))
def test_bodies_beside_a_lag_need_their_substeps(name: str) -> None:
    change = speeds((name, "driver_lag"), 0, 1.0) - speeds((name, "driver_lag"), 0, 0.1)
    assert np.abs(change).max() < COMPANY[name]
