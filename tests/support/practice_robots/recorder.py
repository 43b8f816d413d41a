"""From a plan to laid-out arrays, and from a drive to what a log shows of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import scipy
from numpy.random import Generator
from numpy.typing import NDArray

from support.practice_robots import kernel
from support.practice_robots.physics import Physics

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class Layout:
    """A plan laid end to end: `effort` (n, 2) per ms, run starts, row ends, row efforts (rows, 2)."""

    effort: Array
    start: NDArray[np.bool_]
    row: NDArray[np.bool_]
    row_effort: Array
    row_run: NDArray[np.int64]
    row_s: Array
    dt_s: float

    @classmethod
    def of(cls, runs: list[Array], rate_hz: float) -> Layout:
        """Rows end every 1 / rate_hz, which must be whole milliseconds."""
        every = round(1000 / rate_hz)
        cut = [run[: len(run) // every * every] for run in runs]
        effort = np.concatenate(cut)
        start = np.zeros(len(effort), bool)
        row = np.zeros(len(effort), bool)
        at, run_of_row, row_s = 0, [], []
        for index, run in enumerate(cut):
            start[at] = True
            row[at + every - 1 : at + len(run) : every] = True
            rows = len(run) // every
            run_of_row += [index] * rows
            row_s.append((np.arange(rows) + 1) * every / 1000)
            at += len(run)
        mean = effort.reshape(-1, every, 2).mean(axis=1)
        return cls(effort, start, row, mean, np.array(run_of_row), np.concatenate(row_s), every / 1000)

    @property
    def runs(self) -> int:
        return int(self.row_run[-1]) + 1


@dataclass(frozen=True)
class Drive:
    """What the robot did, row by row, with nominal geometry: (rows, 2) arrays.

    `speed` is what the log reports, from whole counts where quantised; `continuous` is the same
    without quantisation; `travel_m` is the rim's travel within the row as the encoder sees it.
    """

    rows: Array
    speed: Array
    continuous: Array
    travel_m: Array


def disturbance(
    rng: Generator, samples: int, size: float, memory_s: Array, per_ms_shape: Array | None = None
) -> Array:
    """An Ornstein-Uhlenbeck torque in effort units (n, 2), standard deviation `size`, memory (2,) s."""
    keep = np.exp(-1e-3 / memory_s)
    out = np.empty((samples, 2))
    for w in range(2):
        noise = rng.standard_normal(samples)
        out[:, w] = size * scipy.signal.lfilter([np.sqrt(1 - keep[w] ** 2)], [1, -keep[w]], noise)
    return out if per_ms_shape is None else out * per_ms_shape


def by_run_difference(values: Array, layout: Layout, at_start: Array) -> Array:
    """Row-to-row differences within runs; a run's first row against what stood at its start."""
    first = np.r_[True, np.diff(layout.row_run) > 0]
    before = np.roll(values, 1, axis=0)
    before[first] = at_start
    return values - before


def drive(
    physics: Physics,
    layout: Layout,
    torque: Array,
    *,
    nominal_counts: float,
    quantised: bool,
    seed: int,
) -> Drive:
    """Simulate the set. Quantisation and random losses only where `quantised`."""
    random = np.random.default_rng(seed)
    rows = kernel.simulate(physics, layout.effort, torque, layout.start, layout.row, quantised, random)
    factor = physics.counts_per_rev / nominal_counts
    starts = np.flatnonzero(np.r_[True, np.diff(layout.row_run) > 0])

    def travelled(values: Array) -> Array:
        before = np.vstack([np.zeros((1, 2)), values[starts[1:] - 1]])
        return by_run_difference(values, layout, before)

    continuous = travelled(rows[:, 0:2]) * factor * physics.radius
    travel = continuous
    if quantised:
        travel = travelled(rows[:, 4:6]) * (2 * np.pi * physics.radius / nominal_counts)
    if physics.speed_filter_s > 0:
        speed = rows[:, 6:8] * factor
        return Drive(rows, speed, speed, travel)
    return Drive(rows, travel / layout.dt_s, continuous / layout.dt_s, travel)
