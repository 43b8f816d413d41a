"""A virtual robot collides with the walls of the world."""

from __future__ import annotations

import contextlib
import math
import time

import pytest

from support.served_board import ServedBoard
from truing.board.device import Device
from truing.errors import Refused
from truing.web.pose import Pose
from truing.web.process.robot_side import served_robot
from truing.web.process.walls import GRIP_NM, Collisions, Walls, walls_json
from truing.web.world.world_map import BODY_M, WorldMap
from web.live_client import LiveClient
from web.view_process import ViewProcess


class Robot:
    """Records what walls do to it."""

    def __init__(self) -> None:
        self.placed: list[Pose] = []
        self.held = [0.0, 0.0]

    def place(self, x_m: float, y_m: float, theta_rad: float) -> None:
        self.placed.append(Pose(x_m, y_m, theta_rad))

    def hold_wheel(self, wheel: int, torque_nm: float) -> None:
        self.held[wheel] = torque_nm


@pytest.fixture
def walled():
    """A robot at the origin of a world with a wall at x = 1 m, and its collisions."""
    world = WorldMap.empty()
    world.paint_stroke([(1.0, -2.0), (1.0, 2.0)], 0.05, True)
    robot = Robot()
    collisions = Collisions(robot)
    collisions.walls = Walls.of_json(walls_json(world, Pose()), BODY_M)
    return robot, collisions


def test_a_body_stops_at_a_wall_and_its_wheels_are_held(walled):
    robot, collisions = walled
    pose = Pose()
    for k in range(200):
        pose = collisions.step(1000 * k, Pose(pose.x_m + 0.01))
    assert pose.x_m == pytest.approx(1.0 - BODY_M, abs=0.06)
    assert robot.held == [GRIP_NM, GRIP_NM]
    assert robot.placed[-1] == pose


def test_a_wheel_is_let_go_so_that_the_robot_can_drive_away(walled):
    robot, collisions = walled
    collisions.step(0, Pose(0.7))
    stopped = collisions.step(1000, Pose(0.95))
    assert stopped.x_m == pytest.approx(0.7)
    away = collisions.step(60_000, Pose(0.69))
    assert away == Pose(0.69)
    assert robot.held == [0.0, 0.0]


def test_it_slides_along_a_wall_and_turns_beside_it(walled):
    _, collisions = walled
    collisions.step(0, Pose(0.79, 0.0, 0.5))
    found = collisions.step(1000, Pose(0.9, 0.05, 0.6))
    assert found == Pose(0.79, 0.05, 0.6)


def test_a_robot_that_was_placed_into_an_obstacle_may_leave_it(walled):
    _, collisions = walled
    collisions.step(0, Pose(1.0))
    assert collisions.step(1000, Pose(0.99)) == Pose(0.99)


def test_walls_stand_in_the_world_and_not_in_the_robots_own_coordinates():
    world = WorldMap.empty()
    world.paint_stroke([(0.0, 1.0)], 0.1, True)
    walls = Walls.of_json(walls_json(world, Pose(0.0, 0.0, math.pi / 2)), BODY_M)
    assert walls.blocks(Pose(1.0, 0.0))
    assert not walls.blocks(Pose(0.0, 1.0))


@pytest.mark.slow
@pytest.mark.usefixtures("image", "native_library")
def test_the_robot_of_a_served_board_collides_too(tmp_path, monkeypatch):
    monkeypatch.setenv("TRUING_OUT", str(tmp_path))
    (tmp_path / "boards").mkdir()
    # The note of a board that was killed.
    (tmp_path / "boards/0.json").write_text(
        '{"ports": ["tcp:127.0.0.1:1"], "world": ["127.0.0.1", 1], "seed": 1}'
    )
    assert served_robot("tcp:127.0.0.1:1") is None
    world = WorldMap.empty()
    world.paint_stroke([(0.5, -2.0), (0.5, 2.0)], 0.05, True)
    with ServedBoard(tmp_path) as board, Device.open(board.tcp) as device:
        robot = served_robot(board.tcp)
        assert robot is not None
        robot.set_walls(world, Pose())
        until = time.monotonic() + 30.0
        while not device.status().latched and time.monotonic() < until:
            with contextlib.suppress(Refused):  # the fault came meanwhile
                device.set_velocity(0.4, 0.4)
            time.sleep(0.05)
        assert {fault.name for fault in device.status().latched} & {
            "wheel_left_stalled",
            "wheel_right_stalled",
        }
        assert robot.truth is not None
        assert robot.truth.x_m == pytest.approx(0.5 - BODY_M, abs=0.06)
        robot.close()


@pytest.mark.slow
@pytest.mark.usefixtures("image", "native_library")
def test_the_flashed_image_drives_against_the_room_and_notices_that_its_wheels_stand(tmp_path):
    view = ViewProcess(tmp_path / "out")
    try:
        page = LiveClient(view.address)
        page.wait_for("link", lambda link: link["state"] == "connected")
        page.wait_for("corrected", lambda pose: pose is not None)
        page.claim()
        for _ in range(6):
            page.send(t="faster")

        def drive(key: str, seconds: float) -> None:
            until = time.monotonic() + seconds
            while time.monotonic() < until:
                page.keys(key)
                time.sleep(0.05)
            page.keys()

        # The room's wall is at x = 3.5 m.
        until = time.monotonic() + 60.0
        while page.state["corrected"][0] < 3.2 and time.monotonic() < until:
            drive("forward", 0.5)
        drive("forward", 2.0)
        x = page.state["corrected"][0]
        assert x == pytest.approx(3.5 - BODY_M, abs=0.1), page.state
        faults = {fault["name"] for fault in page.state["board"]["faults"]}
        assert faults & {"wheel_left_stalled", "wheel_right_stalled"}, page.state
        assert page.state["link"]["virtual"]
        page.close()
    finally:
        view.close()
