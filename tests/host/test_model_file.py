"""A fitted robot as a file: nothing is lost, and it serves as a baseline as it stands."""

from __future__ import annotations

from pathlib import Path

import pytest

from truing.errors import BaselineError
from truing.exporters.source import from_baseline
from truing.model.robot_model import RobotModel, parse_robot_model, read_robot_model
from truing.model.wheel import WheelPhysics
from truing.recording.baseline import RobotGeometry, read_baseline

MODEL = RobotModel(
    WheelPhysics(1.4512345678901234, 1.0 / 3.0, delay_s=0.0431, friction=0.041, reverse_gain=0.97),
    WheelPhysics(1.39, 0.31, friction=0.05, breakaway_excess=0.01, stribeck_mps=0.02),
    RobotGeometry('a "quoted" \\ robot\n', 0.0635, 0.283, 2400.0),
    20.0,
    {"recordings": "some_robot", "structure": "delay"},
)


def test_a_model_comes_back_from_its_file_to_the_last_bit(tmp_path: Path) -> None:
    MODEL.save(tmp_path / "model.toml")
    assert read_robot_model(tmp_path / "model.toml") == MODEL


def test_a_fitted_model_is_a_baseline_for_the_next_diagnosis(tmp_path: Path) -> None:
    MODEL.save(tmp_path / "baseline.toml")
    baseline = read_baseline(tmp_path / "baseline.toml")
    assert baseline.left.gain_mps == MODEL.left.gain_mps
    assert baseline.right.time_constant_s == MODEL.right.time_constant_s
    assert baseline.log_rate_hz == 20.0
    assert baseline.effects["stribeck_friction"] == {
        "left": 0.041, "right": 0.05, "breakaway_left": 0.041, "breakaway_right": pytest.approx(0.06),
        "stribeck": 0.02,
    }  # fmt: skip
    assert baseline.effects["input_delay"] == {"delay": pytest.approx(0.5 * 0.0431), "difference": -0.0431}
    exported, _ = from_baseline(baseline)
    assert exported.left.delay_s == pytest.approx(0.0431)
    assert exported.right.delay_s == 0.0


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[wheel.left]\ngain_mps = 1.0\n", "[model.left]"),
        ("schema = 9\n", "schema"),
        ("[model.left]\ngain_mps = 1\n[model.right]\n", "time_constant_s is missing"),
        ("[model.left]\ngain_mps = 1\ntime_constant_s = 0\n[model.right]\n", "above zero"),
        ("[model.left]\ngain = 1\n[model.right]\n", "'gain' is not a parameter"),
        ("[model.left]\ngain_mps = nan\n[model.right]\n", "finite"),
        ("not toml", "not valid TOML"),
    ],
)
def test_a_broken_model_file_is_named_with_what_is_wrong(text: str, problem: str) -> None:
    with pytest.raises(BaselineError, match=r"^mine\.toml: ") as caught:
        parse_robot_model(text, "mine.toml")
    assert problem in caught.value.message
