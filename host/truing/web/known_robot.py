"""The robot as its board knows it, as a baseline: what a controller on it goes by."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from truing.baseline import Baseline, RobotGeometry, WheelModel
from truing.board_state import Parameter
from truing.run_saver import motion_model

_PATH = Path("the board's parameters")
_GEOMETRY = ("wheel_radius_m", "wheelbase_m", "counts_per_rev")


def known_robot(parameters: Mapping[str, Parameter]) -> dict[str, Any]:
    """Its numbers for another process; the default robot's where no board has told any."""
    model = motion_model(dict(parameters))
    geometry = {name: parameters[name].value for name in _GEOMETRY if name in parameters}
    return {
        "gain_mps": [model.gain_left_mps, model.gain_right_mps],
        "time_constant_s": model.time_constant_s,
        "geometry": {"wheelbase_m": model.wheelbase_m} | geometry,
    }


def robot_of(numbers: dict[str, Any]) -> Baseline:
    """The baseline of `known_robot`'s numbers."""
    left, right = (WheelModel(gain, numbers["time_constant_s"]) for gain in numbers["gain_mps"])
    return Baseline(_PATH, left, right, RobotGeometry(**numbers["geometry"]))
