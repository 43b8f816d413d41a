"""The supply: it sags under load, both wheels feel it, and charge runs out."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from hil_sim.plant import Plant, RobotParameters

Place = Callable[..., Plant]


def test_the_battery_sags_by_resistance_times_current(place: Place, robot: RobotParameters) -> None:
    plant = place()
    plant.advance(1)
    rest = plant.state()
    plant.drive(1.0, 1.0)
    plant.advance_s(0.02)
    loaded = plant.state()
    assert loaded.battery_current_a > 2.0
    sag = loaded.battery_open_v - loaded.battery_v
    assert sag == pytest.approx(robot.battery.resistance_ohm * loaded.battery_current_a, rel=1e-9)
    assert loaded.battery_v < rest.battery_v - 0.2


def test_one_wheels_load_slows_the_other(place: Place, robot: RobotParameters) -> None:
    def right_speed(plant: Plant, left_effort: float) -> float:
        """The left wheel presses against a brake it cannot overcome; no ground joins the wheels."""
        plant.drive(left_effort, 0.5)
        plant.advance_s(3.0)
        state = plant.state()
        assert state.wheel_speed_radps[0] == 0.0
        return state.wheel_speed_radps[1]

    stuck = robot.changed(left__friction__breakaway_nm=50.0, left__friction__coulomb_nm=50.0)
    assert right_speed(place(stuck), 1.0) < 0.985 * right_speed(place(stuck), 0.0)
    stiff = stuck.changed(battery__resistance_ohm=0.0)
    assert right_speed(place(stiff), 1.0) == pytest.approx(right_speed(place(stiff), 0.0), rel=2e-4)


def test_driving_draws_charge_and_lowers_the_open_circuit_voltage(
    place: Place, robot: RobotParameters
) -> None:
    plant = place(robot.changed(battery__capacity_ah=0.02))
    plant.drive(0.5, 0.5)
    voltages = []
    for _ in range(4):
        plant.advance_s(20.0)
        voltages.append(plant.state().battery_open_v)
    assert voltages == sorted(voltages, reverse=True)
    assert plant.state().battery_charge < 0.7
    assert voltages[-1] < robot.battery.full_v - 0.5


def test_braking_by_reversing_gives_nothing_back_beyond_full(place: Place, robot: RobotParameters) -> None:
    plant = place(robot.changed(battery__initial_charge=1.0))
    for effort in (1.0, 0.3, 1.0, 0.3):
        plant.drive(effort, effort)
        plant.advance_s(0.3)
        assert plant.state().battery_charge <= 1.0


def test_slowing_down_with_drive_and_brake_charges_the_battery(place: Place, robot: RobotParameters) -> None:
    plant = place()
    plant.drive(1.0, 1.0)
    plant.advance_s(2.0)
    plant.drive(0.5, 0.5)
    plant.advance_s(0.01)
    assert plant.state().battery_current_a < robot.battery.electronics_a


def test_an_empty_battery_still_obeys_its_own_voltage(place: Place, robot: RobotParameters) -> None:
    plant = place(robot.changed(battery__initial_charge=0.0))
    plant.advance_s(0.1)
    state = plant.state()
    assert state.battery_charge == 0.0
    assert state.battery_open_v == robot.battery.empty_v
