"""The assembled simulation: effects that are off do nothing, numbers are found again, new files join in."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy

from support.simulated_runs import GAIN, RICH, TAU, by_run, levels, recordings
from truing.diagnose.catalogue import CATALOGUE, Catalogue
from truing.diagnose.simulation.simulator import SetSimulator
from truing.errors import TruingError

DATA_FORMAT = Path(__file__).parents[3] / "docs/DATA_FORMAT.md"

# Strengths to hide and to find again, as numbers of the simulator's vector, by effect.
HIDDEN: dict[str, dict[str, float]] = {
    "coulomb_friction": {"left": 0.05, "right": 0.07},
    "stribeck_friction": {"left": 0.03, "right": 0.05, "excess_left": 0.06, "excess_right": 0.08},
    "turning_scrub": {"scrub": 0.06},
    "quadratic_drag": {"left": 0.15, "right": 0.1},
    "supply_sag": {"drop_at_stall": 0.15, "drop_over_set": 0.08},
    "winding_heating": {"gain_drop": 0.1},
    "input_delay": {"delay": 0.06},
    "driver_lag": {"time_constant": 0.08},
    "driver_deadband": {"deadband": 0.06},
    "current_limit": {"limit": 0.6},
    "speed_limit": {"limit": 0.5},
    "direction_asymmetry": {"left": 0.9, "right": 1.1},
    "coast_decay": {"release": 0.4},
    "gear_backlash": {"left": 0.08, "right": 0.06},
    "encoder_dropout": {"left": 0.1, "right": 0.15},
    "inertia_coupling": {"coupling": 0.2},
    "floor_slope": {"uphill_cosine": 0.02, "uphill_sine": 0.01},
    "wheel_slip": {"grip": 0.7},
    "payload_change": {"time_constant_ratio": 1.3},
    "speed_filter": {"time_constant": 0.08},
}


def documented() -> dict[str, dict[str, str]]:
    """Parameters and their units of each effect in docs/DATA_FORMAT.md, in the page's order."""
    page = DATA_FORMAT.read_text(encoding="utf-8").split("\n## 5. ")[1].split("\n## ")[0]
    effects, parameters = page.split("| effect | parameter |")
    found: dict[str, dict[str, str]] = {name: {} for name in re.findall(r"^\| `(\w+)` \|", effects, re.M)}
    for name, parameter, unit in re.findall(r"^\| `(\w+)` \| `(\w+)` \| (.+?) \|", parameters, re.M):
        found[name][parameter] = unit
    return found


def test_the_catalogue_is_the_documented_one() -> None:
    simulator = SetSimulator(recordings())
    assert {name: simulator.units(name) for name in CATALOGUE} == documented()
    assert len(CATALOGUE) == 27
    assert all(effect.name == name for name, effect in CATALOGUE.items())
    assert set(HIDDEN) <= set(CATALOGUE)


def test_the_baseline_is_the_first_order_step_in_closed_form() -> None:
    data = recordings((levels((0.5, -0.4)),))
    simulator = SetSimulator(data)
    speed = simulator.speeds(simulator.start(), simulator.enabled([]))
    t = np.maximum(data.t_s - 0.5, 0.0)
    for w, effort in enumerate((0.5, -0.4)):
        travel = GAIN[w] * effort * (t - TAU[w] * (1.0 - np.exp(-t / TAU[w])))
        np.testing.assert_allclose(speed[1:, w], np.diff(travel) * 20.0, atol=1e-9)


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_an_effect_that_is_off_changes_not_one_bit(name: str) -> None:
    simulator = SetSimulator(recordings())
    theta = simulator.start()
    free = simulator.speeds(theta, simulator.enabled([]))
    for item in CATALOGUE[name].parameters:
        theta[simulator.layout.index(f"{name}.{item.name}")] = item.starts[-1] if item.starts else item.off
    np.testing.assert_array_equal(simulator.speeds(theta, simulator.enabled([])), free)


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_an_effect_at_nothing_is_the_baseline(name: str) -> None:
    simulator = SetSimulator(recordings())
    free = simulator.speeds(simulator.start(), simulator.enabled([]))
    nothing = simulator.speeds(simulator.start(), simulator.enabled([name]))
    # A gap of zero is no gap and an endless grip does not slide; only rounding is left.
    np.testing.assert_allclose(nothing, free, atol=1e-6)


@pytest.mark.parametrize("name", HIDDEN)
def test_numbers_that_made_a_log_are_found_in_it(name: str) -> None:
    source = "vel" if name == "speed_filter" else "pos"
    first = SetSimulator(recordings(source=source))
    hidden = first.start()
    for key, value in HIDDEN[name].items():
        hidden[first.layout.index(f"{name}.{key}")] = value
    hidden[:4] *= (1.04, 0.95, 0.97, 1.05)
    on = first.enabled([name])
    made = first.speeds(hidden, on)
    simulator = SetSimulator(recordings(RICH, by_run(first.data, made), source=source))
    data, layout = simulator.data, simulator.layout
    # Gravity needs a heading, which this log's wheels give; the hidden robot is made with the same one.
    if name == "floor_slope":
        made = simulator.speeds(hidden, on)
    free = [0, 1, 2, 3, *(layout.index(f"{name}.{key}") for key in HIDDEN[name])]
    theta = simulator.start()
    if name == "speed_filter":
        free = free[4:]  # beside the time constant of the wheel, the two lags are not distinguishable
        theta[:4] = hidden[:4]

    def place(x: np.ndarray) -> np.ndarray:
        theta[free] = x
        return theta

    start = hidden[free] + 0.3 * (simulator.start()[free] - hidden[free])
    start = np.where(np.isclose(start, hidden[free]), hidden[free] * 0.9, start)
    if name in ("current_limit", "speed_limit", "wheel_slip"):
        start[-1] = 1.15 * hidden[free[-1]]
    found = scipy.optimize.least_squares(
        lambda x: (simulator.speeds(place(x), on) - made)[data.judged].ravel(),
        start,
        jac=lambda x: simulator.jacobian(place(x), on, free)[data.judged].reshape(-1, len(free)),
        x_scale=np.maximum(np.abs(hidden[free]), 1e-3),
        xtol=1e-10,
        max_nfev=60,
    )
    np.testing.assert_allclose(found.x, hidden[free], rtol=2e-3, atol=2e-4)


