"""Keys, lines and arcs become control inputs that a robot can follow, and a sequence that a board takes."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from truing.errors import PlanError
from truing.plan import load_plan
from truing.studies.mom_odometry import NO_ERROR, ErrorModel
from truing.web.limits import Limits
from truing.web.models.error_replay import replay_cycles
from truing.web.path.segments import Node, cycles_of, end_of, segments_through
from truing.web.path.sequence_file import cycles_of_plan, plan_of, save_sequence
from truing.web.path.trajectory import Cycle, KeyTrajectory, braked_to_rest, poses
from truing.web.pose import Pose

LIMITS = Limits()


def within_limits(cycles: list[Cycle], limits: Limits = LIMITS) -> bool:
    spare = 1.0 + 1e-6
    return all(
        abs(now.v_mps) <= limits.speed_mps * spare
        and abs(now.omega_radps) <= limits.yaw_rate_radps * spare
        and abs(now.v_mps) + 0.5 * limits.wheelbase_m * abs(now.omega_radps) <= limits.wheel_mps * spare
        and abs(now.v_mps - before.v_mps) <= limits.accel_mps2 * 0.1 * spare
        and abs(now.omega_radps - before.omega_radps) <= limits.yaw_accel_radps2 * 0.1 * spare
        for before, now in pairwise([Cycle(0.0, 0.0), *cycles, Cycle(0.0, 0.0)])
    )


def test_forward_for_a_second_drives_along_the_heading():
    made = KeyTrajectory(LIMITS, Pose(0.5, 0.5, math.radians(45)))
    for _ in range(10):
        made.cycle(["forward"])
    assert made.pose.x_m == pytest.approx(made.pose.y_m)
    assert made.pose.x_m > 0.6
    assert made.pose.theta_rad == pytest.approx(math.radians(45))


def test_left_turns_left_and_right_turns_right():
    left, right = KeyTrajectory(), KeyTrajectory()
    for _ in range(5):
        left.cycle(["left"])
        right.cycle(["right"])
    assert left.pose.theta_rad == pytest.approx(-right.pose.theta_rad)
    assert left.pose.theta_rad > 0.1


def test_faster_and_slower_stay_between_a_tenth_and_all():
    made = KeyTrajectory()
    for _ in range(20):
        made.change_speed(True)
    assert made.speed_fraction == 1.0
    for _ in range(20):
        made.change_speed(False)
    assert made.speed_fraction == 0.1


@given(st.lists(st.lists(st.sampled_from(["forward", "back", "left", "right"]), max_size=3), max_size=60))
def test_no_keys_ever_leave_the_limits_and_the_end_stands_still(held):
    made = KeyTrajectory(LIMITS, speed_fraction=1.0)
    for keys in held:
        made.cycle(keys)
    cycles = braked_to_rest(made.cycles, LIMITS)
    last = Cycle(0.0, 0.0)
    for cycle in cycles:
        assert abs(cycle.v_mps - last.v_mps) <= LIMITS.accel_mps2 * 0.1 + 1e-5
        assert abs(cycle.omega_radps - last.omega_radps) <= LIMITS.yaw_accel_radps2 * 0.1 + 1e-5
        assert abs(cycle.v_mps) + 0.5 * LIMITS.wheelbase_m * abs(cycle.omega_radps) <= LIMITS.wheel_mps + 1e-5
        last = cycle
    assert (last.v_mps, last.omega_radps) == (0.0, 0.0)


def test_what_holds_the_robot_back_is_named():
    made = KeyTrajectory(LIMITS, speed_fraction=1.0)
    made.cycle(["forward"])
    assert "acceleration" in made.limited_by


point = st.floats(-4, 4).map(lambda value: round(value, 3))


@given(st.lists(st.builds(Node, point, point, st.sampled_from(["line", "arc"])), min_size=1, max_size=6))
def test_lines_and_arcs_end_at_the_last_point_and_their_inputs_lead_there(nodes):
    segments = segments_through(Pose(0.3, -0.2, 0.4), nodes)
    at = Pose(0.3, -0.2, 0.4)
    for segment in segments:
        at = end_of(at, segment)
    cycles = cycles_of(segments, LIMITS)
    assert within_limits(cycles)
    end = poses(Pose(0.3, -0.2, 0.4), cycles)[-1]
    assert end.distance_m(at) < 1e-6
    if segments:
        assert math.hypot(end.x_m - nodes[-1].x_m, end.y_m - nodes[-1].y_m) < 0.021


def test_a_sequence_file_is_the_plan_it_was_written_from(tmp_path):
    nodes = [Node(1.0, 0.0), Node(1.5, 0.5, "arc")]
    cycles = cycles_of(segments_through(Pose(), nodes), LIMITS)
    plan = plan_of("drawn", cycles)
    again = load_plan(str(save_sequence(plan, tmp_path)))
    assert again.segments == plan.segments
    end = poses(Pose(), cycles_of_plan(again, 0.283))[-1]
    assert end.distance_m(Pose(1.5, 0.5)) < 1e-6


@pytest.mark.parametrize("name", ["../up", ".hidden", "a/b", "", "x" * 80])
def test_a_name_never_leaves_its_folder(tmp_path, name):
    plan = plan_of(name, [Cycle(0.1, 0.0)])
    with pytest.raises(PlanError):
        save_sequence(plan, tmp_path)
    assert not list(tmp_path.iterdir())


def test_an_empty_and_an_overlong_trajectory_are_refused():
    with pytest.raises(PlanError, match="empty"):
        plan_of("none", [])
    with pytest.raises(PlanError, match="256"):
        plan_of("long", [Cycle(0.1 + 0.001 * k, 0.0) for k in range(300)])


def test_the_error_model_bends_a_straight_line_and_none_leaves_it():
    cycles = [Cycle(0.5, 0.0)] * 50
    x, y, _ = replay_cycles(NO_ERROR, Pose(), cycles)[-1]
    assert (x, y) == (pytest.approx(2.5), pytest.approx(0.0))
    x, y, theta = replay_cycles(ErrorModel(0.0655, -0.2635), Pose(), cycles)[-1]
    assert theta == pytest.approx(-0.2635 * 2.5, abs=1e-3)
    assert y < -0.7
