"""The data are looked at before anything is fitted: what stops a diagnosis, what limits it, what is said."""

from __future__ import annotations

import numpy as np
import pytest

from support.recorded_sets import Columns, baseline, columns, recordings, with_speeds
from truing.diagnose.applicable import applicable_effects
from truing.diagnose.data.checks import DataChecks, check_data
from truing.diagnose.data.set_data import set_data
from truing.errors import TruingError
from truing.recording.run import RecordingSet, Run


def topics(checks: DataChecks) -> set[str]:
    return {check.topic for check in checks.checks}


def one(checks: DataChecks, topic: str) -> str:
    return next(str(check) for check in checks.checks if check.topic == topic)


def refusal(set_: RecordingSet) -> str:
    with pytest.raises(TruingError) as caught:
        check_data(set_)
    assert caught.value.exit_code == 2
    assert "\n" not in caught.value.message
    assert caught.value.next_step
    return caught.value.message


def test_clean_runs_are_all_usable_and_only_the_missing_pose_is_mentioned() -> None:
    checks = check_data(recordings())
    assert checks.wheels == ("left", "right")
    assert checks.geometry
    assert all(mask.all() for mask in checks.valid)
    assert topics(checks) == {"no_pose"}


def test_a_set_without_a_baseline_is_refused() -> None:
    assert "no baseline" in refusal(RecordingSet("plain", recordings().runs))


