"""The estimation problem that all fits share: simulator, measured signals, noise model, free parameters.

Wheel and pose residuals are whitened with their own noise models and stacked into one vector.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.data.set_data import POSE_HORIZON_S as POSE_HORIZON_S
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import SIDES, Parameter
from truing.diagnose.noise import MEMORY_TAUS, Noise, Past, estimate_noise, past_of, white_noise, whiten
from truing.diagnose.noise_floor import NoiseFloor, noise_floor
from truing.diagnose.simulation.simulator import SetSimulator

# Threshold of the robust loss, standard deviations: beyond it the loss is linear, so that an outlier or an
# impact on the robot has bounded influence (Huber 1964).
CLIP = 4.0
# Lower bounds of the noise: quantisation gives a differenced speed an RMS of sqrt(1/6) of a count per row;
# and a hundred-thousandth of the robot's top speed.
MIN_NOISE_COUNTS, MIN_NOISE_SHARE = 0.4, 1e-5
# Upper bound of the noise, as a multiple of its floor: what a model leaves beyond is model error.
MAX_NOISE_OF_FLOOR = 1.5


@dataclass(frozen=True, slots=True)
class Column:
    """One free parameter of a fit: one entry of the simulator's vector, or several tied to one value.

    Attributes
    ----------
    wheel : the wheel whose speed alone it moves, or None.
    pull_mps : a plain fit pulls it towards `start`, as strongly as this error in every row for a change by 1.
    """

    name: str
    entries: tuple[int, ...]
    lower: float
    upper: float
    start: float
    wheel: int | None = None
    pull_mps: float = 0.0

    @property
    def effect(self) -> str:
        """The effect that it belongs to; empty for gains and time constants."""
        effect, dot, _ = self.name.partition(".")
        return effect if dot else ""


@dataclass(frozen=True, slots=True)
class Residual:
    """Residual of the model at one parameter vector.

    Attributes
    ----------
    speeds : shape (n, 2), m/s, simulated.
    wheels : shape (n, 2), whitened, in standard deviations; rows of weight zero are zero.
    pose : shape (m, 3), in standard deviations; zero where nothing was measured.
    plain : the wheels' loss is the plain square.
    """

    speeds: FloatArray
    wheels: FloatArray
    pose: FloatArray
    plain: bool = False

    def flat(self) -> FloatArray:
        """One vector; its squares are Huber's loss, or plain squares of the wheels' residuals."""
        wheels = self.wheels.ravel() if self.plain else _huber_root(self.wheels.ravel())
        return np.concatenate((wheels, _huber_root(self.pose.ravel())))


@dataclass(frozen=True)
class Problem:
    """Recordings, simulator and noise model.

    Attributes
    ----------
    counted : shape (n, 2), weights 0..1 of the rows in a fit.
    pose_counted : shape (m,), weights of the pose windows.
    past : the rows that the noise model takes for each row.
    tied : both wheels share gain and time constant.
    base_effects : effects that the baseline already contains.
    direct_evidence : log-likelihood ratio of effects from two recorded signals, without a robot model, nats.
    is_plain : fits minimise the plain free-run error of the speeds (`plain`).
    """

    data: SetData
    simulator: SetSimulator
    noise: Noise
    pose_sigma: FloatArray
    counted: FloatArray
    pose_counted: FloatArray
    past: Past
    tied: bool = False
    base_effects: tuple[str, ...] = ()
    base_columns: tuple[Column, ...] = field(default=())
    direct_evidence: dict[str, float] = field(default_factory=dict)
    is_plain: bool = False

    def evidence(self, effects: tuple[str, ...]) -> float:
        """Direct evidence for these effects, summed, nats."""
        return sum(self.direct_evidence.get(name, 0.0) for name in effects)

    def masks(self, effects: tuple[str, ...]) -> np.ndarray:
        """The simulator's mask with the baseline's effects and these switched on."""
        return self.simulator.enabled((*self.base_effects, *effects))

    def residual(self, theta: FloatArray, effects: tuple[str, ...]) -> Residual:
        """Whitened residual of a simulation."""
        on = self.masks(effects)
        speeds = self.simulator.speeds(theta, on)
        whitened = self.whiten(self.data.speed_mps - speeds)
        return Residual(speeds, whitened, self.pose(theta, on), self.is_plain)

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Speeds (n, 2) or their derivatives (n, 2, p) in standard deviations of white noise."""
        return whiten(self.noise, columns, self.counted, self.past)

    def loss_slopes(self, flat: FloatArray) -> FloatArray:
        """Derivatives of a flat residual by its residuals: CLIP / |flat| where the loss is linear, else 1."""
        slopes = np.asarray(CLIP / np.maximum(np.abs(flat), CLIP))
        if self.is_plain:
            slopes[: 2 * len(self.data)] = 1.0
        return slopes

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
        """Changes of speeds (n, 2, k) and of the pose (m, 3, k) as columns of the flat residual."""
        width = speeds.shape[2]
        white = self.whiten(speeds).reshape(-1, width)
        scaled = pose / self.pose_sigma[:, None] * self.pose_counted[:, None, None]
        return np.concatenate((white, scaled.reshape(-1, width)))

    def jacobian(
        self, theta: FloatArray, effects: tuple[str, ...], columns: tuple[Column, ...]
    ) -> FloatArray:
        """Derivatives of the flat residual, shape (2n + 3m, p), without the robust weighting."""
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
        """The same problem with other row and window weights."""
        return replace(self, counted=counted, pose_counted=pose_counted)

    @cached_property
    def measured(self) -> FloatArray:
        """Weights (n, 2) of the counted rows in a free-run error: how many recorded rows each stands for."""
        return np.asarray(np.where(self.counted > 0.0, self.data.stands_for, 0.0))

    def free_run_rmse(self, speeds: FloatArray) -> float:
        """Root mean square over all recorded rows of measured minus simulated speeds (n, 2), m/s.

        The simulation is sampled as the recorder samples: a repeated row has the error of its measurement.
        """
        return weighted_rms(self.data.speed_mps - speeds, self.measured)

    def rms_by_wheel(self, speeds: FloatArray) -> FloatArray:
        """Root mean square of the counted rows by their weight in a fit, for each wheel, shape (2,), m/s."""
        square = self.counted * np.where(self.counted > 0.0, self.data.speed_mps - speeds, 0.0) ** 2
        return np.asarray(np.sqrt(square.sum(axis=0) / np.maximum(self.counted.sum(axis=0), 1.0)))

    @cached_property
    def floor(self) -> NoiseFloor:
        """The noise of these recordings, from the recordings alone."""
        return noise_floor(self.data)

    def exceeds_noise(self, speeds: FloatArray, times: float = 1.0) -> bool:
        """Whether simulated speeds (n, 2) leave more than so many times the floor, at either wheel."""
        return bool(np.any(self.rms_by_wheel(speeds) > times * self.floor.rms))

    def plain(self, rms_mps: float) -> Problem:
        """The same problem by plain least squares: fits minimise the free-run error itself.

        Parameters
        ----------
        rms_mps : scale of the wheels' residuals, beside those of a pose.
        """
        counted = self.measured / (self.measured[self.measured > 0.0].mean() if self.measured.any() else 1.0)
        return replace(self, noise=white_noise(self.past, max(rms_mps, 1e-9)), counted=counted, is_plain=True)

    def judging(self, speeds: FloatArray) -> Problem:
        """For models beside one with these speeds (n, 2): plain where it leaves more than noise.

        There no noise model is right; one that takes a model error for noise leaves parameters undetermined
        that the free-run error determines.
        """
        if self.data.commanded or not self.exceeds_noise(speeds):
            return self
        return self.plain(self.free_run_rmse(speeds))

    def for_thread(self) -> Problem:
        """The same problem with a simulator of its own (its scratch memory is not thread-safe)."""
        return replace(self, simulator=self.simulator.select(range(self.data.runs)))

    def with_noise(self, noise: Noise, pose_sigma: FloatArray | None = None) -> Problem:
        """The same problem with another noise model."""
        return replace(self, noise=noise, pose_sigma=self.pose_sigma if pose_sigma is None else pose_sigma)

    def columns_of(self, effects: tuple[str, ...]) -> tuple[Column, ...]:
        """Free parameters of the baseline and of these effects."""
        every = (*self.base_effects, *effects)
        return self.base_columns + tuple(
            column
            for name in effects
            for column in effect_columns(self.simulator, name, every, plain=self.is_plain)
        )

    def pulls(self, columns: tuple[Column, ...]) -> FloatArray:
        """Residual per change by 1 of each parameter that a plain fit pulls towards its start, shape (p,).

        It is that of a steady error of `pull_mps` in all rows of the wheel, or of both.
        """
        if not self.is_plain:
            return np.zeros(len(columns))
        steady = np.sqrt(self.counted.sum(axis=0)) / self.noise.sigma
        both = float(np.hypot(*steady))
        return np.array(
            [one.pull_mps * (both if one.wheel is None else float(steady[one.wheel])) for one in columns]
        )


