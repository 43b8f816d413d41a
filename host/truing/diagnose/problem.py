"""What every fit of a diagnosis shares: the simulator, the measured signals, their noise, the free numbers.

Wheels and pose are judged each on their own noise (whitened), and then stacked: an effect that shows
only in one of them is weighed there, an effect that shows in both must agree with both.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.data import POSE_HORIZON_S as POSE_HORIZON_S
from truing.diagnose.data import SetData
from truing.diagnose.noise import MEMORY_TAUS, Noise, estimate_noise, lag_index, lags_for, whiten
from truing.diagnose.simulation.simulator import SetSimulator
from truing.model.kernel import FloatArray, IntArray

# Whitened residuals beyond this many standard deviations pull no harder than this: one bad sample, one
# knock against the robot, decides nothing (Huber 1964).
CLIP = 4.0
# Rounding to whole counts gives a differenced speed an RMS of sqrt(1/6) of a count per row; and no speed
# is known better than to a hundred-thousandth of the robot's fastest.
LEAST_COUNTS, LEAST_OF_TOP = 0.4, 1e-5


@dataclass(frozen=True, slots=True)
class Column:
    """One number that a fit may change: one entry of the simulator's vector, or several that are tied."""

    name: str
    entries: tuple[int, ...]
    lower: float
    upper: float
    start: float


@dataclass(frozen=True, slots=True)
class Residual:
    """Model against recording at one parameter vector.

    Attributes
    ----------
    speeds : shape (n, 2), m/s, simulated.
    wheels : shape (n, 2), whitened, in standard deviations; uncounted rows are zero.
    pose : shape (m, 3), in standard deviations; what was not measured is zero.
    """

    speeds: FloatArray
    wheels: FloatArray
    pose: FloatArray

    def flat(self) -> FloatArray:
        """One vector, clipped softly (Huber's square root) for a search."""
        e = np.concatenate((self.wheels.ravel(), self.pose.ravel()))
        size = np.abs(e)
        return np.where(size > CLIP, np.sign(e) * np.sqrt(np.maximum(2.0 * CLIP * size - CLIP**2, 0.0)), e)


