"""The numbers: the mirror in Python, refusals by name, repeatability, the step's size and cost."""

from __future__ import annotations

import ctypes
import dataclasses
import math
import random
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hil_sim.plant import Plant, PlantError, PlantState, RobotParameters

Place = Callable[..., Plant]


def paths(node: Any, prefix: str = "") -> Iterator[str]:
    for field in dataclasses.fields(node):
        value = getattr(node, field.name)
        if dataclasses.is_dataclass(value):
            yield from paths(value, f"{prefix}{field.name}.")
        else:
            yield prefix + field.name


def test_every_parameter_that_is_no_number_is_refused_by_its_own_name(
    robot: RobotParameters, native_library: Path
) -> None:
    names = list(paths(robot))
    assert len(names) == 2 * 13 + 13
    for name in names:
        for value in (math.nan, math.inf, -math.inf, -1e9):
            problem = robot.changed(**{name.replace(".", "__"): value}).problem(native_library)
            assert problem is not None
            assert problem.startswith(name + " is ")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"left__radius_m": 0.0}, "left.radius_m is 0, outside"),
        ({"right__motor__resistance_ohm": 0.0}, "right.motor.resistance_ohm is 0, outside"),
        ({"chassis__mass_kg": -5.0}, "chassis.mass_kg is -5, outside"),
        ({"battery__initial_charge": 1.2}, "battery.initial_charge is 1.2, outside 0..1"),
        (
            {"right__friction__breakaway_nm": 0.0},
            "right.friction.breakaway_nm is 0, below friction.coulomb_nm",
        ),
        (
            {"left__encoder__counts_per_rev": 2400.5},
            "left.encoder.counts_per_rev is 2400.5, not a whole number",
        ),
        ({"left__encoder__edge_error_count": 0.6}, "left.encoder.edge_error_count is 0.6, outside"),
        ({"battery__empty_v": 14.0}, "battery.empty_v is 14, above battery.full_v"),
        (
            {"battery__resistance_ohm": 9.0},
            "battery.resistance_ohm is 9, above 0.4 times left.motor.resistance_ohm",
        ),
        ({"left__motor__emf_v_per_radps": 9.0}, "left.motor.emf_v_per_radps is 9, too strong"),
    ],
)
def test_a_robot_that_cannot_be_is_refused_with_a_reason(
    place: Place, robot: RobotParameters, change: dict[str, float], reason: str
) -> None:
    with pytest.raises(PlantError) as refusal:
        place(robot.changed(**change))
    assert str(refusal.value).startswith(reason)


def test_an_unknown_parameter_is_named(robot: RobotParameters) -> None:
    with pytest.raises(PlantError, match="ChassisParameters has no weight_kg"):
        robot.changed(chassis__weight_kg=3.0)


def test_a_missing_library_says_how_to_build_it(tmp_path: Path) -> None:
    with pytest.raises(PlantError, match=r"\./run setup builds it"):
        RobotParameters.msrp(tmp_path / "none.so")


def test_duties_beyond_the_period_are_clamped_and_other_wheels_ignored(place: Place) -> None:
    plain, odd = place(), place()
    plain.set_bridge(0, 1.0, 0.0)
    odd.set_bridge(0, 7.0, -3.0)
    odd.set_bridge(1, math.nan, math.nan)
    odd.set_bridge(2, 1.0, 0.0)
    odd.set_bridge(-1, 1.0, 0.0)
    for plant in (plain, odd):
        plant.advance(2000)
    assert plain.state() == odd.state()
    assert odd.encoder(2) == 0


def wander(plant: Plant, spans: list[int]) -> PlantState:
    """Sixty commands of 1000 steps, each advanced in the given spans."""
    dice = random.Random(3)
    for _ in range(60):
        for wheel in (0, 1):
            plant.set_bridge(wheel, dice.random(), dice.random())
        left, turn = 1000, 0
        while left:
            span = min(left, spans[turn % len(spans)])
            plant.advance(span)
            left, turn = left - span, turn + 1
    return plant.state()


def test_how_a_span_is_split_changes_no_bit(place: Place) -> None:
    whole = wander(place(), [1000])
    assert whole == wander(place(), [1])
    assert whole == wander(place(), [3, 0, 141, 17])
    assert whole.steps == 60_000


