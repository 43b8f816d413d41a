"""A robot that is exactly first order, with a known gain and time constant, and its log."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from truing.recording.baseline import Baseline, RobotGeometry, WheelModel
from truing.recording.run import Run

STEP_S = 0.001
RADIUS_M = 0.0635
WHEELBASE_M = 0.283
COUNTS_PER_REV = 2400

GEOMETRY = RobotGeometry("first order", RADIUS_M, WHEELBASE_M, COUNTS_PER_REV)
BASELINE = Baseline(Path("baseline.toml"), WheelModel(1.45, 0.35), WheelModel(1.45, 0.35), GEOMETRY, 20.0)

# What paper test XI commands: rest, three levels of 2 s each, rest.
TEST_XI = ((1.0, 0.0), (2.0, 0.35), (2.0, 0.50), (2.0, 0.45), (2.0, 0.0))


@dataclass(frozen=True)
class FirstOrderRobot:
    """Both wheels alike unless `right` says otherwise.

    `disturbance` is the standard deviation (effort) of a torque that wanders with the memory
    `disturbance_memory_s`; `jitter` spreads the log's sampling times (share of an interval).
    """

    gain_mps: float = 1.45
    time_constant_s: float = 0.30
    right_gain_mps: float | None = None
    disturbance: float = 0.0
    disturbance_memory_s: float = 0.05
    jitter: float = 0.0

    def drive(
        self,
        plan: tuple[tuple[float, float], ...],
        *,
        rate_hz: float = 20.0,
        start_s: float = 0.0,
        seed: int = 1,
        name: str = "01_steps",
        right_share: float = 1.0,
        mode: str = "effort",
        columns: tuple[str, ...] = ("ticks", "cmd"),
    ) -> Run:
        """Run a plan of (duration s, effort or speed) and log it.

        `start_s` shifts the plan against the log's clock, so that steps fall inside intervals.
        """
        rng = np.random.default_rng(seed)
        duration = sum(seconds for seconds, _ in plan)
        n = round(duration / STEP_S)
        time = STEP_S * np.arange(1, n + 1)
        ends = np.cumsum([seconds for seconds, _ in plan]) + start_s
        levels = np.array([value for _, value in plan])
        # The input of the step that ends at `time`.
        command = levels[np.minimum(np.searchsorted(ends, time - 0.5 * STEP_S, side="right"), len(plan) - 1)]
        logged = self._log_steps(n, rate_hz, rng)
        # In velocity mode an ideal inner loop asks for the effort whose steady speed is the command.
        gains = (self.gain_mps, self.right_gain_mps or self.gain_mps)
        data: dict[str, NDArray[np.float64]] = {"t_s": STEP_S * logged.astype(float)}
        for side, gain, share in zip(("left", "right"), gains, (1.0, right_share), strict=True):
            effort = share * command / (gain if mode == "velocity" else 1.0)
            travel = self._wheel(effort, gain, rng)
            data |= self._columns(side, columns, logged, effort, share * command, travel)
        modes = tuple([mode] * len(logged)) if "cmd" in columns else None
        order = [*data, "mode"] if modes else [*data]
        return Run(name, data, modes, {}, tuple(order))

    def _log_steps(self, n: int, rate_hz: float, rng: np.random.Generator) -> NDArray[np.int64]:
        interval = round(1.0 / (rate_hz * STEP_S))
        steps = np.arange(0, n + 1, interval)
        if self.jitter:
            spread = rng.uniform(-0.5, 0.5, steps.size) * self.jitter * interval
            steps = np.clip(steps + np.round(spread).astype(int), 0, n)
            steps[0] = 0
        return np.unique(steps)

    def _wheel(
        self, effort: NDArray[np.float64], gain: float, rng: np.random.Generator
    ) -> NDArray[np.float64]:
        """Exact travel (m) after every step, with a leading zero."""
        driven = gain * (effort + self._disturbance(effort.size, rng))
        decay = np.exp(-STEP_S / self.time_constant_s)
        after = scipy.signal.lfilter([1.0 - decay], [1.0, -decay], driven)
        before = np.concatenate(([0.0], after[:-1]))
        # Over a step the speed goes from `before` towards `driven`; this is its exact integral.
        gone = driven * STEP_S + (before - driven) * (1.0 - decay) * self.time_constant_s
        return np.concatenate(([0.0], np.cumsum(gone)))

    def _disturbance(self, n: int, rng: np.random.Generator) -> NDArray[np.float64]:
        if self.disturbance == 0.0:
            return np.zeros(n)
        keep = np.exp(-STEP_S / self.disturbance_memory_s)
        shocks = rng.normal(0.0, self.disturbance * np.sqrt(1.0 - keep**2), n)
        shocks[0] = rng.normal(0.0, self.disturbance)
        return np.asarray(scipy.signal.lfilter([1.0], [1.0, -keep], shocks))

    @staticmethod
    def _columns(
        side: str,
        columns: tuple[str, ...],
        logged: NDArray[np.int64],
        effort: NDArray[np.float64],
        command: NDArray[np.float64],
        travel: NDArray[np.float64],
    ) -> dict[str, NDArray[np.float64]]:
        sums = np.concatenate(([0.0], np.cumsum(effort)))
        steps = np.diff(logged)
        mean_effort = np.concatenate(([effort[0]], np.diff(sums[logged]) / steps))
        out = {f"effort_{side}": np.round(mean_effort, 4)}
        if "cmd" in columns:
            out[f"cmd_{side}"] = command[np.maximum(logged - 1, 0)]
        mean_speed = np.diff(travel[logged]) / (steps * STEP_S)
        if "ticks" in columns:
            out[f"ticks_{side}"] = np.floor(travel[logged] * COUNTS_PER_REV / (2.0 * np.pi * RADIUS_M))
        if "vel" in columns:
            out[f"vel_{side}_mps"] = np.concatenate(([0.0], mean_speed))
        if "pos" in columns:
            out[f"pos_{side}_m"] = travel[logged]
        return out
