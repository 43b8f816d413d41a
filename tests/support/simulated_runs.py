"""Recordings made of efforts, and a fine-stepped wheel pair that is independent of the diagnosis' kernel."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truing.diagnose.data.set_data import SetData, set_data
from truing.diagnose.simulation.simulator import SetSimulator
from truing.recording.baseline import Baseline, RobotGeometry, WheelModel
from truing.recording.run import RecordingSet, Run

Array = NDArray[np.float64]
RADIUS, WHEELBASE, RATE = 0.0635, 0.283, 20.0
GAIN, TAU = np.array([1.45, 1.40]), np.array([0.35, 0.30])


def baseline(effects: dict[str, dict[str, Any]] | None = None, equal: bool = False) -> Baseline:
    right = 0 if equal else 1
    return Baseline(
        Path("baseline.toml"),
        WheelModel(float(GAIN[0]), float(TAU[0])),
        WheelModel(float(GAIN[right]), float(TAU[right])),
        RobotGeometry("r", RADIUS, WHEELBASE, 2400.0),
        RATE,
        effects or {},
    )


def levels(*values: tuple[float, float], seconds: float = 1.0, rest: float = 0.5) -> Array:
    """Efforts (n, 2) per row: a rest, then the levels."""
    rows = [np.zeros((1 + round(rest * RATE), 2))]
    rows += [np.tile(value, (round(seconds * RATE), 1)) for value in values]
    return np.concatenate(rows)


RICH = (
    levels((0.6, 0.6), (-0.5, -0.5), (0.2, 0.9), (0.0, 0.0), (-0.9, 0.5), (0.12, 0.3), (0.0, 0.0)),
    levels((0.3, 0.0), (0.8, -0.8), (-0.8, 0.8), (1.0, 1.0), (-1.0, -1.0), (0.05, -0.05), (0.0, 0.0)),
)


def recording_set(
    efforts: tuple[Array, ...] = RICH,
    speeds: tuple[Array, ...] | None = None,
    *,
    source: str = "pos",
    effects: dict[str, dict[str, Any]] | None = None,
    equal: bool = False,
    extra: tuple[dict[str, Array], ...] = (),
) -> RecordingSet:
    """A set whose wheels moved as `speeds` (n, 2) say, m/s as means over each row; at rest where None."""
    runs = []
    for k, effort in enumerate(efforts):
        n = len(effort)
        speed = np.zeros((n, 2)) if speeds is None else speeds[k]
        columns = {"t_s": np.arange(n) / RATE, "effort_left": effort[:, 0], "effort_right": effort[:, 1]}
        if source in ("pos", "both"):
            travel = np.cumsum(speed, axis=0) / RATE
            columns |= {"pos_left_m": travel[:, 0], "pos_right_m": travel[:, 1]}
        if source in ("vel", "both"):
            columns |= {"vel_left_mps": speed[:, 0], "vel_right_mps": speed[:, 1]}
        if extra:
            columns |= extra[k]
        runs.append(Run(f"{k:02d}", columns))
    return RecordingSet("simulated", tuple(runs), baseline(effects, equal))


def recordings(*args: Any, **more: Any) -> SetData:
    """The same as the diagnosis takes it."""
    return set_data(recording_set(*args, **more))


def by_run(data: SetData, columns: Array) -> tuple[Array, ...]:
    """Rows of a whole set, cut into runs."""
    return tuple(columns[data.rows_of(k)] for k in range(data.runs))


def noisy_robot(
    efforts: tuple[Array, ...], effects: dict[str, dict[str, float]], noise_mps: float, seed: int
) -> SetData:
    """Recordings of a robot that is exactly the catalogue's effects with these numbers, and white noise."""
    still = recordings(efforts)
    simulator = SetSimulator(still)
    theta = simulator.start().copy()
    for effect, numbers in effects.items():
        for name, value in numbers.items():
            theta[simulator.layout.index(f"{effect}.{name}")] = value
    speeds = simulator.speeds(theta, simulator.enabled(tuple(effects)))
    noise = np.random.default_rng(seed).normal(0.0, noise_mps, speeds.shape)
    return recordings(efforts, by_run(still, speeds + noise))


Force = Callable[[float, Array, Array], Array]


def fine(
    effort: Array,
    force: Force,
    dry: Callable[[Array], Array] | None = None,
    *,
    step_s: float = 1e-4,
    slope: Array | None = None,
) -> Array:
    """Mean speeds per row (n, 2) of `dv/dt = slope (force(t, v, u) - friction)`, in tiny steps.

    `force` is in effort units, back-EMF included; `dry` gives friction's bound at a speed, which is applied
    implicitly: a step's change of speed is cut by what friction can take away, and no further.
    """
    slope = GAIN / TAU if slope is None else slope
    v = np.zeros(2)
    out = np.zeros_like(effort)
    steps = round(1.0 / RATE / step_s)
    t = 0.0
    for row in range(1, len(effort)):
        travel = np.zeros(2)
        for _ in range(steps):
            first = force(t, v, effort[row])
            middle = force(t + 0.5 * step_s, v + 0.5 * step_s * slope * first, effort[row])
            after = v + step_s * slope * middle
            if dry is not None:
                max_change = step_s * slope * dry(np.abs(v))
                after = np.sign(after) * np.maximum(np.abs(after) - max_change, 0.0)
            travel += 0.5 * (v + after) * step_s
            v = after
            t += step_s
        out[row] = travel * RATE
    return out


def motor(v: Array, u: Array) -> Array:
    """The baseline's effort: what drives less back-EMF."""
    return np.asarray(u - v / GAIN)
