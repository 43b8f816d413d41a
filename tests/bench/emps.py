"""The EMPS positioning axis: identified on the first file alone, simulated once on the second.

Protocol. Structure and horizon are chosen by two-fold validation inside the first file: fitted on one
half (12.4 s) in segments of the horizon's length, each with an initial speed of its own, and judged by
the free-run position error over the whole other half. The winner is fitted again to the whole first
file. The second file is read after that, and simulated open loop over its 24.8 s from its first
position and the slope of its first 20 ms; nothing was chosen with it.

The axis: M dv/dt = g u(t) - viscous_s v - s (coulomb + stribeck) - offset - drift, s the direction of
motion; the drift is linear in the time since the recording's start (the drive warms up), or
exponential, or absent.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat

from bench.figure import Figure
from truing.levenberg import minimise
from truing.model import kernel

Array = NDArray[np.float64]

INTERVAL_S = 1e-3
HORIZONS_S = (1.0, 3.105, 6.21, 12.42)
VISCOUS = ("acceleration", "decay", "friction", "offset")
ASYMMETRIC = (*VISCOUS, "reverse_decay")
STRUCTURES = {
    "viscous": VISCOUS,
    "asymmetric": ASYMMETRIC,
    "asymmetric, Stribeck": (*ASYMMETRIC, "excess", "stribeck"),
    "asymmetric, drag": (*ASYMMETRIC, "drag"),
}
DRIFTS: dict[str, tuple[str, ...]] = {
    "no drift": (),
    "linear drift": ("drift",),
    "exponential drift": ("warming", "warming_s"),
}
# name: start, lower, upper (volts, seconds, metres)
RANGES = {
    "acceleration": (0.37, 0.05, 2.0),
    "decay": (2.1, 0.2, 10.0),
    "friction": (0.57, 0.0, 2.0),
    "offset": (0.0, -1.0, 1.0),
    "reverse_decay": (1.0, 0.2, 5.0),
    "excess": (0.05, 0.0, 1.0),
    "stribeck": (0.02, 1e-3, 0.2),
    "drag": (0.01, -20.0, 50.0),
    "drift": (0.0, -0.5, 0.5),
    "warming": (-0.01, -0.5, 0.5),
    "warming_s": (20.0, 0.5, 60.0),
}
PEERS_MM = {"linear state space": 5.53, "NARX": 5.17}
BAR_MM = 5.2


@dataclass(frozen=True)
class Axis:
    """One recording: time (s), drive signal over the millisecond before each row (V), position (m)."""

    t: Array
    drive: Array
    position: Array


@dataclass(frozen=True)
class Choice:
    """A structure and a horizon, and the validation error that they reached (mm)."""

    structure: str
    horizon_s: float
    validation_mm: float
    folds_mm: tuple[float, ...] = field(default=())


def read_axis(path: Path) -> Axis:
    """One of the benchmark's MATLAB files."""
    data = loadmat(path)
    position = data["qm"].ravel().astype(np.float64)
    drive = data["vir"].ravel().astype(np.float64)
    # The controller holds its output until the next sample: row k+1 is driven by vir(k).
    held = np.concatenate((drive[:1], drive[:-1]))
    return Axis(INTERVAL_S * np.arange(len(position)), held, position)


