"""A wheel integrated in tiny steps, its encoder and its log: recordings whose truth is known.

It shares no code with the model under test: friction is a soft threshold on small steps, and
delay is a shift of the finely sampled command.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truing.recording.baseline import Baseline, RobotGeometry, WheelModel
from truing.recording.run import Run

Array = NDArray[np.float64]

RADIUS_M = 0.0635


@dataclass(frozen=True)
class Truth:
    """What the synthetic wheel is made of (speeds m/s, times s, efforts -1..1)."""

    gain: float = 1.45
    tau: float = 0.32
    delay: float = 0.0
    friction: float = 0.04
    breakaway: float = 0.04
    disturbance: float = 0.0
    disturbance_memory_s: float = 0.15
    reverse_gain: float = 1.0
    recorder_lag: float = 0.0


def staircase(
    seed: int, duration_s: float = 15.0, hold_s: tuple[float, float] = (0.6, 2.0)
) -> list[tuple[float, float]]:
    """A command of levels: (start in s, effort), with rests, reversals and small levels."""
    rng = np.random.default_rng(seed)
    steps, t = [(0.0, 0.0)], 0.5
    while t < duration_s - 0.5:
        level = float(rng.choice([0.0, 1.0, -1.0], p=[0.15, 0.5, 0.35]) * rng.uniform(0.08, 0.6))
        steps.append((t, level))
        t += float(rng.uniform(*hold_s))
    steps.append((duration_s - 0.5, 0.0))
    return steps


def record(
    truth: Truth,
    steps: list[tuple[float, float]],
    *,
    counts_per_rev: float = 2400.0,
    rate_hz: float = 20.0,
    duration_s: float = 15.0,
    seed: int = 0,
    name: str = "run",
    fine_s: float = 2e-4,
    drop_rows: tuple[int, int] | None = None,
) -> Run:
    """Drive the wheel with `steps` and log it; both wheels of the run are the same wheel.

    Parameters
    ----------
    drop_rows : rows that the recorder lost.
    """
    rng = np.random.default_rng(seed)
    n = round(duration_s / fine_s)
    time = np.arange(1, n + 1) * fine_s
    command = _level(steps, time - 0.5 * fine_s)
    delayed = _level(steps, time - 0.5 * fine_s - truth.delay)
    keep = np.exp(-fine_s / truth.disturbance_memory_s)
    kicks = rng.normal(size=n) * truth.disturbance * np.sqrt(1.0 - keep * keep)
    decay = np.exp(-fine_s / truth.tau)
    speed = np.empty(n)
    v, d = 0.0, 0.0
    for k in range(n):
        d = keep * d + kicks[k]
        forward = v > 0.0 or (v == 0.0 and delayed[k] >= 0.0)
        gain = truth.gain if forward else truth.gain * truth.reverse_gain
        free = decay * v + (1.0 - decay) * gain * (delayed[k] + d)
        hold = (1.0 - decay) * gain * (truth.breakaway if v == 0.0 else truth.friction)
        v_new = np.sign(free) * max(abs(free) - hold, 0.0)
        if v * v_new < 0.0:
            v_new = 0.0
        v = float(v_new)
        speed[k] = v
    # By the trapezium: ends of steps alone would bring the log forward by half a step.
    travel = np.cumsum(0.5 * (speed + np.concatenate(([0.0], speed[:-1])))) * fine_s
    every = round(1.0 / rate_hz / fine_s)
    rows = np.arange(every - 1, n, every)
    phase = rng.uniform()
    counts = np.floor(travel / (2.0 * np.pi * RADIUS_M) * counts_per_rev + phase)[rows]
    effort = np.concatenate(([0.0], np.add.reduceat(command, np.arange(0, n, every))[: len(rows)] / every))
    t = np.concatenate(([0.0], time[rows]))
    ticks = np.concatenate(([0.0], counts))
    keep_row = np.ones(len(t), dtype=bool)
    if drop_rows is not None:
        keep_row[drop_rows[0] : drop_rows[1]] = False
    columns: dict[str, Array] = {"t_s": t[keep_row]}
    for side in ("left", "right"):
        columns[f"effort_{side}"] = effort[keep_row]
        columns[f"ticks_{side}"] = ticks[keep_row]
    return Run(name, columns)


def baseline(counts_per_rev: float = 2400.0) -> Baseline:
    """Geometry for `record`; its wheels' numbers are of no use."""
    wheel = WheelModel(1.0, 0.1)
    robot = RobotGeometry("synthetic", RADIUS_M, 0.283, counts_per_rev)
    return Baseline(Path("baseline.toml"), wheel, wheel, robot)


def _level(steps: list[tuple[float, float]], time: Array) -> Array:
    starts = np.array([start for start, _ in steps])
    levels = np.array([level for _, level in steps])
    index = np.searchsorted(starts, time, side="right") - 1
    return np.where(index >= 0, levels[np.maximum(index, 0)], 0.0)
