"""Step metrics: levels are found, gains and time constants are right, and what cannot be known says why."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from support.first_order_robot import BASELINE, TEST_XI, FirstOrderRobot
from truing.identify.levels import find_levels
from truing.identify.step_metrics import StepMetrics, step_metrics
from truing.recording.run import Run

STEP_TIMES = [1.0, 3.0, 5.0, 7.0]
ONE_LEVEL = ((1.0, 0.0), (2.0, 0.30), (2.0, 0.0))


def steps_of(run: Run, wheel: str = "left") -> tuple[StepMetrics, ...]:
    steps, reason = step_metrics(run, wheel, BASELINE)  # type: ignore[arg-type]
    assert reason is None, reason
    return steps


def reason_of(run: Run, wheel: str = "left") -> str:
    steps, reason = step_metrics(run, wheel, BASELINE)  # type: ignore[arg-type]
    assert steps == ()
    assert reason is not None
    return reason


@pytest.mark.parametrize("columns", [("ticks", "cmd"), ("vel",), ("pos",)])
@pytest.mark.parametrize("shift", [0.0, 0.013, 0.037])
def test_step_times_are_resolved_inside_a_sampling_interval(columns: tuple[str, ...], shift: float) -> None:
    steps = steps_of(FirstOrderRobot().drive(TEST_XI, start_s=shift, columns=columns))
    assert [step.input for step in steps] == pytest.approx([0.35, 0.50, 0.45, 0.0], abs=1e-4)
    assert [step.start_s for step in steps] == pytest.approx([t + shift for t in STEP_TIMES], abs=0.001)
    assert [step.direction for step in steps] == ["up", "up", "down", "down"]


def test_the_gain_is_the_mean_speed_over_the_last_forty_per_cent() -> None:
    robot = FirstOrderRobot(gain_mps=1.45, time_constant_s=0.6)
    step = steps_of(robot.drive(ONE_LEVEL, columns=("vel", "cmd")))[0]
    # Mean of 1 - exp(-t / 0.6) over t from 1.2 s to 2 s: the wheel has not quite settled.
    mean = 1.0 - 0.6 / 0.8 * (math.exp(-1.2 / 0.6) - math.exp(-2.0 / 0.6))
    assert step.gain.value == pytest.approx(14.5 * mean, rel=1e-4)
    assert step.gain.unit == "mm/s per %"
    assert any("not settled" in note for note in step.notes)


def test_a_settled_level_has_no_remark() -> None:
    assert all(step.notes == () for step in steps_of(FirstOrderRobot(time_constant_s=0.2).drive(TEST_XI)))


def by_definition(time_constant: float, level_s: float = 2.0) -> float:
    """What 63.2 % of the way to the mean over the last 40 % of a level gives for a first-order wheel.

    The mean falls a little short of the final speed, and the crossing comes that much earlier.
    """
    window = 0.4 * level_s
    begin, end = math.exp(-(level_s - window) / time_constant), math.exp(-level_s / time_constant)
    mean = 1.0 - time_constant / window * (begin - end)
    return -time_constant * math.log(1.0 - (1.0 - math.exp(-1.0)) * mean)


@pytest.mark.parametrize("time_constant", [0.15, 0.25, 0.40, 0.60])
@pytest.mark.parametrize("rate", [20.0, 50.0, 200.0])
def test_time_constants_up_and_down_are_those_of_the_robot(time_constant: float, rate: float) -> None:
    run = FirstOrderRobot(time_constant_s=time_constant).drive(TEST_XI, rate_hz=rate, columns=("vel", "cmd"))
    first, *_, last = steps_of(run)
    # A chord through two samples misses an exponential by the square of their distance.
    chord = 0.004 + 0.15 * (1.0 / rate / time_constant) ** 2
    for step in (first, last):
        assert step.time_constant.value == pytest.approx(by_definition(time_constant), rel=chord)


def test_time_constants_from_counts_differ_by_no_more_than_counting_can_cause() -> None:
    for seed in range(5):
        run = FirstOrderRobot().drive(TEST_XI, start_s=0.001 * seed)
        large_steps = [step for step in steps_of(run) if abs(step.input - step.previous) > 0.3]
        assert len(large_steps) == 2
        for step in large_steps:
            assert step.time_constant.value == pytest.approx(0.30, rel=0.03)


def test_both_directions_of_rotation_are_measured_alike() -> None:
    plan = ((1.0, 0.0), (3.0, -0.30), (3.0, 0.30), (3.0, 0.0))
    steps = steps_of(FirstOrderRobot().drive(plan, columns=("vel", "cmd")))
    assert [step.direction for step in steps] == ["up", "reversal", "down"]
    assert [step.gain.value for step in steps[:2]] == pytest.approx([14.5, 14.5], rel=0.01)
    assert [step.time_constant.value for step in steps] == pytest.approx([0.3, 0.3, 0.3], rel=0.025)


def test_velocity_mode_gives_a_ratio() -> None:
    plan = ((1.0, 0.0), (3.0, 0.30), (2.0, 0.0))
    step = steps_of(FirstOrderRobot().drive(plan, mode="velocity"))[0]
    assert step.kind == "velocity"
    assert step.gain.unit == "1"
    assert step.gain.value == pytest.approx(1.0, abs=0.01)


def test_a_rest_in_another_mode_is_just_a_rest() -> None:
    run = FirstOrderRobot().drive(ONE_LEVEL, mode="velocity")
    command = run.columns["cmd_left"]
    mixed = tuple("velocity" if value else "effort" for value in command)
    assert [step.input for step in steps_of(replace(run, mode=mixed))] == [0.30, 0.0]
    idle = tuple("velocity" if value else "idle" for value in command)
    assert [step.input for step in steps_of(replace(run, mode=idle))] == [0.30, 0.0]


def test_effort_and_velocity_commands_in_one_run_are_not_mixed_up() -> None:
    run = FirstOrderRobot().drive(TEST_XI)
    mode = tuple("velocity" if t > 4.0 else "effort" for t in run.t_s)
    assert "mixes" in reason_of(replace(run, mode=mode))


def test_the_wheel_that_is_not_driven_says_so() -> None:
    run = FirstOrderRobot().drive(ONE_LEVEL, right_share=0.0)
    assert steps_of(run, "left")
    assert "never steps" in reason_of(run, "right")
    bare = FirstOrderRobot().drive(ONE_LEVEL, right_share=0.0, columns=("vel",))
    assert "never driven" in reason_of(bare, "right")


def test_a_ramp_is_no_staircase() -> None:
    ramp = tuple((0.05, 0.002 * k) for k in range(200))
    assert "keeps changing" in reason_of(FirstOrderRobot().drive(ramp, columns=("vel",)))
    assert "keeps changing" in reason_of(FirstOrderRobot().drive(ramp, columns=("vel", "cmd")))


def test_a_step_whose_voltage_wanders_with_the_supply_is_one_step() -> None:
    sagging = ((1.0, 0.0), (0.06, 0.51), (0.1, 0.43), (0.3, 0.46), (2.5, 0.487))
    steps = steps_of(FirstOrderRobot().drive(sagging, rate_hz=50.0, columns=("vel",)))
    assert len(steps) == 1
    assert steps[0].start_s == pytest.approx(1.0, abs=0.02)
    assert steps[0].input == pytest.approx(0.487, abs=0.002)
    assert steps[0].gain.value == pytest.approx(14.5, rel=0.005)


def test_a_level_too_short_to_settle_gives_no_number() -> None:
    plan = ((1.0, 0.0), (0.3, 0.5), (2.0, 0.0))
    short = steps_of(FirstOrderRobot().drive(plan, rate_hz=10.0))[0]
    assert short.gain.value is None
    assert "lasts only" in str(short.gain.reason)
    assert short.time_constant.value is None


def test_no_gain_at_zero_input() -> None:
    last = steps_of(FirstOrderRobot().drive(ONE_LEVEL))[-1]
    assert last.gain.value is None
    assert last.gain.reason == "no gain at zero input"
    assert last.time_constant.value is not None


def test_a_wheel_that_does_not_answer_has_no_time_constant() -> None:
    run = FirstOrderRobot().drive(ONE_LEVEL)
    stuck = run.columns | {"ticks_left": np.zeros(len(run))}
    step = steps_of(replace(run, columns=stuck))[0]
    assert step.gain.value == 0.0
    assert step.time_constant.value is None
    assert "ripple" in str(step.time_constant.reason)


def test_a_wheel_faster_than_the_log_says_so() -> None:
    step = steps_of(FirstOrderRobot(time_constant_s=0.01).drive(ONE_LEVEL))[0]
    assert step.time_constant.value is None
    assert "shorter than the log can show" in str(step.time_constant.reason)
    coarse = steps_of(FirstOrderRobot(time_constant_s=0.07).drive(ONE_LEVEL))[0]
    assert any("coarse" in note for note in coarse.notes)


def test_a_run_that_begins_under_way_has_a_gain_but_no_rise() -> None:
    whole = FirstOrderRobot().drive(ONE_LEVEL, columns=("vel",))
    keep = whole.t_s >= 1.8
    run = replace(whole, columns={name: values[keep] for name, values in whole.columns.items()})
    first = steps_of(run)[0]
    assert first.gain.value == pytest.approx(14.5, rel=0.01)
    assert first.time_constant.value is None
    assert "begins at this level" in str(first.time_constant.reason)


def test_uneven_sampling_does_not_move_the_numbers() -> None:
    run = FirstOrderRobot(jitter=0.6).drive(TEST_XI, columns=("vel", "cmd"), seed=4)
    assert np.ptp(np.diff(run.t_s)) > 0.02
    for step in steps_of(run)[:3]:
        assert step.gain.value == pytest.approx(14.5, rel=0.01)
        assert step.time_constant.value == pytest.approx(0.30, rel=0.06)


def test_levels_of_a_command_cover_the_whole_run() -> None:
    run = FirstOrderRobot().drive(TEST_XI)
    levels = find_levels(run, "left").levels
    assert sum(level.duration_s for level in levels) == pytest.approx(run.duration_s)