def test_repeating_a_duty_changes_no_bit(place: Place) -> None:
    once, often = place(), place()
    once.drive(0.4, 0.2)
    once.advance(5000)
    for _ in range(5000):
        often.drive(0.4, 0.2)
        often.advance(1)
    assert once.state() == often.state()


def test_a_five_times_finer_step_gives_the_same_motion(
    robot: RobotParameters, plant_build: Callable[[int], Path]
) -> None:
    coarse = Plant(robot, library=plant_build(50))
    fine = Plant(robot, library=plant_build(10))
    for efforts in [(0.15, 0.15), (0.4, 0.0), (-0.3, 0.5), (0.0, 0.0), (1.0, 1.0)]:
        for plant, steps in ((coarse, 20_000), (fine, 100_000)):
            plant.drive(*efforts)
            plant.advance(steps)
        one, other = coarse.state(), fine.state()
        assert one.wheel_speed_radps == pytest.approx(other.wheel_speed_radps, rel=1e-3, abs=1e-3)
        assert one.wheel_angle_rad == pytest.approx(other.wheel_angle_rad, rel=1e-3, abs=2e-3)
        assert (one.x_m, one.y_m) == pytest.approx((other.x_m, other.y_m), abs=5e-4)
        assert one.theta_rad == pytest.approx(other.theta_rad, abs=2e-3)
        assert one.battery_charge == pytest.approx(other.battery_charge, abs=1e-7)


class _Mass(ctypes.Structure):
    _fields_ = [("left", ctypes.c_double), ("right", ctypes.c_double), ("cross", ctypes.c_double)]


class _Limits(ctypes.Structure):
    _fields_ = [("left", ctypes.c_double), ("right", ctypes.c_double), ("twist", ctypes.c_double)]


class _Speeds(ctypes.Structure):
    _fields_ = [("left", ctypes.c_double), ("right", ctypes.c_double)]


def cost(mass: _Mass, momentum: tuple[float, float], limits: _Limits, left: float, right: float) -> float:
    """The function of friction.c that a step's rim speeds minimise."""
    kinetic = (mass.left * left**2 + mass.right * right**2) / 2 + mass.cross * left * right
    dry = limits.left * abs(left) + limits.right * abs(right) + limits.twist * abs(right - left)
    return kinetic - momentum[0] * left - momentum[1] * right + dry


def test_dry_friction_takes_the_one_motion_that_its_law_allows(plant_build: Callable[[int], Path]) -> None:
    """No neighbour of the step's speeds is lower, and the function is convex."""
    solve = ctypes.CDLL(str(plant_build(50))).friction_solve
    solve.restype = _Speeds
    solve.argtypes = [ctypes.POINTER(_Mass), ctypes.c_double, ctypes.c_double, ctypes.POINTER(_Limits)]
    dice = random.Random(11)
    pieces = set()
    for _ in range(20_000):
        mass = _Mass(dice.uniform(0.5, 5.0), dice.uniform(0.5, 5.0), 0.0)
        mass.cross = dice.uniform(-0.9, 0.9) * math.sqrt(mass.left * mass.right)
        limits = _Limits(*(dice.choice([0.0, dice.expovariate(1.0)]) for _ in range(3)))
        momentum = (dice.gauss(0.0, 2.0), dice.gauss(0.0, 2.0))
        speeds = solve(ctypes.byref(mass), *momentum, ctypes.byref(limits))

        found = cost(mass, momentum, limits, speeds.left, speeds.right)
        for i in range(12):
            angle = i * math.tau / 12 + dice.choice([0.0, math.pi / 4])
            left = speeds.left + 1e-3 * math.cos(angle)
            right = speeds.right + 1e-3 * math.sin(angle)
            assert found <= cost(mass, momentum, limits, left, right) + 1e-12
        ways = (speeds.left, speeds.right, speeds.right - speeds.left)
        pieces.add(tuple((way > 0.0) - (way < 0.0) for way in ways))
    assert len(pieces) == 13, "every way to stand, to run alike and to slide came up"


def test_a_virtual_second_costs_less_than_five_milliseconds(place: Place) -> None:
    plant = place()
    plant.drive(0.5, 0.2)
    best = math.inf
    for _ in range(5):
        start = time.process_time()
        plant.advance(20_000)
        best = min(best, time.process_time() - start)
    assert best < 5e-3
