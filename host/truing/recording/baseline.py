"""The baseline: what the user's simulation knows of the robot (baseline.toml, docs/DATA_FORMAT.md)."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from truing.errors import BaselineError


@dataclass(frozen=True, slots=True)
class WheelModel:
    """First-order wheel: steady speed per unit effort (m/s) and time constant (s)."""

    gain_mps: float
    time_constant_s: float


@dataclass(frozen=True, slots=True)
class RobotGeometry:
    """What turns encoder counts into travel, and wheel travel into a pose."""

    name: str = ""
    wheel_radius_m: float | None = None
    wheelbase_m: float | None = None
    counts_per_rev: float | None = None

    @property
    def metres_per_count(self) -> float | None:
        """Travel at the rim per encoder count (m), if radius and counts are both known."""
        if self.wheel_radius_m is None or self.counts_per_rev is None:
            return None
        return 2.0 * math.pi * self.wheel_radius_m / self.counts_per_rev

    def or_else(self, other: RobotGeometry | None) -> RobotGeometry:
        """The geometry, with what it does not say taken from another one."""
        if other is None:
            return self
        return RobotGeometry(
            self.name or other.name,
            other.wheel_radius_m if self.wheel_radius_m is None else self.wheel_radius_m,
            other.wheelbase_m if self.wheelbase_m is None else self.wheelbase_m,
            other.counts_per_rev if self.counts_per_rev is None else self.counts_per_rev,
        )


@dataclass(frozen=True, slots=True)
class Baseline:
    """A whole baseline.toml; `robot` is None when the file has no [robot] table.

    `reference_mps` are the full-effort speeds (left, right) that effects' numbers refer to, where these are
    not the gains: those of the baseline that the effects were found with. `effects` holds the optional
    [effect.NAME] tables as they stand: one per physical effect that the user's simulation already contains.
    `is_fitted`: nobody gave it, its numbers were fitted to the recordings that it stands beside.
    """

    path: Path
    left: WheelModel
    right: WheelModel
    robot: RobotGeometry | None = None
    log_rate_hz: float | None = None
    effects: dict[str, dict[str, Any]] = field(default_factory=dict)
    reference_mps: tuple[float, float] | None = None
    is_fitted: bool = False

    @property
    def full_effort_mps(self) -> tuple[float, float]:
        """The speeds (left, right) that effects' numbers refer to, m/s."""
        return self.reference_mps or (self.left.gain_mps, self.right.gain_mps)

    @property
    def metres_per_count(self) -> float | None:
        """Travel at the rim per encoder count (m), or None when the file does not say."""
        return None if self.robot is None else self.robot.metres_per_count

    @property
    def has_equal_wheels(self) -> bool:
        """Whether both wheels have the same gain and time constant."""
        return self.left == self.right

    @property
    def wheelbase_m(self) -> float | None:
        """Distance between the wheels' contact points (m), or None."""
        return None if self.robot is None else self.robot.wheelbase_m


def read_baseline(path: str | Path) -> Baseline:
    """Read and check a baseline.toml; every error names the file and the key."""
    path = Path(path)
    try:
        text = path.read_bytes().decode("utf-8")
    except FileNotFoundError:
        raise BaselineError(path, "no such file", "Give --model the path of a baseline.toml") from None
    except UnicodeDecodeError as error:
        raise BaselineError(path, f"byte {error.start} is not UTF-8 text") from None
    except OSError as error:
        raise BaselineError(path, f"cannot be read: {error.strerror}") from None
    return parse_baseline(text, path)


def parse_baseline(text: str, path: Path) -> Baseline:
    """A baseline from its text; errors name `path` and the key."""
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BaselineError(path, f"not valid TOML: {error}") from None

    reader = _Reader(path)
    wheel = reader.table(tree, "wheel", required=True)
    robot_table = tree.get("robot")
    return Baseline(
        path=path,
        left=reader.wheel(wheel, "left"),
        right=reader.wheel(wheel, "right"),
        robot=None if robot_table is None else reader.robot(reader.table(tree, "robot")),
        log_rate_hz=reader.positive(reader.table(tree, "log"), "log", "rate_hz"),
        effects={
            name: dict(reader.table(tree.get("effect", {}), name, prefix="effect."))
            for name in reader.table(tree, "effect")
        },
        reference_mps=reader.reference(tree),
    )


class _Reader:
    """Checked access to the tables of one TOML file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def table(
        self, tree: dict[str, Any], name: str, *, prefix: str = "", required: bool = False
    ) -> dict[str, Any]:
        value = tree.get(name)
        if value is None:
            if required:
                raise BaselineError(
                    self.path,
                    f"table [{prefix}{name}] is missing",
                    "A baseline needs [wheel.left] and [wheel.right] with gain_mps and time_constant_s",
                )
            return {}
        if not isinstance(value, dict):
            raise BaselineError(self.path, f"[{prefix}{name}] must be a table, not {value!r}")
        return value

    def positive(
        self, table: dict[str, Any], table_name: str, key: str, *, required: bool = False
    ) -> float | None:
        value = table.get(key)
        if value is None:
            if required:
                raise BaselineError(self.path, f"key {key!r} is missing in [{table_name}]")
            return None
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise BaselineError(self.path, f"[{table_name}] {key} must be a number, not {value!r}")
        if not math.isfinite(value) or value <= 0.0:
            raise BaselineError(self.path, f"[{table_name}] {key} must be above zero, not {value!r}")
        return float(value)

    def wheel(self, wheels: dict[str, Any], side: str) -> WheelModel:
        table = self.table(wheels, side, prefix="wheel.", required=True)
        name = f"wheel.{side}"
        gain = self.positive(table, name, "gain_mps", required=True)
        time_constant = self.positive(table, name, "time_constant_s", required=True)
        assert gain is not None
        assert time_constant is not None
        return WheelModel(gain, time_constant)

    def reference(self, tree: dict[str, Any]) -> tuple[float, float] | None:
        """The [reference] table: both speeds, or none."""
        table = self.table(tree, "reference")
        if not table:
            return None
        left, right = (
            self.positive(table, "reference", f"full_effort_{side}_mps", required=True)
            for side in ("left", "right")
        )
        assert left is not None
        assert right is not None
        return left, right

    def robot(self, table: dict[str, Any]) -> RobotGeometry:
        return RobotGeometry(
            name=str(table.get("name", "")),
            wheel_radius_m=self.positive(table, "robot", "wheel_radius_m"),
            wheelbase_m=self.positive(table, "robot", "wheelbase_m"),
            counts_per_rev=self.positive(table, "robot", "counts_per_rev"),
        )
