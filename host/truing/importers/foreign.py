"""What every importer hands over: tests in somebody else's units, and how they become runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from truing.arrays import FloatArray
from truing.recording.axis import Axis, Motion
from truing.recording.run import Run, RunMetadata

if TYPE_CHECKING:
    from .mapping import Mapping

# The nominal supply that a fraction of effort is taken of where a file gives volts: WPILib's own reference.
NOMINAL_VOLTAGE_V = 12.0


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """What a foreign file cannot say itself.

    Parameters
    ----------
    nominal_voltage_v : full effort, V.
    metres_per_unit : wheel travel at the rim per unit of the file's positions, m.
    wheelbase_m : distance between the wheels, m; needed where only body speeds are commanded.
    full_speed_mps : wheel speed that counts as effort 1 where speeds are commanded and no effort is recorded.
    mapping : a mapping, its file, or None to look for one beside the data.
    spins : whether tests that turn the robot on the spot are wanted.
    full_effort : the number that a table without a mapping has for full effort.
    wheel_radius_m : turns a table's rotations into travel at the rim, m.
    pose : a table of its own with the pose from outside (time, x, y, heading) of the same drive.
    """

    nominal_voltage_v: float = NOMINAL_VOLTAGE_V
    metres_per_unit: float | None = None
    wheelbase_m: float | None = None
    full_speed_mps: float | None = None
    mapping: Path | Mapping | None = None
    spins: bool = True
    full_effort: float | None = None
    wheel_radius_m: float | None = None
    pose: Path | None = None


@dataclass(frozen=True, slots=True)
class Finding:
    """Something about a foreign file that its reader should know.

    `code` is a stable word for programs; `text` is one sentence for a person; `corrected` says
    whether the importer changed numbers because of it.
    """

    code: str
    text: str
    test: str = ""
    corrected: bool = False

    def __str__(self) -> str:
        return f"{self.test}: {self.text}" if self.test else self.text


@dataclass(slots=True)
class ForeignTest:
    """One test of a foreign file; arrays of equal length n. Index 0 is left, 1 is right.

    Attributes
    ----------
    time : shape (n,), in the file's own unit until `traps.settle_time` has seen it.
    volts : shape (2, n), V, or None where `effort` is given.
    effort : shape (2, n), -1..1, or None.
    position, speed : shape (2, n), metres and m/s after scaling, or None.
    command : shape (n,), the commanded fraction that the recorder kept, or None.
    time_known : the format or the user says the unit of time, so that it is not to be guessed.
    axis : both rows hold the numbers of this one motor or axis.
    """

    name: str
    time: FloatArray
    volts: FloatArray | None = None
    effort: FloatArray | None = None
    position: FloatArray | None = None
    speed: FloatArray | None = None
    command: FloatArray | None = None
    battery_v: FloatArray | None = None
    gyro_z_radps: FloatArray | None = None
    extra: dict[str, FloatArray] = field(default_factory=dict)
    time_known: bool = False
    axis: Axis | None = None

    def motion(self) -> FloatArray | None:
        """Something that moves as the wheels do, shape (2, n): the speed, or the position per row."""
        if self.speed is not None:
            return self.speed
        position = self.position
        if position is None and {"ticks_left", "ticks_right"} <= self.extra.keys():
            position = np.array([self.extra["ticks_left"], self.extra["ticks_right"]])
        if position is None or position.shape[1] < 2:
            return None
        return np.asarray(np.gradient(position, axis=1))

    def effort_or_volts(self, options: ImportOptions) -> FloatArray:
        """Applied effort, shape (2, n), -1..1."""
        if self.effort is not None:
            return self.effort
        assert self.volts is not None
        return self.volts / options.nominal_voltage_v


@dataclass(frozen=True, slots=True)
class Imported:
    """The runs of a foreign file, in truing's own form, and what was found on the way."""

    source: Path
    kind: str
    runs: tuple[Run, ...]
    findings: tuple[Finding, ...]

    def of_axis(self, motion: Motion | None) -> Imported:
        """The runs taken as one motor or axis, whose numbers are the left side's; None: as they are."""
        if motion is None:
            return self
        return replace(self, runs=tuple(run.of_axis(Axis(motion)) for run in self.runs))


def to_run(
    test: ForeignTest, number: int, options: ImportOptions, source: Path, findings: Sequence[Finding]
) -> Run:
    """A run in truing's own form; the name orders it in the set, the metadata says where it came from."""
    effort = test.effort_or_volts(options)
    columns: dict[str, FloatArray] = {
        "t_s": test.time - test.time[0],
        "effort_left": effort[0],
        "effort_right": effort[1],
    }
    if test.position is not None:
        travel = test.position - test.position[:, :1]
        columns |= {"pos_left_m": travel[0], "pos_right_m": travel[1]}
    if test.speed is not None:
        columns |= {"vel_left_mps": test.speed[0], "vel_right_mps": test.speed[1]}
    for name, values in (("battery_v", test.battery_v), ("gyro_z_radps", test.gyro_z_radps)):
        if values is not None:
            columns[name] = values
    columns |= test.extra
    for name in ("ticks_left", "ticks_right"):
        if name in columns:
            columns[name] = columns[name] - columns[name][0]
    said = tuple(finding.text for finding in findings if finding.test in ("", test.name))
    extra = {"imported_from": source.name, "test": test.name, "findings": list(said)}
    return Run(
        f"{number:02d}_{test.name}",
        columns,
        order=tuple(columns),
        path=source,
        metadata=RunMetadata(extra=extra),
        warnings=said,
        axis=test.axis,
    )
