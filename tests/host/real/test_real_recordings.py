"""Real robots, diagnosed without friction and delay: what must be found, and what must not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from truing.diagnose.data.encoder_faults import find_encoder_fault
from truing.diagnose.data.set_data import set_data
from truing.diagnose.diagnosis_input import Options
from truing.diagnose.effects.speed_filter import direct_lag
from truing.diagnose.engine import diagnose
from truing.diagnose.result import NAMING, Diagnosis
from truing.studies.real.drivetrains import read_drivetrain, set_folders
from truing.studies.real.emps import read_emps, travel_error_mm
from truing.studies.real.mrclam import FULL_SPEED_MPS, read_mrclam
from truing.studies.real.plain_fit import Drop, PlainJudge
from truing.studies.real.study import FILTER, FRICTION

# In one process: the diagnosis of a set serves all its tests.
pytestmark = [pytest.mark.recordings, pytest.mark.slow, pytest.mark.xdist_group("real_recordings")]

MINIBOT, PIPERSERVANT, ARMADA, TEAM_2881, TEAM_4099 = (
    "frc_frc5024_2020__MinibotCarpet20200124-1730",
    "frc_frc5024_2020__Piperservant20200206-1721",
    "frc_armada2508_2020__data20200509-1153",
    "frc_frc2881_2022__sysid_data20220227-150426",
    "frc_team4099__CharacterizationTestOutput",
)
DRY = {"coulomb_friction", "stribeck_friction", "driver_deadband"}
LATE = {"input_delay", "driver_lag", "speed_filter"}


@cache
def judge(folder: Path) -> PlainJudge:
    return PlainJudge(set_data(read_drivetrain(folder)))


@cache
def diagnosis(folder: Path) -> Diagnosis:
    return diagnose(read_drivetrain(folder))


def drop(one: PlainJudge, effects: tuple[str, ...], wheel: int) -> Drop:
    return one.drop(one.unseen(effects[:-1]), one.unseen(effects), (wheel,))


def per_cent(one: PlainJudge, error: float, wheel: int) -> float:
    return 100.0 * error / float(np.percentile(np.abs(one.data.speed_mps[:, wheel]), 98.0))


def test_every_set_is_found(recordings: Path) -> None:
    assert {path.name for path in set_folders(recordings)} >= {
        MINIBOT, PIPERSERVANT, ARMADA, TEAM_2881, TEAM_4099,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "wheel", "effects", "known_percent"),
    [
        (MINIBOT, 0, (FRICTION,), 1.57),
        (PIPERSERVANT, 0, (FRICTION,), 2.07),
        (PIPERSERVANT, 1, (FRICTION,), 3.26),
        (TEAM_2881, 0, (FRICTION, FILTER), 1.51),
        (TEAM_2881, 1, (FRICTION, FILTER), 1.60),
        (TEAM_4099, 0, (FILTER,), 2.55),
    ],
)
def test_what_is_known_of_a_drivetrain_lowers_its_unseen_error_to_the_known_one(
    recordings: Path, name: str, wheel: int, effects: tuple[str, ...], known_percent: float
) -> None:
    one = judge(recordings / "real" / name)
    fell = drop(one, effects, wheel)
    assert fell.lowers
    assert per_cent(one, fell.after, wheel) <= 1.05 * known_percent


def test_friction_harms_where_an_encoder_is_at_fault(recordings: Path) -> None:
    assert not drop(judge(recordings / "real" / MINIBOT), (FRICTION,), 1).lowers


def test_a_recorders_filter_shows_in_its_own_positions(recordings: Path) -> None:
    for name, min_s, max_s in ((ARMADA, 0.03, 0.06), (TEAM_2881, 0.12, 0.17), (TEAM_4099, 0.11, 0.15)):
        lag = direct_lag(judge(recordings / "real" / name).data)
        assert lag is not None
        assert min_s < lag.time_constant_s < max_s, name
        assert lag.rms_mps < 0.25 * lag.rms_without_mps


def test_one_encoder_and_no_other_is_told_from_missing_physics(recordings: Path) -> None:
    for folder in set_folders(recordings):
        one = read_drivetrain(folder)
        assert one.baseline is not None
        found = find_encoder_fault(one, one.baseline)
        assert (None if found is None else found.wheel) == ("right" if folder.name == MINIBOT else None)


def test_the_minibots_right_encoder_is_located_and_called_at_fault_and_never_friction(
    recordings: Path,
) -> None:
    done = diagnosis(recordings / "real" / MINIBOT)
    assert done.verdict == "partly_explained"
    assert {span.signal for span in done.mismatch} == {"vel_right_mps"}
    assert {span.run for span in done.mismatch} == set(done.runs)
    check = next(check for check in done.checks if check.topic == "encoder")
    assert check.wheel == "right"
    assert "34 to 61 %" in check.text
    assert done.left_over_share > 0.9


def test_what_the_minibots_sound_wheel_lacks_is_named_of_that_wheel_alone(recordings: Path) -> None:
    done = diagnosis(recordings / "real" / MINIBOT)
    assert "coulomb_friction" in {effect.name for effect in done.effects}
    assert {effect.scope for effect in done.effects} == {"left"}
    assert not any("right" in name for effect in done.effects for name in effect.parameters)
    assert done.fit.model_rmse < 0.2 * done.fit.refit_rmse


@pytest.mark.parametrize("name", [MINIBOT, ARMADA, PIPERSERVANT, TEAM_2881, TEAM_4099])
def test_what_is_named_lowers_the_unseen_error(recordings: Path, name: str) -> None:
    folder = recordings / "real" / name
    one = read_drivetrain(folder)
    assert one.baseline is not None
    bad = find_encoder_fault(one, one.baseline)
    done = diagnosis(folder)
    wheels = (0,) if bad is not None else (0, 1)
    first = tuple(effect.name for effect in done.effects if effect.explanation == 0)
    assert bool(first) == (done.verdict in NAMING)
    if first:
        judged = judge(folder)
        assert judged.drop(judged.unseen(()), judged.unseen(first), wheels).lowers


def test_friction_and_lateness_are_named_on_a_plain_drivetrain(recordings: Path) -> None:
    done = diagnosis(recordings / "real" / ARMADA)
    assert done.verdict in NAMING
    found = {effect.name for effect in done.effects}
    assert found & DRY
    assert found & LATE


def test_friction_and_its_asymmetry_on_the_emps_axis_hold_on_the_second_file(recordings: Path) -> None:
    first, second = read_emps(recordings)
    one = PlainJudge(set_data(first))
    both = (FRICTION, "direction_asymmetry")
    assert drop(one, (FRICTION,), 0).lowers
    fell = drop(one, both, 0)
    assert fell.lowers
    assert fell.after < 0.35 * one.rms(one.unseen(()).error, (0,))
    there = {effects: travel_error_mm(second, effects, one.unseen(effects).theta) for effects in ((), both)}
    assert there[both] < 0.4 * there[()]
    assert not one.data.valid[:, 1].any()


def test_the_commanded_twist_of_mrclam_comes_late(recordings: Path) -> None:
    whole = read_mrclam(recordings)
    runs = replace(whole, runs=whole.runs[::2])
    done = diagnose(runs, Options(commanded=True))
    assert done.verdict == "missing_physics"
    assert done.effects[0].name == "input_delay"
    delay = done.effects[0].parameters["delay"]
    assert 0.05 < delay.ci95[0] < delay.ci95[1] < 0.2
    assert done.effects[0].heldout_rmse_after < done.effects[0].heldout_rmse_before
    gains = [entry.with_effects.value for entry in done.numbers if entry.name == "gain_mps"]
    assert all(0.94 < gain / FULL_SPEED_MPS < 0.96 for gain in gains)
