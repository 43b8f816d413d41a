"""The robot as described by its board's parameters, as a baseline: the controller's own model."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from truing.board.run_saver import motion_model
from truing.board.state import Parameter
from truing.recording.baseline import Baseline, RobotGeometry, WheelModel

_PATH = Path("the board's parameters")
_GEOMETRY = ("wheel_radius_m", "wheelbase_m", "counts_per_rev")


def known_robot(parameters: Mapping[str, Parameter]) -> dict[str, Any]:
    """The parameters as plain data for another process; defaults where no board is connected."""
    model = motion_model(dict(parameters))
    geometry = {name: parameters[name].value for name in _GEOMETRY if name in parameters}
    return {
        "gain_mps": [model.gain_left_mps, model.gain_right_mps],
        "time_constant_s": model.time_constant_s,
        "geometry": {"wheelbase_m": model.wheelbase_m} | geometry,
    }


def robot_of(numbers: dict[str, Any]) -> Baseline:
    """The baseline from the data of `known_robot`."""
    left, right = (WheelModel(gain, numbers["time_constant_s"]) for gain in numbers["gain_mps"])
    return Baseline(_PATH, left, right, RobotGeometry(**numbers["geometry"]))
