"""A grip that only the hardest reversals exceed is found, whatever share of the inertia turns."""

from __future__ import annotations

import pytest

from support.simulated_runs import RICH, noisy_robot
from truing.diagnose.engine import investigate

pytestmark = pytest.mark.slow

NOISE_MPS = 0.003
FOUR_RUNS = tuple(scale * run for scale in (1.0, 0.95) for run in RICH)


@pytest.mark.parametrize(("grip", "spin_share"), [(1.35, 0.45), (0.8, 0.1)])
def test_finite_grip_is_named(grip: float, spin_share: float) -> None:
    slips = {"wheel_slip": {"grip": grip, "spin_share": spin_share}}
    found = investigate(noisy_robot(FOUR_RUNS, slips, NOISE_MPS, 3), lambda _: None, 1)
    assert found.best.effects == ("wheel_slip",)
    assert found.best.value("wheel_slip.grip") == pytest.approx(grip, rel=0.05)
    assert found.best.value("wheel_slip.spin_share") == pytest.approx(spin_share, abs=0.1)
