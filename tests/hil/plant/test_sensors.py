"""What the sensors show of the truth: whole counts, misplaced edges, a noisy voltage."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from hil_sim.plant import Plant, RobotParameters

Place = Callable[..., Plant]


def truth_counts(plant: Plant, robot: RobotParameters, wheel: int) -> float:
    per_turn = (robot.left, robot.right)[wheel].encoder.counts_per_rev
    return plant.state().wheel_angle_rad[wheel] * per_turn / math.tau


@pytest.mark.parametrize("edge_error", [0.0, 0.15, 0.45])
def test_the_count_is_within_one_of_the_truth(
    place: Place, robot: RobotParameters, edge_error: float
) -> None:
    changed = robot.changed(
        left__encoder__edge_error_count=edge_error, right__encoder__edge_error_count=edge_error
    )
    plant = place(changed)
    assert (plant.encoder(0), plant.encoder(1)) == (0, 0)
    for efforts in [(0.6, 0.3), (-0.5, 0.4), (0.0, 0.0), (-1.0, -1.0)]:
        plant.drive(*efforts)
        for _ in range(3000):
            plant.advance(7)
            for wheel in (0, 1):
                assert abs(plant.encoder(wheel) - truth_counts(plant, changed, wheel)) <= 1.0


def test_a_wheel_that_turns_one_way_never_counts_back(place: Place, robot: RobotParameters) -> None:
    plant = place(robot.changed(left__encoder__edge_error_count=0.45))
    plant.drive(0.15, 0.15)
    last = 0
    for _ in range(40_000):
        plant.advance(1)
        count = plant.encoder(0)
        assert last <= count <= last + 1
        last = count
    assert last > 500


def test_misplaced_edges_come_round_again_with_the_wheel(place: Place, robot: RobotParameters) -> None:
    changed = robot.changed(left__encoder__counts_per_rev=12.0, left__encoder__edge_error_count=0.4)

    def edges(plant: Plant, turns: int) -> list[float]:
        plant.drive(0.3, 0.3)
        seen, last = [], 0
        while last < 12 * turns:
            plant.advance(1)
            if plant.encoder(0) != last:
                last = plant.encoder(0)
                seen.append(truth_counts(plant, changed, 0) - last)
        return seen

    seen = edges(place(changed), 3)
    step = 0.01  # counts that pass during one step of the plant, at most
    assert seen[12:24] == pytest.approx(seen[24:36], abs=step)
    assert max(seen) - min(seen) > 0.2
    assert edges(place(changed, seed=2), 1) != pytest.approx(seen[:12], abs=step)


def test_the_seed_moves_sensors_and_nothing_else(place: Place) -> None:
    one, other = place(seed=1), place(seed=2)
    differ = False
    for plant in (one, other):
        plant.drive(0.4, 0.3)
    for _ in range(200):
        one.advance(100)
        other.advance(100)
        assert one.state() == other.state()
        differ |= one.encoder(0) != other.encoder(0)
        assert one.battery_v() != other.battery_v()
    assert differ


def test_reading_a_sensor_changes_nothing(place: Place) -> None:
    read, unread = place(), place()
    for plant in (read, unread):
        plant.drive(0.3, 0.5)
    for _ in range(100):
        read.advance(50)
        unread.advance(50)
        first = (read.battery_v(), read.encoder(0), read.encoder(1))
        assert (read.battery_v(), read.encoder(0), read.encoder(1)) == first
    assert read.state() == unread.state()
    assert read.battery_v() == unread.battery_v()


def test_the_sensed_voltage_is_noisy_within_its_bound_and_right_on_average(
    place: Place, robot: RobotParameters
) -> None:
    plant = place(robot.changed(battery__sense_noise_v=0.05))
    errors = []
    for _ in range(4000):
        plant.advance(3)
        errors.append(plant.battery_v() - plant.state().battery_v)
    assert max(map(abs, errors)) <= 0.05 + 1e-12
    assert max(errors) > 0.045
    assert min(errors) < -0.045
    assert abs(sum(errors) / len(errors)) < 0.002


def test_a_silent_sense_line_shows_the_truth(place: Place, robot: RobotParameters) -> None:
    plant = place(robot.changed(battery__sense_noise_v=0.0))
    plant.drive(1.0, 1.0)
    plant.advance_s(0.1)
    assert plant.battery_v() == plant.state().battery_v