class Segments:
    """Rows lo..hi of a recording cut into segments of one horizon, each with its initial state."""

    def __init__(self, axis: Axis, lo: int, hi: int, horizon_s: float) -> None:
        step = round(horizon_s / INTERVAL_S)
        cuts = list(range(lo, hi - step // 2, step)) or [lo]
        self.t, self.drive, self.position = axis.t[lo:hi], axis.drive[lo:hi], axis.position[lo:hi]
        self.starts = np.array([*cuts, hi], dtype=np.int64) - lo
        self.segment = np.repeat(np.arange(len(cuts)), np.diff(self.starts))
        self.first = self.position[self.starts[:-1]]
        self.speed = np.array([_slope(axis.position, cut) for cut in cuts])

    def simulate(self, values: dict[str, float], speed: Array) -> Array:
        """Position in free run (m)."""
        drive = self.drive
        if "drift" in values:
            drive = drive + values["drift"] * (self.t / 12.4 - 1.0)
        if "warming" in values:
            drive = drive + values["warming"] * np.exp(-self.t / values["warming_s"])
        quiet = np.zeros_like(self.t)
        interval = np.full(len(speed), INTERVAL_S)
        inputs = kernel.Inputs(self.t, self.starts, self.t, drive, quiet, self.starts, interval, speed)
        outputs = kernel.new_outputs(len(self.t))
        kernel.rollout(_vector(values), inputs, outputs, True, 2.5e-3)
        return outputs.travel + self.first[self.segment]


def _slope(position: Array, row: int) -> float:
    lo, hi = max(row - 20, 0), min(row + 21, len(position))
    return float(np.polyfit(INTERVAL_S * (np.arange(lo, hi) - row), position[lo:hi], 2)[-2])


def _vector(values: dict[str, float]) -> Array:
    p = np.zeros(kernel.PARAMETER_COUNT)
    forward = values["decay"]
    reverse = forward * values.get("reverse_decay", 1.0)
    p[kernel.TAU_FORWARD], p[kernel.TAU_REVERSE] = 1.0 / forward, 1.0 / reverse
    p[kernel.GAIN_FORWARD] = values["acceleration"] / forward
    p[kernel.GAIN_REVERSE] = values["acceleration"] / reverse
    p[kernel.FRICTION_FORWARD] = p[kernel.FRICTION_REVERSE] = values["friction"]
    p[kernel.EXCESS_FORWARD] = p[kernel.EXCESS_REVERSE] = values.get("excess", 0.0)
    p[kernel.STRIBECK_MPS], p[kernel.STRIBECK_SHAPE] = values.get("stribeck", 0.0), 1.0
    p[kernel.DRAG] = values.get("drag", 0.0)
    p[kernel.OFFSET] = values["offset"]
    return p


def fit(data: Segments, names: Sequence[str]) -> dict[str, float]:
    """Parameters that minimise the position error inside the segments, initial speeds free."""
    count = len(names)
    scale = 1e3 / np.sqrt(len(data.t))

    def values(theta: Array) -> dict[str, float]:
        return {name: float(theta[k]) for k, name in enumerate(names)}

    def residual(theta: Array) -> Array:
        return scale * (data.simulate(values(theta), theta[count:].copy()) - data.position)

    def jacobian(theta: Array, r: Array) -> Array:
        result = np.zeros((len(r), len(theta)))
        for k in range(count):
            step = 1e-6 * max(abs(float(theta[k])), 0.01)
            moved = theta.copy()
            moved[k] += step
            result[:, k] = (residual(moved) - r) / step
        moved = theta.copy()
        moved[count:] += 1e-7
        change = (residual(moved) - r) / 1e-7
        for k in range(len(theta) - count):
            rows = data.segment == k
            result[rows, count + k] = change[rows]
        return result

    start, lower, upper = (
        np.concatenate(([RANGES[name][k] for name in names], tail))
        for k, tail in enumerate((data.speed, np.full(len(data.speed), -0.3), np.full(len(data.speed), 0.3)))
    )
    end = minimise(residual, jacobian, start, lower, upper, iterations=25, tolerance=1e-5)
    return values(end.theta)


def free_run_mm(axis: Axis, lo: int, hi: int, values: dict[str, float]) -> float:
    """RMS position error of one open-loop simulation of rows lo..hi (mm)."""
    data = Segments(axis, lo, hi, (hi - lo) * INTERVAL_S)
    return float(1e3 * np.sqrt(np.mean((data.simulate(values, data.speed) - data.position) ** 2)))


def choose(axis: Axis) -> list[Choice]:
    """Every structure and horizon with its validation error, best first."""
    half, end = len(axis.t) // 2, len(axis.t)
    folds = (((0, half), (half, end)), ((half, end), (0, half)))
    choices = []
    for structure, parameters in STRUCTURES.items():
        for drift, more in DRIFTS.items():
            for horizon in HORIZONS_S:
                errors = [
                    free_run_mm(axis, *judged, fit(Segments(axis, *fitted, horizon), parameters + more))
                    for fitted, judged in folds
                ]
                total = float(np.sqrt(np.mean(np.square(errors))))
                choices.append(Choice(f"{structure}, {drift}", horizon, total, tuple(errors)))
    return sorted(choices, key=lambda choice: choice.validation_mm)


def names_of(structure: str) -> tuple[str, ...]:
    """The parameters of a structure named by `choose`."""
    base, drift = structure.rsplit(", ", 1)
    return STRUCTURES[base] + DRIFTS[drift]


def folder(root: Path) -> Path:
    """Where the two files are."""
    named = os.environ.get("TRUING_RECORDINGS")
    return (Path(named) if named else root.parent / "shared" / "recordings") / "raw" / "emps"


def measure(root: Path) -> list[Figure]:
    """Choose and fit on the first file, report once on the second."""
    if not folder(root).is_dir():
        return []
    first = read_axis(folder(root) / "DATA_EMPS.mat")
    best = choose(first)[0]
    values = fit(Segments(first, 0, len(first.t), best.horizon_s), names_of(best.structure))
    second = read_axis(folder(root) / "DATA_EMPS_PULSES.mat")
    error = free_run_mm(second, 0, len(second.t), values)
    name = f"EMPS test, {best.structure}, {best.horizon_s:g} s"
    return [Figure(name, error, "mm", "less", BAR_MM, "NARX", PEERS_MM["NARX"])]


def main() -> None:
    """Print the whole protocol."""
    root = Path(__file__).resolve().parents[2]
    first = read_axis(folder(root) / "DATA_EMPS.mat")
    choices = choose(first)
    for choice in choices:
        folds = " ".join(f"{error:7.2f}" for error in choice.folds_mm)
        print(f"{choice.validation_mm:8.3f} mm  ({folds})  {choice.horizon_s:6.3f} s  {choice.structure}")
    best = choices[0]
    values = fit(Segments(first, 0, len(first.t), best.horizon_s), names_of(best.structure))
    print(best.structure, best.horizon_s, {name: round(value, 5) for name, value in values.items()})
    print(f"first file, one open loop: {free_run_mm(first, 0, len(first.t), values):.3f} mm")
    if "--test" in sys.argv:
        second = read_axis(folder(root) / "DATA_EMPS_PULSES.mat")
        print(f"second file, one open loop: {free_run_mm(second, 0, len(second.t), values):.3f} mm")


if __name__ == "__main__":
    main()