@dataclass(frozen=True)
class Problem:
    """Recordings, simulator and noise; `counted` (n, 2) and `pose_counted` (m,) say what a fit sees."""

    data: SetData
    simulator: SetSimulator
    noise: Noise
    pose_sigma: FloatArray
    counted: FloatArray
    pose_counted: FloatArray
    lagged: IntArray
    tied: bool = False
    base_effects: tuple[str, ...] = ()
    base_columns: tuple[Column, ...] = field(default=())
    told: dict[str, float] = field(default_factory=dict)

    def evidence(self, effects: tuple[str, ...]) -> float:
        """What the signals say directly for these effects, nats."""
        return sum(self.told.get(name, 0.0) for name in effects)

    def masks(self, effects: tuple[str, ...]) -> np.ndarray:
        """Which effects are on, for the simulator."""
        return self.simulator.enabled((*self.base_effects, *effects))

    def residual(self, theta: FloatArray, effects: tuple[str, ...]) -> Residual:
        """Simulate and compare."""
        on = self.masks(effects)
        speeds = self.simulator.speeds(theta, on)
        return Residual(speeds, self.whiten(self.data.speed_mps - speeds), self.pose(theta, on))

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Speeds (n, 2) or their derivatives (n, 2, p) in standard deviations of white noise."""
        return whiten(self.noise, columns, self.counted, self.lagged)

    def pose(self, theta: FloatArray, on: np.ndarray) -> FloatArray:
        """Pose residuals (m, 3) in standard deviations; zero where nothing was measured."""
        if not len(self.pose_counted):
            return np.zeros((0, 3))
        raw = self.simulator.pose_residuals(theta, on, self.data.pose_horizon_s)
        scaled = raw / self.pose_sigma * self.pose_counted[:, None]
        return np.asarray(np.where(np.isfinite(scaled), scaled, 0.0))

    def raw_pose(self, theta: FloatArray, effects: tuple[str, ...]) -> FloatArray:
        """Pose residuals (m, 3) in m, m, rad; zero where nothing was measured."""
        if not len(self.pose_counted):
            return np.zeros((0, 3))
        raw = self.simulator.pose_residuals(theta, self.masks(effects), self.data.pose_horizon_s)
        return np.asarray(np.where(np.isfinite(raw), raw, 0.0))

    def flattened(self, speeds: FloatArray, pose: FloatArray) -> FloatArray:
        """Changes of speeds (n, 2, k) and of the pose (m, 3, k) as columns beside the flat residual."""
        width = speeds.shape[2]
        white = self.whiten(speeds).reshape(-1, width)
        scaled = pose / self.pose_sigma[:, None] * self.pose_counted[:, None, None]
        return np.concatenate((white, scaled.reshape(-1, width)))

    def jacobian(
        self, theta: FloatArray, effects: tuple[str, ...], columns: tuple[Column, ...]
    ) -> FloatArray:
        """Derivatives of the flat residual, shape (2n + 3m, p), without the clipping."""
        on = self.masks(effects)
        free = [entry for column in columns for entry in column.entries]
        raw = self.simulator.jacobian(theta, on, free)
        owner = np.repeat(np.arange(len(columns)), [len(column.entries) for column in columns])
        wheels = np.zeros((*raw.shape[:2], len(columns)))
        for k, column in enumerate(owner):
            wheels[:, :, column] += raw[:, :, k]
        white = -self.whiten(wheels).reshape(-1, len(columns))
        if not len(self.pose_counted):
            return white
        at = self.pose(theta, on)
        pose = np.zeros((at.size, len(columns)))
        for k, column in enumerate(columns):
            if not moves_pose(column, self.data.commanded):
                continue
            moved = theta.copy()
            step = 1e-4 * max(abs(column.upper - column.lower), 1e-3)
            step = -step if moved[column.entries[0]] + step > column.upper else step
            moved[list(column.entries)] += step
            pose[:, k] = (self.pose(moved, on) - at).ravel() / step
        return np.concatenate((white, pose))

    def restricted(self, counted: FloatArray, pose_counted: FloatArray) -> Problem:
        """The same problem on some of the rows and pose windows."""
        return replace(self, counted=counted, pose_counted=pose_counted)

    def for_thread(self) -> Problem:
        """The same problem with a simulator of its own, whose scratch memory no other thread writes."""
        return replace(self, simulator=self.simulator.select(range(self.data.runs)))

    def with_noise(self, noise: Noise, pose_sigma: FloatArray | None = None) -> Problem:
        """The same problem with another idea of the noise."""
        return replace(self, noise=noise, pose_sigma=self.pose_sigma if pose_sigma is None else pose_sigma)

    def columns_of(self, effects: tuple[str, ...]) -> tuple[Column, ...]:
        """The free numbers with these effects added: the baseline's, then the effects'."""
        return self.base_columns + tuple(
            column for name in effects for column in effect_columns(self.simulator, name)
        )


def moves_pose(column: Column, commanded: bool) -> bool:
    """Whether a number changes where the robot goes while its wheels are measured."""
    effect = column.name.split(".")[0]
    return commanded or ("." in column.name and CATALOGUE[effect].domain != "wheel")


def effect_columns(simulator: SetSimulator, name: str) -> tuple[Column, ...]:
    """The free numbers of one effect; what its file marks as scanned is searched by starts, then fitted."""
    layout = simulator.layout
    return tuple(
        Column(
            f"{name}.{parameter.name}",
            (layout.index(f"{name}.{parameter.name}"),),
            float(layout.lower[layout.index(f"{name}.{parameter.name}")]),
            float(layout.upper[layout.index(f"{name}.{parameter.name}")]),
            parameter.off,
        )
        for parameter in CATALOGUE[name].parameters
        if not (parameter.scan and parameter.nuisance)
    )


def base_columns(simulator: SetSimulator, tied: bool, base_effects: tuple[str, ...]) -> tuple[Column, ...]:
    """Gains and time constants (of both wheels together when `tied`), and the baseline's own effects."""
    layout = simulator.layout
    start = simulator.start()
    columns: list[Column] = []
    for kind in ("gain", "tau"):
        left, right = layout.index(f"{kind}_left"), layout.index(f"{kind}_right")
        groups = (
            ((f"{kind}_both", (left, right)),)
            if tied
            else (
                (f"{kind}_left", (left,)),
                (f"{kind}_right", (right,)),
            )
        )
        for name, entries in groups:
            value = float(start[entries[0]])
            columns.append(Column(name, entries, 0.02 * value, 20.0 * value, value))
    for effect in base_effects:
        columns += [
            replace(column, start=float(start[column.entries[0]]))
            for column in effect_columns(simulator, effect)
        ]
    return tuple(columns)


def lagged_rows(data: SetData) -> IntArray:
    """Row numbers of each row's predecessors for the noise model."""
    return lag_index(data.starts, len(data), lags_for(float(np.median(data.interval_s))))


def noise_left(data: SetData, residual: FloatArray, counted: FloatArray, taus_s: FloatArray) -> Noise:
    """The noise of both wheels if `residual` (n, 2), m/s, is all noise; `taus_s` (2,) bounds its memory."""
    floor = np.full(2, max(LEAST_COUNTS * data.resolution_mps, LEAST_OF_TOP * data.top_mps))
    interval_s = float(np.median(data.interval_s))
    return estimate_noise(residual, counted, data.starts, interval_s, MEMORY_TAUS * taus_s, floor)


def pose_spread(problem: Problem, theta: FloatArray, effects: tuple[str, ...]) -> FloatArray:
    """RMS of each pose component that these numbers leave over, robustly, shape (3,), m, m, rad."""
    spread = np.ones(3)
    if not len(problem.pose_counted):
        return spread
    raw = problem.simulator.pose_residuals(theta, problem.masks(effects), problem.data.pose_horizon_s)
    for k in range(3):
        seen = raw[np.isfinite(raw[:, k]), k]
        if len(seen):
            spread[k] = max(1.4826 * float(np.median(np.abs(seen))), 0.3 * float(np.std(seen)), 1e-5)
    return spread
