"""The painted world, its file, the rays that see it, and the map that grows from them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from PIL import Image

from truing.errors import TruingError
from truing.web.pose import Pose
from truing.web.world.map_file import FREE, OCCUPIED, UNKNOWN, read_world, write_map, write_world
from truing.web.world.occupancy import OccupancyGrid
from truing.web.world.range_sensors import laser_scanner, sonar_ring
from truing.web.world.ray_casting import cast
from truing.web.world.world_map import WorldMap


def room() -> WorldMap:
    world = WorldMap.empty(8.0, 6.0)
    world.paint_room((-3.0, -2.0), (3.0, 2.0), 0.05)
    return world


def test_what_is_painted_is_there_and_what_is_erased_is_not():
    world = WorldMap.empty()
    world.paint_stroke([(0.0, 0.0), (1.0, 0.0)], 0.1, True)
    assert world.is_occupied(0.5, 0.02)
    assert not world.is_occupied(0.5, 0.2)
    world.paint_stroke([(0.5, 0.0)], 0.2, False)
    assert not world.is_occupied(0.5, 0.02)
    assert world.is_occupied(0.9, 0.02)


def test_strokes_beyond_the_map_and_not_numbers_change_nothing():
    world = WorldMap.empty()
    world.paint_stroke([(100.0, 100.0), (200.0, 0.0)], 0.1, True)
    world.paint_stroke([(math.nan, 0.0)], 0.1, True)
    assert not world.occupied.any()


def test_a_map_comes_back_from_its_file_cell_for_cell(tmp_path):
    world = room()
    write_world(tmp_path / "room.yaml", world)
    again = read_world(tmp_path / "room.yaml")
    assert np.array_equal(again.occupied, world.occupied)
    assert (again.resolution_m, again.origin_m) == (world.resolution_m, world.origin_m)


def test_the_picture_has_its_top_row_at_the_highest_y(tmp_path):
    world = WorldMap.empty(1.0, 1.0, 0.5)
    world.occupied[1, 0] = True
    write_world(tmp_path / "m.yaml", world)
    pixels = np.asarray(Image.open(tmp_path / "m.png"))
    assert pixels.tolist() == [[OCCUPIED, FREE], [FREE, FREE]]


def test_unknown_cells_are_open_floor_and_negate_turns_values_round(tmp_path):
    pixels = np.array([[OCCUPIED, UNKNOWN], [FREE, FREE]], dtype=np.uint8)
    write_map(tmp_path / "m.yaml", pixels, 0.1, (0.0, 0.0))
    assert read_world(tmp_path / "m.yaml").occupied.tolist() == [[True, False], [False, False]]
    text = (tmp_path / "m.yaml").read_text().replace("negate: 0", "negate: 1")
    (tmp_path / "m.yaml").write_text(text)
    assert read_world(tmp_path / "m.yaml").occupied.tolist() == [[False, True], [True, True]]


@pytest.mark.parametrize(
    "text", ["[", "image: 3", "image: gone.png\nresolution: 0.1", "image: m.png\nresolution: -1", "- a"]
)
def test_a_broken_map_is_named(tmp_path, text):
    (tmp_path / "m.yaml").write_text(text)
    (tmp_path / "m.png").write_bytes(b"no picture")
    with pytest.raises(TruingError, match=r"m\.yaml|gone\.png"):
        read_world(tmp_path / "m.yaml")


def test_a_ray_ends_at_the_wall_at_every_angle():
    world = WorldMap.empty(8.0, 8.0)
    world.occupied[:, 140:] = True  # all beyond x = 3 m
    angles = np.linspace(-1.2, 1.2, 241)
    found = cast(world, 0.013, 0.021, angles, 20.0)
    inside = (3.0 - 0.013) / np.cos(angles)
    reaches = np.abs(0.021 + inside * np.sin(angles)) < 3.99
    assert reaches.sum() > 150
    assert np.allclose(found[reaches], inside[reaches], atol=1e-9)


def test_a_ray_in_the_open_is_as_long_as_it_may_be():
    assert cast(WorldMap.empty(), 0.0, 0.0, np.linspace(-3, 3, 50), 5.0).tolist() == [5.0] * 50


def test_the_laser_sees_the_room_with_its_noise_and_the_same_seed_sees_the_same():
    world, pose = room(), Pose(0.5, 0.2, 0.3)
    laser = laser_scanner(field_of_view_deg=360.0, beams=360, noise_m=0.01, seed=3)
    scan = laser.scan(world, pose, 7)
    exact = laser_scanner(field_of_view_deg=360.0, beams=360, noise_m=0.0).scan(world, pose, 7)
    assert np.array_equal(scan, laser.scan(world, pose, 7))
    assert not np.array_equal(scan, laser.scan(world, pose, 8))
    assert np.std(scan - exact) == pytest.approx(0.01, rel=0.15)
    assert exact.min() == pytest.approx(1.8, abs=0.06)


def test_a_sonar_reports_the_nearest_thing_in_its_cone_and_nothing_beyond_its_range():
    world = WorldMap.empty()
    world.paint_stroke([(2.0, 0.25)], 0.1, True)
    wide = sonar_ring(4, cone_deg=25.0, noise_m=0.0).scan(world, Pose(), 1)
    narrow = sonar_ring(4, cone_deg=5.0, noise_m=0.0).scan(world, Pose(), 1)
    assert wide[0] == pytest.approx(2.0 - 0.18, abs=0.08)
    assert np.isnan(wide[1:]).all()
    assert np.isnan(narrow).all()


def test_the_grid_learns_walls_and_floor_and_drift_smears_it():
    world = room()
    laser = laser_scanner(field_of_view_deg=360.0, beams=720, noise_m=0.005)
    true_grid = OccupancyGrid(world.size_m, world.resolution_m, world.origin_m)
    drifted = OccupancyGrid(world.size_m, world.resolution_m, world.origin_m)
    for k in range(30):
        pose = Pose(-1.5 + 0.1 * k, 0.3, 0.05 * k)
        scan = laser.scan(world, pose, k)
        true_grid.add(laser, pose, scan)
        drifted.add(laser, Pose(pose.x_m, pose.y_m, pose.theta_rad + 0.01 * k), scan)

    def hits(grid: OccupancyGrid) -> float:
        marked = grid.pixels() == OCCUPIED
        near = np.zeros_like(world.occupied)
        for row in (-1, 0, 1):
            for column in (-1, 0, 1):
                near |= np.roll(world.occupied, (row, column), (0, 1))
        return float((marked & near).sum() / marked.sum())

    assert hits(true_grid) > 0.99
    assert hits(drifted) < 0.8
    assert (true_grid.pixels()[50:70, 60:100] == FREE).all()


def test_boxes_cover_exactly_the_occupied_cells():
    world = room()
    world.paint_stroke([(0.0, 0.0)], 0.5, True)
    again = np.zeros_like(world.occupied)
    for x, y, width, height in world.rectangles():
        c0 = round((x - width / 2 - world.origin_m[0]) / world.resolution_m)
        r0 = round((y - height / 2 - world.origin_m[1]) / world.resolution_m)
        part = again[
            r0 : r0 + round(height / world.resolution_m), c0 : c0 + round(width / world.resolution_m)
        ]
        assert not part.any()
        part[:] = True
    assert np.array_equal(again, world.occupied)