def _huber_root(e: FloatArray) -> FloatArray:
    """Values whose squares are Huber's loss of the residuals `e`."""
    size = np.abs(e)
    return np.where(size > CLIP, np.sign(e) * np.sqrt(np.maximum(2.0 * CLIP * size - CLIP**2, 0.0)), e)


def weighted_rms(error: FloatArray, weight: FloatArray) -> float:
    """Root mean square of an error by weights of the same shape; 0 where none is positive."""
    total = float(weight.sum())
    return float(np.sqrt(np.sum(weight * np.where(weight > 0.0, error, 0.0) ** 2) / total)) if total else 0.0


def moves_pose(column: Column, commanded: bool) -> bool:
    """Whether a parameter changes the predicted pose, given the measured wheels."""
    return commanded or (column.effect != "" and CATALOGUE[column.effect].domain != "wheel")


def effect_columns(
    simulator: SetSimulator, name: str, every: tuple[str, ...], *, plain: bool = False
) -> tuple[Column, ...]:
    """Free parameters of one effect in a model with the effects `every`; `plain`: in a plain fit."""
    layout, data = simulator.layout, simulator.data
    return tuple(
        Column(
            f"{name}.{parameter.name}",
            (layout.index(f"{name}.{parameter.name}"),),
            float(layout.lower[layout.index(f"{name}.{parameter.name}")]),
            float(layout.upper[layout.index(f"{name}.{parameter.name}")]),
            parameter.off,
            None if parameter.wheel is None else SIDES.index(parameter.wheel),
            parameter.pull * data.top_mps,
        )
        for parameter in CATALOGUE[name].parameters
        if not (parameter.scan and parameter.nuisance)
        and (plain or not parameter.plain)
        and is_identifiable(parameter, data, every)
    )


