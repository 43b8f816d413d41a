"""A fitted robot as a file: both wheels, the geometry, the sampling.

The file is TOML. `[model.left]` and `[model.right]` hold the wheels' physics; `[robot]`, `[wheel.*]`,
`[log]` and `[effect.*]` say the same as a baseline (docs/DATA_FORMAT.md, section 3), as far as a baseline
can hold it, so that a fitted model is a baseline for the next diagnosis as it stands.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from truing.errors import BaselineError, TruingError
from truing.model.correction import Correction
from truing.model.wheel import WheelPhysics
from truing.recording.baseline import RobotGeometry
from truing.recording.run import Wheel
from truing.recording.writer import replace_file

SCHEMA = 1
# Speed over which breakaway friction fades that stands for none, as a share of the full-effort speed.
AT_REST = 0.002


@dataclass(frozen=True, slots=True)
class RobotModel:
    """Both wheels of a robot.

    Attributes
    ----------
    left, right : the wheels' physics.
    robot : geometry; its fields are None where nobody said.
    rate_hz : sampling rate of the recordings that the model was fitted to, Hz.
    source : where the model comes from, in words (recording set, structure, free-run error).
    correction : learned lookups beside the wheels, or None.
    """

    left: WheelPhysics
    right: WheelPhysics
    robot: RobotGeometry = field(default_factory=RobotGeometry)
    rate_hz: float | None = None
    source: dict[str, str] = field(default_factory=dict)
    correction: Correction | None = None

    def wheel(self, side: Wheel) -> WheelPhysics:
        """One wheel's physics."""
        return self.left if side == "left" else self.right

    def to_toml(self, effects: Mapping[str, Mapping[str, float]] | None = None) -> str:
        """The file's text; reading it back gives the same numbers to the last bit.

        Parameters
        ----------
        effects : the [effect.NAME] tables, where there are more than the wheels' physics can hold.
        """
        tables: list[tuple[str, dict[str, Any]]] = [("", {"schema": SCHEMA})]
        robot: dict[str, Any] = {"name": self.robot.name} if self.robot.name else {}
        for name in ("wheel_radius_m", "wheelbase_m", "counts_per_rev"):
            value = getattr(self.robot, name)
            if value is not None:
                robot[name] = value
        if robot:
            tables.append(("robot", robot))
        for side, wheel in (("left", self.left), ("right", self.right)):
            tables.append(
                (f"wheel.{side}", {"gain_mps": wheel.gain_mps, "time_constant_s": wheel.time_constant_s})
            )
        if self.rate_hz is not None:
            tables.append(("log", {"rate_hz": self.rate_hz}))
        held = self.effects() if effects is None else effects
        tables.extend((f"effect.{name}", dict(table)) for name, table in held.items())
        tables.append(("model.left", self.left.to_table()))
        tables.append(("model.right", self.right.to_table()))
        if self.source:
            tables.append(("source", dict(self.source)))
        if self.correction is not None:
            whole = self.correction.to_dict()
            terms = whole.pop("terms")
            tables.append(("correction", whole))
            tables += [("[correction.terms]", term) for term in terms]
        return "\n".join(_table(name, table) for name, table in tables)

    def effects(self) -> dict[str, dict[str, float]]:
        """What the wheels contain beyond gain and time constant, by the catalogue's names."""
        left, right = self.left, self.right
        both = (left, right)
        found: dict[str, dict[str, float]] = {}
        if any(wheel.breakaway_excess for wheel in both):
            found["stribeck_friction"] = {
                "left": left.friction,
                "right": right.friction,
                "breakaway_left": left.friction + left.breakaway_excess,
                "breakaway_right": right.friction + right.breakaway_excess,
                # Breakaway friction at rest alone: over the shortest speed that the diagnosis knows.
                "stribeck": max(left.stribeck_mps, right.stribeck_mps)
                or AT_REST * max(left.gain_mps, right.gain_mps),
            }
        elif any(wheel.friction for wheel in both):
            found["coulomb_friction"] = {"left": left.friction, "right": right.friction}
        if any(wheel.drag for wheel in both):
            found["quadratic_drag"] = {"left": left.drag, "right": right.drag}
        if any(wheel.delay_s for wheel in both):
            found["input_delay"] = _apart("delay", left.delay_s, right.delay_s)
        if any(wheel.lag_s for wheel in both):
            found["driver_lag"] = {"time_constant": 0.5 * (left.lag_s + right.lag_s)}
        if any(wheel.deadband for wheel in both):
            found["driver_deadband"] = {"deadband": 0.5 * (left.deadband + right.deadband)}
        if any(wheel.reverse_gain != 1.0 for wheel in both):
            found["direction_asymmetry"] = {"left": left.reverse_gain, "right": right.reverse_gain}
        if any(wheel.reverse_friction != 1.0 for wheel in both):
            ratios = {"left": left.reverse_gain, "right": right.reverse_gain}
            ratios |= {"friction_left": left.reverse_friction, "friction_right": right.reverse_friction}
            found["direction_asymmetry"] = ratios
        if any(wheel.recorder_lag_s for wheel in both):
            found["speed_filter"] = _apart("time_constant", left.recorder_lag_s, right.recorder_lag_s)
        return found

    def save(self, path: str | Path) -> None:
        """Write the file, and the folders above it that are missing."""
        replace_file(path, self.to_toml().encode("utf-8"))


