"""The model to export: a fitted model, or a baseline with the effects that it names."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from truing.errors import BaselineError
from truing.model.robot_model import RobotModel, read_robot_model
from truing.model.wheel import WheelPhysics
from truing.recording.baseline import Baseline, RobotGeometry, read_baseline

# Speed over which breakaway friction fades where a baseline does not say, of the full-effort speed.
STRIBECK_SHARE = 0.05


def read_model(path: Path) -> tuple[RobotModel, tuple[str, ...]]:
    """Read `path`, and say which of a baseline's effects a wheel's physics cannot express."""
    if path.is_dir():
        raise BaselineError(path, "is a folder", "truing fit RUNS --out MODEL.TOML writes a model")
    try:
        return read_robot_model(path), ()
    except BaselineError as error:
        if "[model.left]" not in error.problem:
            raise
    return from_baseline(read_baseline(path))


def from_baseline(baseline: Baseline) -> tuple[RobotModel, tuple[str, ...]]:
    """A baseline as a model, and a sentence for each effect that is no part of a wheel's physics."""
    left = WheelPhysics(baseline.left.gain_mps, baseline.left.time_constant_s)
    right = WheelPhysics(baseline.right.gain_mps, baseline.right.time_constant_s)
    unused = []
    for name, table in baseline.effects.items():
        fields = _fields(baseline, name, table)
        if fields is None:
            unused.append(f"[effect.{name}] is no part of a wheel's model; left out")
            continue
        left, right = (
            replace(wheel, **{field: values[side] for field, values in fields.items()})
            for side, wheel in enumerate((left, right))
        )
    robot = baseline.robot or RobotGeometry()
    source = {"baseline": baseline.path.name}
    return RobotModel(left, right, robot, baseline.log_rate_hz, source), tuple(unused)


def _fields(baseline: Baseline, name: str, table: dict[str, Any]) -> dict[str, tuple[float, float]] | None:
    """The physics fields, (left, right), that an effect of the catalogue sets; None: it sets none."""
    path = baseline.path

    def number(key: str) -> float:
        value = table.get(key)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise BaselineError(path, f"[effect.{name}] {key} must be a number, not {value!r}")
        return float(value)

    def pair(left: str = "left", right: str = "right") -> tuple[float, float]:
        return number(left), number(right)

    def apart(key: str) -> tuple[float, float]:
        half = 0.5 * (number("difference") if "difference" in table else 0.0)
        return max(number(key) - half, 0.0), max(number(key) + half, 0.0)

    if name == "coulomb_friction":
        return {"friction": pair()}
    if name == "stribeck_friction":
        running, breakaway = pair(), pair("breakaway_left", "breakaway_right")
        excess = (max(breakaway[0] - running[0], 0.0), max(breakaway[1] - running[1], 0.0))
        # Squared exponent and usual speed are those of the diagnosis' own equation.
        usual = STRIBECK_SHARE * max(baseline.left.gain_mps, baseline.right.gain_mps)
        fading = number("stribeck") if "stribeck" in table else usual
        more = {"stribeck_mps": (fading, fading), "stribeck_shape": (2.0, 2.0)}
        return {"friction": running, "breakaway_excess": excess} | more
    if name == "quadratic_drag":
        return {"drag": pair()}
    if name == "input_delay":
        return {"delay_s": apart("delay")}
    if name == "driver_lag":
        return {"lag_s": pair("time_constant", "time_constant")}
    if name == "direction_asymmetry":
        fields = {"reverse_gain": pair()}
        if "friction_left" in table:
            fields["reverse_friction"] = pair("friction_left", "friction_right")
        return fields
    if name == "driver_deadband":
        return {"deadband": pair("deadband", "deadband")}
    if name == "speed_filter":
        return {"recorder_lag_s": apart("time_constant")}
    return None
