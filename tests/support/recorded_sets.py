"""Recording sets of a plain first-order robot, in memory and on disk, with faults put in on request."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from truing.recording.baseline import Baseline, RobotGeometry, WheelModel
from truing.recording.run import RecordingSet, Run

GAIN_MPS, TAU_S, RATE_HZ = 1.45, 0.35, 20.0
RADIUS_M, WHEELBASE_M, COUNTS = 0.0635, 0.283, 2400.0
Columns = dict[str, np.ndarray]
Change = Callable[[str, Columns], None]

BASELINE_TOML = """[robot]
name = "plain"
wheel_radius_m = 0.0635
wheelbase_m = 0.283
counts_per_rev = 2400

[wheel.left]
gain_mps = 1.45
time_constant_s = 0.35
[wheel.right]
gain_mps = 1.45
time_constant_s = 0.35

[log]
rate_hz = 20
"""


def baseline(*, geometry: bool = True) -> Baseline:
    robot = RobotGeometry("plain", RADIUS_M, WHEELBASE_M, COUNTS) if geometry else None
    wheel = WheelModel(GAIN_MPS, TAU_S)
    return Baseline(Path("baseline.toml"), wheel, wheel, robot, RATE_HZ)


def levels(number: int) -> list[tuple[float, float]]:
    """Left and right effort of a run's segments, one second each."""
    turned = number % 3 == 2
    pattern = [0.0, 0.3, 0.5, 0.0, -0.4, -0.2, 0.6, 0.0]
    return [(level, (-level if turned else 0.9 * level)) for level in pattern]


def columns(number: int = 1, segments: list[tuple[float, float]] | None = None) -> Columns:
    """One run of a first-order robot: counts are whole numbers, efforts hold for a second each."""
    per_segment = round(RATE_HZ)
    efforts = np.repeat(np.array(segments or levels(number)), per_segment, axis=0)
    decay = np.exp(-1.0 / RATE_HZ / TAU_S)
    speed, travel = np.zeros(2), np.zeros(2)
    travels = [travel.copy()]
    for effort in efforts[1:]:
        target = GAIN_MPS * effort
        after = target + (speed - target) * decay
        travel = travel + target / RATE_HZ + (speed - target) * TAU_S * (1.0 - decay)
        speed = after
        travels.append(travel.copy())
    per_count = 2.0 * np.pi * RADIUS_M / COUNTS
    ticks = np.floor(np.array(travels) / per_count)
    return {
        "t_s": np.arange(len(efforts)) / RATE_HZ,
        "effort_left": efforts[:, 0].copy(),
        "effort_right": efforts[:, 1].copy(),
        "ticks_left": ticks[:, 0].copy(),
        "ticks_right": ticks[:, 1].copy(),
    }


def recordings(count: int = 4, change: Change | None = None, *, geometry: bool = True) -> RecordingSet:
    """Some runs in memory; `change(name, columns)` spoils each of them."""
    runs = []
    for number in range(1, count + 1):
        values = columns(number)
        name = f"{number:02d}_levels"
        if change is not None:
            change(name, values)
        runs.append(Run(name, values, order=tuple(values)))
    return RecordingSet("plain", tuple(runs), baseline(geometry=geometry))


def write_set(folder: Path, count: int = 4, change: Change | None = None, model: str = BASELINE_TOML) -> Path:
    """The same on disk (docs/DATA_FORMAT.md, section 1)."""
    (folder / "runs").mkdir(parents=True)
    (folder / "baseline.toml").write_text(model)
    for run in recordings(count, change):
        write_csv(folder / "runs" / f"{run.name}.csv", run.columns)
    return folder


def write_csv(path: Path, values: Columns) -> None:
    rows = zip(*(column.tolist() for column in values.values()), strict=True)
    lines = [",".join(values), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def with_speeds(values: Columns, scale: float = 1.0) -> None:
    """Replace counts by speeds, as a recorder without counts has them."""
    per_count = 2.0 * np.pi * RADIUS_M / COUNTS
    for side in ("left", "right"):
        travel = values.pop(f"ticks_{side}") * per_count
        values[f"vel_{side}_mps"] = scale * np.diff(travel, prepend=0.0) * RATE_HZ
