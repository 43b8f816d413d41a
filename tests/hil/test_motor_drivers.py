"""Motor drivers that take PWM and direction, or enable and phase, drive and brake as those with IN/IN do."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil_sim import Target, VirtualRobot
from support.driving import host

EFFORTS = ((0.5, 0.5), (-0.5, -0.5), (0.4, -0.4))


def speeds(image: Path, effort: tuple[float, float]) -> tuple[float, float]:
    """Measured speeds of both wheels after a second of this effort, m/s."""
    with VirtualRobot(image) as robot:
        robot.run_us(300_000)
        device = host(robot)
        for _ in range(10):
            device.set_effort(*effort)
            robot.run_us(100_000)
        assert robot.warnings() == []
        return device.status().speed_mps


@pytest.mark.parametrize("effort", EFFORTS)
def test_an_effort_gives_the_same_speeds(
    image: Path, other_driver_image: Path, native_library: Path, effort: tuple[float, float]
) -> None:
    assert speeds(other_driver_image, effort) == pytest.approx(speeds(image, effort), rel=0.02)


def test_direction_is_a_level_and_pwm_the_share_of_the_effort(
    other_driver_image: Path, native_library: Path
) -> None:
    with VirtualRobot(other_driver_image) as robot:
        robot.run_us(300_000)
        forward = 0.0 if robot.target is Target.PWM_DIR else 1.0
        device = host(robot)
        assert [robot.bridge(wheel)[0] for wheel in (0, 1)] == [0, 0], "zero effort brakes"
        device.set_effort(0.3, -0.7)
        robot.run_us(50_000)
        assert robot.bridge(0) == pytest.approx((0.3, forward))
        assert robot.bridge(1) == pytest.approx((0.7, 1 - forward))


@pytest.mark.parametrize("halted", [False, True])
def test_the_emergency_stop_and_a_debugger_take_the_pwm_away_at_once(
    other_driver_image: Path, native_library: Path, halted: bool
) -> None:
    with VirtualRobot(other_driver_image) as robot:
        robot.run_us(300_000)
        host(robot).set_effort(0.6, -0.6)
        robot.run_us(100_000)
        if halted:
            robot.set_halted(True)
        else:
            robot.set_emergency_stop(True)
        assert [robot.bridge(wheel) for wheel in (0, 1)] == [(0, 0), (0, 0)]


def test_an_image_for_in_in_drives_such_a_driver_where_it_means_to_brake(
    image: Path, native_library: Path
) -> None:
    """Why the driver is part of the board, and its image has another name."""
    with VirtualRobot(image, target=Target.PWM_DIR) as robot:
        robot.run_us(300_000)
        assert robot.truth().speed_mps < -0.1
