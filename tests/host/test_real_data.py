"""Real drivetrains: free-run errors of the models stay at or below what is known to be reachable.

Errors are in per cent of the 98th percentile of |speed| over the set, all runs fitted together with
equal weight; the bars are the known figures plus 10 %.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from truing.identify.grey_box import WheelFit, fit_wheel
from truing.identify.model_ladder import fit_models
from truing.recording.reader import read_recording_set
from truing.recording.run import Wheel

pytestmark = pytest.mark.recordings

MINIBOT = "frc_frc5024_2020__MinibotCarpet20200124-1730"
PIPERSERVANT = "frc_frc5024_2020__Piperservant20200206-1721"
ARMADA = "frc_armada2508_2020__data20200509-1153"
TEAM_2881 = "frc_frc2881_2022__sysid_data20220227-150426"
TEAM_4099 = "frc_team4099__CharacterizationTestOutput"

# Friction and delay; per cent.
KNOWN: list[tuple[str, Wheel, float]] = [
    (MINIBOT, "left", 1.0),
    (PIPERSERVANT, "left", 2.0),
    (ARMADA, "right", 2.9),
    (TEAM_2881, "left", 1.1),
    (TEAM_4099, "left", 2.1),
]


@cache
def fitted(folder: Path, wheel: Wheel, structure: str) -> WheelFit:
    recordings = read_recording_set(folder)
    return fit_wheel(recordings.runs, wheel, structure, recordings.baseline)


@pytest.mark.parametrize(("name", "wheel", "known_percent"), KNOWN)
def test_friction_and_delay_reach_the_known_free_run_error(
    recordings: Path, name: str, wheel: Wheel, known_percent: float
) -> None:
    fit = fitted(recordings / "real" / name, wheel, "delay")
    assert fit.free_run.percent <= 1.1 * known_percent


@pytest.mark.parametrize(("name", "wheel", "known_percent"), KNOWN)
def test_every_step_of_physics_lowers_the_error_and_no_step_raises_it(
    recordings: Path, name: str, wheel: Wheel, known_percent: float
) -> None:
    folder = recordings / "real" / name
    linear, friction, delay = (
        fitted(folder, wheel, step).free_run.percent for step in ("linear", "friction", "delay")
    )
    assert linear >= friction >= delay * (1.0 - 1e-6)
    assert delay < 0.65 * linear


def test_a_delay_learnt_from_three_runs_holds_on_the_fourth(recordings: Path) -> None:
    for name, wheel in ((MINIBOT, "left"), (TEAM_2881, "left"), (TEAM_4099, "left")):
        linear = fitted(recordings / "real" / name, wheel, "linear").held_out
        delay = fitted(recordings / "real" / name, wheel, "delay").held_out
        assert linear is not None
        assert delay is not None
        assert delay.percent < 0.6 * linear.percent


def test_a_recorders_own_filter_is_found_where_position_and_speed_disagree(recordings: Path) -> None:
    # On this file the reported speed lags the differenced position by about a tenth of a second.
    delay = fitted(recordings / "real" / TEAM_4099, "left", "delay")
    window = fitted(recordings / "real" / TEAM_4099, "left", "recorder_window")
    assert window.free_run.percent < 0.8 * delay.free_run.percent
    assert 0.1 < window.physics.recorder_window_s < 0.35
    assert window.physics.time_constant_s < 0.6 * delay.physics.time_constant_s


def test_one_run_that_carries_the_dynamics_alone_shows_when_it_is_left_out(recordings: Path) -> None:
    # Two slow ramps do not tell the time constant of the one fast run.
    held_out = fitted(recordings / "real" / ARMADA, "right", "delay").held_out
    assert held_out is not None
    assert max(held_out.by_run_mps, key=lambda name: held_out.by_run_mps[name]) == "03_fast_forward"
    right = fit_models(read_recording_set(recordings / "real" / ARMADA), richer=True).wheels[1]
    assert right.chosen.structure.name == "delay"
    assert any("03_fast_forward" in line for line in right.missing)


def test_a_whole_set_is_fitted_and_written_as_one_robot(recordings: Path) -> None:
    models = fit_models(read_recording_set(recordings / "real" / PIPERSERVANT))
    robot = models.robot_model()
    assert robot.left.friction == pytest.approx(robot.right.friction, rel=0.2)
    assert robot.rate_hz == pytest.approx(50.0, rel=0.02)
    for wheel in models.wheels:
        assert wheel.arx is not None
        assert wheel.state_space is not None
        assert wheel.chosen.held_out is not None
        # A linear model cannot do what friction does, whatever its order.
        assert wheel.chosen.held_out.percent < 0.6 * wheel.arx.held_out_free_run.percent
        assert wheel.chosen.held_out.percent < 0.6 * wheel.state_space.held_out_free_run.percent