@pytest.mark.parametrize(("scale", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_times_in_another_unit_are_named_with_the_file(scale: float, unit: str) -> None:
    def change(name: str, values: Columns) -> None:
        values["t_s"] *= scale

    message = refusal(recordings(change=change))
    assert f"is t_s in {unit}?" in message
    assert "01_levels" in message


@pytest.mark.parametrize(("scale", "unit"), [(12.0, "volts"), (100.0, "per cent")])
def test_efforts_in_volts_or_per_cent_are_refused(scale: float, unit: str) -> None:
    def change(name: str, values: Columns) -> None:
        values["effort_left"] *= scale
        values["effort_right"] *= scale

    assert f"are these {unit}?" in refusal(recordings(change=change))


def test_speeds_in_millimetres_are_named() -> None:
    assert "mm/s" in refusal(recordings(change=lambda name, values: with_speeds(values, 1000.0)))


def test_a_wheel_that_turns_against_its_effort_is_refused_by_name() -> None:
    def change(name: str, values: Columns) -> None:
        values["ticks_right"] *= -1.0

    message = refusal(recordings(change=change))
    assert "the right wheel turns against its effort in every run" in message


def test_leads_swapped_in_one_run_name_that_run() -> None:
    def change(name: str, values: Columns) -> None:
        if name == "03_levels":
            values["ticks_left"] *= -1.0

    assert "the left wheel turns against its effort in 03_levels" in refusal(recordings(change=change))


def test_a_dead_encoder_leaves_the_other_wheel_to_be_judged() -> None:
    def change(name: str, values: Columns) -> None:
        values["ticks_right"][:] = 0.0

    checks = check_data(recordings(change=change))
    assert checks.wheels == ("left",)
    assert not any(mask[:, 1].any() for mask in checks.valid)
    assert "the right wheel never moves, though driven with up to 60 % effort" in one(checks, "dead")


def test_two_dead_encoders_are_refused() -> None:
    def change(name: str, values: Columns) -> None:
        values["ticks_left"][:] = values["ticks_right"][:] = 0.0

    assert "neither wheel ever moves" in refusal(recordings(change=change))


def test_runs_without_any_effort_are_refused() -> None:
    def change(name: str, values: Columns) -> None:
        for name_ in ("effort_left", "effort_right", "ticks_left", "ticks_right"):
            values[name_][:] = 0.0

    assert "no excitation" in refusal(recordings(change=change))


def test_constant_efforts_at_a_steady_speed_are_refused() -> None:
    def change(name: str, values: Columns) -> None:
        values["effort_left"][:] = values["effort_right"][:] = 0.3
        values["ticks_left"] = values["ticks_right"] = np.floor(np.arange(len(values["t_s"])) * 131.0)

    assert "constant efforts" in refusal(recordings(change=change))


def test_a_constant_effort_from_standstill_is_a_step_and_is_judged() -> None:
    values = columns(1, [(0.4, 0.4)] * 4)
    checks = check_data(RecordingSet("plain", (Run("01_step", values),), baseline()))
    assert all(mask.all() for mask in checks.valid)


def test_a_counter_reset_is_left_out_row_by_row() -> None:
    def change(name: str, values: Columns) -> None:
        if name == "02_levels":
            values["ticks_left"][60:] -= 1e6

    checks = check_data(recordings(change=change))
    mask = checks.valid[1]
    assert not mask[60, 0]
    assert mask[:, 0].sum() == len(mask) - 1
    assert mask[:, 1].all()
    assert "row 61 jumps" in one(checks, "jump")


def test_a_counter_that_wraps_is_recognised() -> None:
    def change(name: str, values: Columns) -> None:
        values["ticks_left"][60:] -= 65536.0

    assert "wraps at 65536" in one(check_data(recordings(change=change)), "jump")


def test_one_run_alone_is_diagnosed_with_a_warning() -> None:
    checks = check_data(recordings(1))
    assert checks.checks[0].topic == "few_runs"
    assert checks.checks[0].severity == "warning"
    assert "at least four runs" in checks.checks[0].next_step


def test_a_baseline_without_geometry_blocks_what_needs_a_pose() -> None:
    set_ = recordings(change=lambda name, values: with_speeds(values), geometry=False)
    checks = check_data(set_)
    assert not checks.geometry
    assert {"wheelbase_error", "wheel_radius_error", "wheel_slip", "heading_drift"} <= set(checks.blocked)
    assert "only the wheels' speeds are diagnosed" in one(checks, "geometry")


def test_counts_without_geometry_ask_for_it() -> None:
    assert "encoder counts only" in refusal(recordings(geometry=False))


def test_runs_that_only_go_forward_cannot_show_direction() -> None:
    def change(name: str, values: Columns) -> None:
        values.update(columns(1, [(0.0, 0.0), (0.3, 0.2), (0.5, 0.4), (0.2, 0.5)] * 2))

    assert "direction_asymmetry" in check_data(recordings(change=change)).blocked


def test_straight_runs_cannot_show_scrub_or_coupling() -> None:
    def change(name: str, values: Columns) -> None:
        values["effort_right"], values["ticks_right"] = values["effort_left"], values["ticks_left"]

    assert {"turning_scrub", "inertia_coupling"} <= set(check_data(recordings(change=change)).blocked)


def test_turns_on_the_spot_cannot_separate_scrub_from_friction() -> None:
    def change(name: str, values: Columns) -> None:
        values["effort_right"], values["ticks_right"] = -values["effort_left"], -values["ticks_left"]

    turning = recordings(change=change)
    assert {"turning_scrub", "inertia_coupling"} <= set(check_data(turning).blocked)
    assert not {"turning_scrub", "inertia_coupling"} & set(applicable_effects(set_data(turning)))
    assert "turning_scrub" in applicable_effects(set_data(recordings()))


def test_a_gap_is_mentioned_and_costs_nothing_else() -> None:
    def change(name: str, values: Columns) -> None:
        if name == "01_levels":
            values["t_s"][90:] += 4.0

    checks = check_data(recordings(change=change))
    assert "a gap of 4.05 s" in one(checks, "gap")


def test_a_log_slower_than_the_wheels_blocks_fast_effects() -> None:
    def change(name: str, values: Columns) -> None:
        values["t_s"] *= 20.0
        for side in ("left", "right"):
            values[f"ticks_{side}"] = np.floor(values[f"ticks_{side}"] * 20.0)

    checks = check_data(recordings(change=change))
    assert "input_delay" in checks.blocked
    assert "12 Hz or more" in next(c.next_step for c in checks.checks if c.topic == "slow_log")


def test_an_encoder_that_half_counts_is_a_warning_about_that_wheel() -> None:
    def change(name: str, values: Columns) -> None:
        values["effort_right"] = values["effort_left"].copy()
        values["ticks_right"] = np.floor(0.55 * values["ticks_left"])

    checks = check_data(recordings(change=change))
    check = next(check for check in checks.checks if check.topic == "sides")
    assert (check.wheel, check.severity) == ("right", "warning")


def test_a_run_that_begins_against_its_effort_starts_with_the_motion_it_inherits() -> None:
    def inherit(name: str, values: Columns) -> None:
        with_speeds(values)
        if name.startswith("02"):
            values["effort_left"][:3] = (-0.4, 0.3, 0.3)
            values["vel_left_mps"][:4] = (0.0, -0.2, -0.35, 0.1)

    data = set_data(recordings(change=inherit))
    assert data.initial_mps[:, 0].tolist() == [0.0, -0.35, 0.0, 0.0]
    assert data.initial_mps[:, 1].tolist() == [0.0] * 4
    left = data.valid[data.rows_of(1), 0]
    assert not left[:3].any()
    assert left[3:].all()
    assert data.valid[:, 1].all()


def test_efforts_that_act_after_their_row_are_a_warning_with_the_setting() -> None:
    def change(name: str, values: Columns) -> None:
        for wheel in ("left", "right"):
            effort = values[f"effort_{wheel}"]
            values[f"effort_{wheel}"] = np.append(effort[1:], effort[-1])

    checks = check_data(recordings(change=change))
    (found,) = [check for check in checks.checks if check.topic == "effort_row"]
    assert found.severity == "warning"
    assert 'effort = "after"' in found.next_step