def is_identifiable(parameter: Parameter, data: SetData, effects: tuple[str, ...]) -> bool:
    """Whether a parameter may leave its value without its effect, in a model with these effects."""
    if parameter.wheel is not None and SIDES.index(parameter.wheel) not in data.judged_sides:
        return False
    has_others = not parameter.beside or any(name in effects for name in parameter.beside)
    return has_others and (not parameter.needs_pose or data.has_pose)


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
            for column in effect_columns(simulator, effect, base_effects)
        ]
    return tuple(columns)


def past_rows(data: SetData) -> Past:
    """The past of every row that the noise model takes."""
    return past_of(data.starts, float(np.median(data.interval_s)))


def noise_of_residual(data: SetData, residual: FloatArray, counted: FloatArray, taus_s: FloatArray) -> Noise:
    """Noise model of a residual (n, 2), m/s; `taus_s` (2,) bounds its correlation time."""
    floor = np.full(2, max(MIN_NOISE_COUNTS * data.resolution_mps, MIN_NOISE_SHARE * data.top_mps))
    interval_s = float(np.median(data.interval_s))
    ceiling = MAX_NOISE_OF_FLOOR * noise_floor(data).rms
    return estimate_noise(
        residual, counted, past_rows(data), interval_s, MEMORY_TAUS * taus_s, floor, ceiling
    )


def robust_pose_sigma(problem: Problem, theta: FloatArray, effects: tuple[str, ...]) -> FloatArray:
    """Robust standard deviation of each pose residual, shape (3,), m, m, rad."""
    spread = np.ones(3)
    if not len(problem.pose_counted):
        return spread
    raw = problem.simulator.pose_residuals(theta, problem.masks(effects), problem.data.pose_horizon_s)
    for k in range(3):
        seen = raw[np.isfinite(raw[:, k]), k]
        if len(seen):
            spread[k] = max(1.4826 * float(np.median(np.abs(seen))), 0.3 * float(np.std(seen)), 1e-5)
    return spread
