"""What a plan will do, before anything moves: its path, the room it needs, what is in the way."""

from __future__ import annotations

import math

import pytest

from truing.floor import MotionModel, estimate_floor, planned_path
from truing.plan import Kind, Plan, Segment
from truing.web.models.run_forecast import first_obstacle, forecast
from truing.web.pose import Pose
from truing.web.world.world_map import BODY_M, WorldMap


def plan(*segments: tuple[float, float, float], kind: Kind = Kind.TWIST) -> Plan:
    return Plan("test", "a test", tuple(Segment(kind, *segment) for segment in segments))


def test_the_path_of_a_plan_is_as_long_as_it_commands_and_ends_at_rest():
    path = planned_path(plan((4.0, 0.5, 0.0)), MotionModel(1.5, 1.5, 0.2))
    assert path[0].tolist() == [0.0, 0.0, 0.0]
    assert path[-1, 0] == pytest.approx(2.0, abs=0.002)
    assert abs(path[:, 1]).max() < 1e-9
    assert abs(path[-1, 0] - path[-2, 0]) < 1e-4


def test_a_quarter_circle_ends_beside_and_ahead():
    radius = 0.8
    found = planned_path(plan((math.pi, 0.4, 0.5)), MotionModel(time_constant_s=0.01))
    assert found[-1] == pytest.approx([radius, radius, math.pi / 2], abs=0.02)


def test_efforts_are_turned_into_a_path_by_the_wheels_gains():
    found = planned_path(plan((3.0, 0.4, 0.4), kind=Kind.EFFORT), MotionModel(1.5, 1.5, 0.2))
    assert found[-1, 0] == pytest.approx(0.4 * 1.5 * 3.0, abs=0.01)


def test_the_forecast_stands_where_the_robot_stands_and_says_what_room_it_needs():
    straight = plan((4.0, 0.5, 0.0))
    found = forecast(straight, {}, Pose(1.0, 0.5, math.pi / 2), WorldMap.empty())
    assert found.path[-1] == pytest.approx([1.0, 2.5, math.pi / 2], abs=0.01)
    assert found.distance_m == pytest.approx(2.0, abs=0.01)
    assert found.need == estimate_floor(straight, MotionModel(source=found.need.source))
    facts = dict(found.facts())
    assert facts["distance"] == "2.00 m"
    assert facts["top speed"].endswith(" m/s")
    assert len(found.path) < 130


def test_a_wall_in_the_way_is_found_where_the_body_meets_it():
    world = WorldMap.empty()
    world.paint_stroke([(1.5, -1.0), (1.5, 1.0)], 0.05, True)
    path = forecast(plan((4.0, 0.5, 0.0)), {}, Pose(), world).path
    hit = first_obstacle(world, path)
    assert hit is not None
    assert hit[0] == pytest.approx(1.5 - BODY_M, abs=0.08)
    away = forecast(plan((4.0, 0.5, 0.0)), {}, Pose(0.0, 0.0, math.pi), world)
    assert away.obstacle is None
    far = forecast(plan((20.0, -0.8, 0.0)), {}, Pose(), world)
    assert far.obstacle is None  # outside the map is nothing
