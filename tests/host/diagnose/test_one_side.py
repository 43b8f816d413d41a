"""A single axis is simulated and fitted as one side: as two that are alike, with its own parameters alone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from support.simulated_runs import levels, noisy_robot, recording_set
from truing.diagnose.applicable import beyond_an_axis
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.data.set_data import SetData, set_data
from truing.diagnose.engine import initial_fit, investigate
from truing.diagnose.noise_floor import noise_floor
from truing.diagnose.result_assembly import mean_of_judged
from truing.diagnose.simulation.simulator import SetSimulator
from truing.progress import ignore_progress
from truing.recording.run import RecordingSet

RUNS = (
    levels((0.6, 0.6), (-0.5, -0.5), (0.2, 0.2), (0.0, 0.0), (-0.9, -0.9), (0.12, 0.12), (0.0, 0.0)),
    levels((0.3, 0.3), (0.8, 0.8), (-0.8, -0.8), (1.0, 1.0), (0.05, 0.05), (0.0, 0.0)),
)
OF_AN_AXIS = sorted(set(CATALOGUE) - beyond_an_axis())


def robot(effects: Mapping[str, Mapping[str, float]] | None = None) -> RecordingSet:
    """Two wheels alike that turned alike, with a little noise."""
    data = noisy_robot(RUNS, {name: dict(of) for name, of in (effects or {}).items()}, 0.002, 3)
    speeds = tuple(np.repeat(data.speed_mps[data.rows_of(k), :1], 2, axis=1) for k in range(data.runs))
    return recording_set(RUNS, speeds, source="vel", equal=True)


@pytest.fixture(scope="module")
def of_both() -> SetData:
    return set_data(robot({"coulomb_friction": {"left": 0.06, "right": 0.06}}))


@pytest.fixture(scope="module")
def of_axis() -> SetData:
    return set_data(robot({"coulomb_friction": {"left": 0.06, "right": 0.06}}).of_axis("translation"))


@pytest.mark.parametrize("name", OF_AN_AXIS)
def test_one_side_moves_as_two_that_are_alike(name: str, of_both: SetData, of_axis: SetData) -> None:
    both, one = SetSimulator(of_both), SetSimulator(of_axis)
    theta = both.start()
    for item in CATALOGUE[name].parameters:
        theta[both.layout.index(f"{name}.{item.name}")] = item.starts[0] if item.starts else item.off
    expected = both.speeds(theta, both.enabled([name]))
    found = one.speeds(theta, one.enabled([name]))
    # Where both stop at once, the second stops in a substep of its own: rounding is left.
    np.testing.assert_allclose(found[:, 0], expected[:, 0], rtol=0.0, atol=1e-8)
    assert not found[:, 1].any()
    assert np.abs(found[:, 0] - one.speeds(theta, one.enabled([]))[:, 0]).max() > 1e-4


def test_what_acts_between_wheels_does_not_act_on_one(of_axis: SetData) -> None:
    simulator = SetSimulator(of_axis)
    theta = simulator.start()
    for name in ("turning_scrub.scrub", "inertia_coupling.coupling"):
        theta[simulator.layout.index(name)] = 0.2
    free = simulator.speeds(theta, simulator.enabled([]))
    between = simulator.speeds(theta, simulator.enabled(["turning_scrub", "inertia_coupling"]))
    np.testing.assert_allclose(between, free, atol=1e-12)


def test_derivatives_of_the_other_side_are_zero_and_take_no_simulation(
    of_axis: SetData, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulator = SetSimulator(of_axis)
    theta, on = simulator.start(), simulator.enabled(["coulomb_friction"])
    free = [simulator.layout.index(f"coulomb_friction.{side}") for side in ("left", "right")]
    asked: list[object] = []
    original = simulator.speeds
    monkeypatch.setattr(simulator, "speeds", lambda *at: asked.append(at) or original(*at))
    found = simulator.jacobian(theta, on, free)
    assert found[:, 0, 0].any()
    assert not found[:, :, 1].any()
    assert len(asked) == 2


def test_an_axis_has_half_the_parameters_and_the_noise_of_one_wheel(
    of_both: SetData, of_axis: SetData
) -> None:
    both, one = (initial_fit(data, SetSimulator(data)).problem for data in (of_both, of_axis))
    for name, count in (("coulomb_friction", 1), ("stribeck_friction", 2), ("driver_deadband", 1)):
        extra = len(one.columns_of((name,))) - len(one.columns_of(()))
        assert extra == count
        assert len(both.columns_of((name,))) - len(both.columns_of(())) in (count, 2 * count)
    np.testing.assert_allclose(noise_floor(of_axis).rms[0], noise_floor(of_both).rms[0])
    assert mean_of_judged(one, one.floor.rms) == one.floor.rms[0]


def test_friction_of_an_axis_is_found(of_axis: SetData) -> None:
    found = investigate(of_axis, ignore_progress, 1, beyond_an_axis())
    assert found.verdict == "missing_physics"
    assert found.best.effects == ("coulomb_friction",)
    assert found.best.value("coulomb_friction.left") == pytest.approx(0.06, abs=0.003)
