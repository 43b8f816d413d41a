"""Exported gains and controller parameters are what the model implies."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from support.exported import GEOMETRY, PLAIN, drive, ours, scale
from truing.errors import TruingError
from truing.exporters import ExportOptions, exporter
from truing.recording.baseline import RobotGeometry


def test_wpilib_gains_move_as_our_own_model(tmp_path: Path) -> None:
    path = tmp_path / "gains.json"
    wpilib = exporter("wpilib")
    wpilib.write(PLAIN, path, ExportOptions(nominal_voltage_v=10.0))
    gains = json.loads(path.read_text())
    assert gains["nominal_voltage"] == 10.0
    t, efforts = drive()
    reference = ours(PLAIN, wpilib.HOLDS, t, efforts)
    for side, effort, truth in zip(("left", "right"), efforts, reference, strict=True):
        speed = _feedforward_plant(gains[side], 10.0 * effort, t)
        # Implicit steps of 80 us against tau = 0.2 s: h / (2 e tau) of a speed step, 7e-5.
        assert np.abs(speed - truth).max() < 1e-4 * scale(PLAIN)
    assert gains["mean"]["kV"] == pytest.approx(0.5 * (gains["left"]["kV"] + gains["right"]["kV"]))
    assert "delay is left out" in gains["left_out"][0]
    assert gains["trackwidth_m"] == GEOMETRY.wheelbase_m


def _feedforward_plant(gains: dict[str, float], volts: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The plant whose feedforward V = kS sign(v) + kV v + kA a is exact, at the rows, shape (n,)."""
    speed, steps = np.zeros_like(t), 250
    h = (t[1] - t[0]) / steps
    v = 0.0
    for row in range(1, t.size):
        for _ in range(steps):
            # Implicit in everything: dry friction is what stops, or what it can give.
            free = v + h * volts[row] / gains["kA"]
            slowed = max(abs(free) - h * gains["kS"] / gains["kA"], 0.0)
            v = np.copysign(slowed, free) / (1.0 + h * gains["kV"] / gains["kA"])
        speed[row] = v
    return speed


def test_ros2_control_gets_the_geometry_and_limits_that_the_model_reaches(tmp_path: Path) -> None:
    path = tmp_path / "controller.yaml"
    exporter("ros2-control").write(PLAIN, path)
    p = yaml.safe_load(path.read_text())["diff_drive_controller"]["ros__parameters"]
    assert (p["wheel_radius"], p["wheel_separation"]) == (0.0635, 0.283)
    assert (p["left_wheel_names"], p["right_wheel_names"]) == (["left_wheel_joint"], ["right_wheel_joint"])
    # Drive our own model at full effort: the slower wheel ends at the speed limit, and starts at the other.
    t = 0.001 * np.arange(5000)
    full = np.array([np.where(t > 0.0, 1.0, 0.0)] * 2)
    speeds = ours(PLAIN, frozenset({"friction"}), t, full)
    assert p["linear.x.max_velocity"] == pytest.approx(speeds[:, -1].min(), rel=1e-6)
    assert p["linear.x.max_acceleration"] == pytest.approx(speeds[:, 1].min() / 0.001, rel=5e-3)
    assert p["angular.z.max_velocity"] == pytest.approx(2.0 * speeds[:, -1].min() / 0.283, rel=1e-6)
    for axis in ("linear.x", "angular.z"):
        for what in ("velocity", "acceleration"):
            assert p[f"{axis}.min_{what}"] == -p[f"{axis}.max_{what}"]


def test_ros2_control_says_which_dynamics_it_has_no_place_for(tmp_path: Path) -> None:
    path = tmp_path / "controller.yaml"
    exporter("ros2-control").write(PLAIN, path)
    text = path.read_text()
    assert "# Not held by this controller, left wheel: gain 1.45 m/s, time constant 0.21 s" in text
    assert "# delay is left out" in text


@pytest.mark.parametrize("kind", ["urdf", "sdf", "mjcf", "ros2-control"])
def test_a_format_that_needs_geometry_asks_for_it_or_takes_it_from_the_options(
    tmp_path: Path, kind: str
) -> None:
    bare = replace(PLAIN, robot=RobotGeometry())
    path = tmp_path / f"robot{exporter(kind).SUFFIX}"
    with pytest.raises(TruingError, match="no wheel radius") as caught:
        exporter(kind).write(bare, path)
    assert "--wheel-radius" in caught.value.next_step
    with pytest.raises(TruingError, match="no wheelbase"):
        exporter(kind).write(bare, path, ExportOptions(wheel_radius_m=0.05))
    assert exporter(kind).write(bare, path, ExportOptions(wheel_radius_m=0.05, wheelbase_m=0.3)) == (path,)


@pytest.mark.parametrize("kind", ["urdf", "sdf", "mjcf"])
def test_a_wheel_that_turns_against_its_effort_is_no_joint(tmp_path: Path, kind: str) -> None:
    backwards = replace(PLAIN, right=replace(PLAIN.right, gain_mps=-1.0))
    with pytest.raises(TruingError, match="the right wheel's gain is -1 m/s"):
        exporter(kind).write(backwards, tmp_path / "robot")