def test_derivatives_of_both_wheels_come_from_one_simulation() -> None:
    simulator = SetSimulator(recordings())
    on = simulator.enabled(["coulomb_friction"])
    theta = simulator.start()
    places = [simulator.layout.index(f"coulomb_friction.{side}") for side in ("left", "right")]
    theta[places] = 0.05
    together = simulator.jacobian(theta, on, [0, 2, *places])
    for k, place in enumerate([0, 2, *places]):
        alone = simulator.jacobian(theta, on, [place])[:, :, 0]
        # A stop of one wheel cuts the other's substep too, and what is left below 1e-10 s is dropped;
        # over the step of 3e-6 that friction's difference takes, that is the fifth decimal of a gain of 1.45.
        np.testing.assert_allclose(together[:, :, k], alone, atol=1e-4)


def test_runs_can_be_simulated_alone() -> None:
    simulator = SetSimulator(recordings())
    on = simulator.enabled(["winding_heating", "coulomb_friction"])
    theta = simulator.start()
    theta[simulator.layout.index("winding_heating.gain_drop")] = 0.2
    whole = simulator.speeds(theta, on)
    part = simulator.select([1])
    np.testing.assert_array_equal(part.speeds(theta, on), whole[part.rows])


def test_the_baseline_brings_its_own_effects() -> None:
    data = recordings(effects={"coulomb_friction": {"left": 0.04, "right": 0.05}})
    simulator = SetSimulator(data)
    assert simulator.enabled([]).sum() == 1
    assert simulator.report("coulomb_friction", simulator.start()) == {"left": 0.04, "right": 0.05}


def test_an_effect_that_nobody_knows_is_refused_by_name() -> None:
    with pytest.raises(TruingError, match="magic"):
        SetSimulator(recordings(effects={"magic": {}}))


def test_a_file_dropped_into_a_folder_of_effects_is_part_of_the_simulation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "dropped_effects"
    folder.mkdir()
    (folder / "__init__.py").write_text('"""Effects."""\n')
    (folder / "headwind.py").write_text(
        '"""A constant push backwards."""\n'
        "from truing.diagnose.effect import Effect, Parameter\n\n\n"
        "def push(force):\n    return -force\n\n\n"
        "EFFECT = Effect('headwind', 'headwind', 'u - f', 'weather', 'slow', {}, 'driving',\n"
        "                (Parameter('force', 'effort', 0.0, 1.0, 0.0, (0.1,)),))\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    catalogue = Catalogue(("dropped_effects",))
    assert catalogue.names == ("headwind",)
    simulator = SetSimulator(recordings((np.full((60, 2), 0.5),)), catalogue=catalogue)
    theta = simulator.start()
    theta[simulator.layout.index("headwind.force")] = 0.1
    speed = simulator.speeds(theta, simulator.enabled(["headwind"]))
    np.testing.assert_allclose(speed[-1], 0.4 * GAIN, rtol=1e-2)
    sys.modules.pop("dropped_effects.headwind", None)


def circle() -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """A steady arc in closed form: efforts, truth, wheel speeds."""
    n = 101
    speed = np.tile([0.3, 0.4], (n, 1))
    turn = (0.4 - 0.3) / 0.283 * np.arange(n) / 20.0
    radius = 0.35 / ((0.4 - 0.3) / 0.283)
    truth = {
        "truth_x_m": 1.0 + radius * np.sin(turn),
        "truth_y_m": 2.0 + radius * (1.0 - np.cos(turn)),
        "truth_theta_rad": turn,
    }
    return speed / GAIN, truth, speed


def test_a_pose_that_the_wheels_explain_leaves_nothing() -> None:
    effort, truth, speed = circle()
    simulator = SetSimulator(recordings((effort,), (speed,), extra=(truth,)))
    left = simulator.pose_residuals(simulator.start(), simulator.enabled([]), 1.0)
    assert left.shape == (5, 3)
    np.testing.assert_allclose(left, 0.0, atol=1e-5)
    np.testing.assert_array_equal(simulator.pose_runs(2, 1.0), [0, 0, 1, 1, 2])


def test_a_gyro_alone_judges_the_turn() -> None:
    effort, _, speed = circle()
    gyro = {"gyro_z_radps": np.full(101, 1.1 * 0.1 / 0.283)}
    simulator = SetSimulator(recordings((effort,), (speed,), extra=(gyro,)))
    left = simulator.pose_residuals(simulator.start(), simulator.enabled([]), 1.0)
    assert np.isnan(left[:, :2]).all()
    np.testing.assert_allclose(left[:, 2], 0.1 * 0.1 / 0.283, atol=1e-9)


def test_truth_at_the_end_points_alone_makes_one_window_of_the_run() -> None:
    effort, truth, speed = circle()
    ends = {name: np.where(np.arange(101) < 100, column[0], column) for name, column in truth.items()}
    simulator = SetSimulator(recordings((effort,), (speed,), extra=(ends,)))
    left = simulator.pose_residuals(simulator.start(), simulator.enabled([]), 1.0)
    assert left.shape == (1, 3)
    np.testing.assert_allclose(left, 0.0, atol=1e-4)