def _apart(name: str, left_s: float, right_s: float) -> dict[str, float]:
    """An effect's number as both wheels' mean, and how much larger the right wheel's is where they differ."""
    mean = {name: 0.5 * (left_s + right_s)}
    return mean | ({"difference": right_s - left_s} if right_s != left_s else {})


def parse_robot_model(text: str, path: str | Path = "model.toml") -> RobotModel:
    """Inverse of `RobotModel.to_toml`; errors name `path`."""
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BaselineError(path, f"not valid TOML: {error}") from None
    schema = tree.get("schema", SCHEMA)
    if schema != SCHEMA:
        raise BaselineError(path, f"its schema is {schema!r}; this version of truing reads {SCHEMA}")
    model = tree.get("model")
    sides = ("left", "right")
    if not isinstance(model, dict) or not all(isinstance(model.get(side), dict) for side in sides):
        raise BaselineError(
            path,
            "[model.left] and [model.right] are missing",
            "This looks like a baseline; a fitted model is written by truing identify",
        )
    try:
        left = WheelPhysics.from_table(model["left"], "[model.left]")
        right = WheelPhysics.from_table(model["right"], "[model.right]")
    except TruingError as error:
        raise BaselineError(path, error.message) from None
    robot = tree.get("robot", {})
    log = tree.get("log", {})
    source = tree.get("source", {})
    return RobotModel(
        left,
        right,
        RobotGeometry(
            str(robot.get("name", "")),
            _positive(path, robot, "wheel_radius_m"),
            _positive(path, robot, "wheelbase_m"),
            _positive(path, robot, "counts_per_rev"),
        ),
        _positive(path, log, "rate_hz"),
        {str(key): str(value) for key, value in source.items()},
        _correction(path, tree.get("correction")),
    )


def _correction(path: str | Path, table: Any) -> Correction | None:
    if table is None:
        return None
    try:
        return Correction.from_dict(table)
    except (KeyError, TypeError, ValueError) as error:
        raise BaselineError(path, f"[correction] cannot be read: {error}") from None


def read_robot_model(path: str | Path) -> RobotModel:
    """Read a fitted model."""
    try:
        text = Path(path).read_bytes().decode("utf-8")
    except FileNotFoundError:
        raise BaselineError(path, "no such file") from None
    except UnicodeDecodeError as error:
        raise BaselineError(path, f"byte {error.start} is not UTF-8 text") from None
    except OSError as error:
        raise BaselineError(path, f"cannot be read: {error.strerror}") from None
    return parse_robot_model(text, path)


def _positive(path: str | Path, table: dict[str, Any], key: str) -> float | None:
    value = table.get(key)
    if value is None:
        return None
    good = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not good or not math.isfinite(value) or value <= 0.0:
        raise BaselineError(path, f"{key} must be a number above zero, not {value!r}")
    return float(value)


def _table(name: str, table: dict[str, Any]) -> str:
    lines = [f"[{name}]"] if name else []
    lines += [f"{key} = {_literal(value)}" for key, value in table.items()]
    return "\n".join(lines) + "\n"


def _literal(value: Any) -> str:
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        clean = "".join(c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}" for c in escaped)
        return f'"{clean}"'
    if isinstance(value, int):
        return str(value)
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_literal, value))}]"
    return repr(float(value))
