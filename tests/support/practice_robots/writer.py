"""A recording set on disk (docs/DATA_FORMAT.md, section 1)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from support.practice_robots.draws import Signals
from support.practice_robots.kernel import HEADING, SUPPLY, YAW_RATE, X
from support.practice_robots.recorder import Drive
from support.practice_robots.strength import Experiment, add_pose_noise, dead_reckoning

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class Log:
    """What the recorder writes beside the efforts."""

    signals: Signals
    truth: bool
    gyro: bool
    battery: bool
    command: bool
    truth_start: tuple[float, float, float]  # the run's start in the frame of the outside pose


def draw_log(rng: Generator, signals: Signals, *, truth_share: float, start_matters: bool) -> Log:
    truth = bool(rng.random() < truth_share)
    moved = not start_matters and rng.random() < 0.3
    start = (float(rng.uniform(-3, 3)), float(rng.uniform(-3, 3)), float(rng.uniform(-3, 3)))
    return Log(
        signals=signals,
        truth=truth,
        gyro=bool(rng.random() < (0.5 if truth else 0.1)),
        battery=bool(rng.random() < 0.6),
        command=bool(rng.random() < 0.5),
        truth_start=start if moved else (0.0, 0.0, 0.0),
    )


def _number(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def _column(values: Iterable[float], digits: int) -> list[str]:
    return [_number(float(value), digits) for value in values]


def write_set(
    folder: Path,
    experiment: Experiment,
    driven: Drive,
    log: Log,
    gain: Array,
    time_constant: Array,
    rng: Generator,
) -> None:
    """`folder/baseline.toml` and `folder/runs/*.csv`."""
    runs = folder / "runs"
    runs.mkdir(parents=True, exist_ok=True)
    for old in runs.glob("*.csv"):
        old.unlink()
    write_baseline(folder / "baseline.toml", experiment, gain, time_constant)
    layout = experiment.layout
    fine = bool(rng.random() < 0.5)
    per_count = 2 * np.pi * experiment.healthy.radius / experiment.nominal_counts
    for index in range(layout.runs):
        rows = np.flatnonzero(layout.row_run == index)
        columns: dict[str, list[str]] = {"t_s": _column(np.r_[0.0, layout.row_s[rows]], 3)}
        effort = np.vstack([np.zeros(2), layout.row_effort[rows]])
        if log.command:
            columns["mode"] = ["effort"] * len(effort)
            ends = np.flatnonzero(layout.row)[rows]
            command = np.vstack([np.zeros(2), layout.effort[ends]])
            columns["cmd_left"] = _column(command[:, 0], 4)
            columns["cmd_right"] = _column(command[:, 1], 4)
        columns["effort_left"] = _column(effort[:, 0], 4)
        columns["effort_right"] = _column(effort[:, 1], 4)
        travel = np.vstack([np.zeros(2), np.cumsum(driven.travel_m[rows], axis=0)])
        speed = np.vstack([np.zeros(2), driven.speed[rows]])
        if log.signals in ("own", "ticks", "filtered_beside_ticks"):
            ticks = np.rint(travel / per_count)
            columns["ticks_left"] = _column(ticks[:, 0], 0)
            columns["ticks_right"] = _column(ticks[:, 1], 0)
        if log.signals == "pos":
            columns["pos_left_m"] = _column(travel[:, 0], 6 if fine else 4)
            columns["pos_right_m"] = _column(travel[:, 1], 6 if fine else 4)
        if log.signals in ("own", "vel", "filtered", "filtered_beside_ticks"):
            columns["vel_left_mps"] = _column(speed[:, 0], 6 if fine else 3)
            columns["vel_right_mps"] = _column(speed[:, 1], 6 if fine else 3)
        if log.signals == "own":
            pose = dead_reckoning(driven.travel_m[rows], experiment.healthy.wheelbase)
            for name, axis, digits in (("x_m", 0, 3), ("y_m", 1, 3), ("theta_rad", 2, 4)):
                columns[name] = _column(pose[:, axis], digits)
        if log.battery:
            supply = np.r_[experiment.healthy.voltage, driven.rows[rows, SUPPLY]]
            columns["battery_v"] = _column(supply + rng.normal(0, 0.01, len(supply)), 2)
        if log.truth:
            path = np.vstack([np.zeros(3), driven.rows[rows, X : HEADING + 1]])
            seen = add_pose_noise(
                _placed(path, log.truth_start), experiment.pose_noise_m, experiment.heading_noise_rad, rng
            )
            for name, axis in (("truth_x_m", 0), ("truth_y_m", 1), ("truth_theta_rad", 2)):
                columns[name] = _column(seen[:, axis], 5)
        if log.gyro:
            rate = np.r_[0.0, driven.rows[rows, YAW_RATE]]
            columns["gyro_z_radps"] = _column(rate + rng.normal(0, 0.01, len(rate)), 4)
        lines = [",".join(columns), *(",".join(row) for row in zip(*columns.values(), strict=True))]
        (runs / f"{index + 1:02d}_run.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _placed(path: Array, start: tuple[float, float, float]) -> Array:
    c, s = np.cos(start[2]), np.sin(start[2])
    return np.stack(
        [
            start[0] + c * path[:, 0] - s * path[:, 1],
            start[1] + s * path[:, 0] + c * path[:, 1],
            start[2] + path[:, 2],
        ],
        axis=1,
    )


def write_baseline(path: Path, experiment: Experiment, gain: Array, time_constant: Array) -> None:
    """The user's first-order numbers and the nominal geometry."""
    lines = [
        "[robot]",
        'name = "practice"',
        f"wheel_radius_m = {experiment.healthy.radius:.9g}",
        f"wheelbase_m = {experiment.healthy.wheelbase:.9g}",
        f"counts_per_rev = {experiment.nominal_counts:g}",
    ]
    for w, name in enumerate(("left", "right")):
        lines += [
            f"[wheel.{name}]",
            f"gain_mps = {gain[w]:.6g}",
            f"time_constant_s = {time_constant[w]:.6g}",
        ]
    lines += ["[log]", f"rate_hz = {1 / experiment.layout.dt_s:g}"]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
