"""What the scorer fits: the true structure to the recordings (the ceiling) and to noise-free output.

Everything here knows the answer. Fits are those of the diagnosis, so that the ceiling is what it could have
reached; which effects to fit comes from the opened seal, noise from the difference to the truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.diagnose.data.set_data import SetData, set_data
from truing.diagnose.engine import initial_fit
from truing.diagnose.fit import Fit, fit
from truing.diagnose.noise_updates import noise_from_fit
from truing.diagnose.problem import Problem
from truing.diagnose.search import Search
from truing.diagnose.signal_selection import with_recorder_speeds, with_selected_signal
from truing.diagnose.simulation.simulator import SetSimulator
from truing.recording.reader import read_recording_set
from truing.recording.run import GYRO_COLUMN, TRUTH_COLUMNS, WHEELS, RecordingSet, Run

# Noise levels beside which no misfit is large.
_PLAIN_LEVEL = 30.0
# Numbers that an effect counts over the whole set: with more runs in it they stand for more.
_OVER_SET = ("supply_sag.drop_over_set", "winding_heating.gain_drop")


@dataclass(frozen=True)
class Truth:
    """Noise-free motion in the rows of all runs, with the effects and, after `plain_`, without."""

    speed: FloatArray
    recorded: FloatArray
    pose: FloatArray
    plain_speed: FloatArray
    plain_recorded: FloatArray
    plain_pose: FloatArray
    run: IntArray


class TrueModel:
    """A trial's recordings, its judging runs and the truth about both.

    Parameters
    ----------
    folder : the recording set.
    judged : judging runs and truth.
    runs : so many of the set's runs were diagnosed; what was driven later judges.
    answer : the opened seal.
    """

    def __init__(self, folder: Path, judged: Path, runs: int, answer: dict[str, Any]) -> None:
        recorded = read_recording_set(folder)
        later = read_recording_set(judged)
        self.answer = answer
        with np.load(judged / "truth.npz") as arrays:
            self.truth = Truth(**{name: arrays[name] for name in arrays})
        every = replace(recorded, runs=(*recorded.runs, *later.runs))
        seen = replace(recorded, runs=recorded.runs[:runs])
        self.real = with_selected_signal(set_data(seen))
        self.all = SetSimulator(self._judged_alike(set_data(every)))
        self.clean = self._judged_alike(set_data(_clean(seen, self.truth)))
        self.judging: BoolArray = np.asarray(self.all.data.run_of_row >= len(recorded.runs))
        self._offset = np.concatenate(([0], np.cumsum([len(run) for run in every.runs])))
        self.simulator = SetSimulator(self.real)
        self.on_real = self._problem()
        self.on_clean = replace(self.on_real, data=self.clean, simulator=SetSimulator(self.clean))
        self.plain = self._plain(self.on_clean)
        self._bases: list[tuple[Problem, Fit]] = []

    def _judged_alike(self, data: SetData) -> SetData:
        """The set, its speeds those signals that the diagnosis judged."""
        return with_recorder_speeds(data) if self.real.source == "vel" else data

    @property
    def names(self) -> tuple[str, ...]:
        """What is concealed."""
        return tuple(str(each["name"]) for each in self.answer["effects"])

    @property
    def horizon_s(self) -> float:
        """Length of the windows over which a pose is judged, s."""
        return self.real.pose_horizon_s

    def truth_rows(self, data: SetData) -> IntArray:
        """Row of the truth for each row of a set's arrays."""
        rows: IntArray = self._offset[data.run_of_row] + data.source_row
        return rows

    def _problem(self) -> Problem:
        """The diagnosis' own problem, under the noise that the recordings really have."""
        stage = initial_fit(self.real, self.simulator)
        exact = replace(stage.base, residual=replace(stage.base.residual, speeds=self.clean.speed_mps))
        return stage.problem.with_noise(noise_from_fit(stage.problem, exact), self.pose_sigma())

    def _plain(self, problem: Problem) -> Problem:
        """A problem by plain least squares: no memory, and no residual so large that it is clipped."""
        noise = problem.noise
        level = np.full(2, _PLAIN_LEVEL * self.noise_mps)
        white = replace(noise, lags=np.zeros_like(noise.lags), sigma=level, rms=level)
        return problem.with_noise(white, _PLAIN_LEVEL * self.pose_sigma())

    @property
    def noise_mps(self) -> float:
        """RMS of noise and disturbance in the wheels' speeds."""
        rows = self.real.judged
        return float(np.sqrt(np.mean((self.real.speed_mps - self.clean.speed_mps)[rows] ** 2)))

    def pose_sigma(self) -> FloatArray:
        """Standard deviation of a window's displacement as measured, shape (3,), m, m, rad."""
        sensors = self.answer["sensors"]
        if sensors["truth_mm"] > 0.0:
            sigma = np.array([sensors["truth_mm"], sensors["truth_mm"], sensors["truth_mrad"]])
            return np.asarray(np.sqrt(2.0) * 1e-3 * sigma)
        # A gyro's noise is summed up over the rows of a window.
        interval_s = float(np.median(self.real.interval_s))
        turn = max(float(sensors["gyro_radps"]) * np.sqrt(interval_s * self.horizon_s), 1e-4)
        return np.array([1.0, 1.0, turn])

    def base(self, problem: Problem) -> Fit:
        """The baseline's numbers, refitted."""
        for known, found in self._bases:
            if known is problem:
                return found
        found = fit(problem, (), problem.simulator.start(), iterations=25)
        self._bases.append((problem, found))
        return found

    def effective(self, hints: Sequence[Fit]) -> Fit:
        """The numbers that the catalogue's equations take on noise-free output."""
        near = self.fitted(self.on_clean, self.names, hints)
        return fit(self.plain, near.effects, near.theta, iterations=30)

    def ceiling(self, ideal: Fit) -> Fit:
        """The true structure refitted to the recordings, by the error that it is judged by."""
        return fit(self._plain(self.on_real), ideal.effects, ideal.theta, iterations=30)

    def fitted(self, problem: Problem, names: Sequence[str], hints: Sequence[Fit] = ()) -> Fit:
        """A structure's best fit, from a search of its own and from the given ones."""
        best = self.base(problem)
        for name in names:
            search = Search.from_baseline(problem, best, [name], 1)
            found = search.extend(best, 1)
            if not found:
                break
            best = min(found, key=lambda one: one.cost)
        starts = [one.theta for one in hints if set(one.effects) == set(names)]
        if set(best.effects) != set(names):
            starts.append(best.theta)
        more = [fit(problem, tuple(names), theta, iterations=25) for theta in starts]
        whole = [one for one in (best, *more) if set(one.effects) == set(names)]
        return min(whole, key=lambda one: one.cost)

    def speeds(self, theta: FloatArray, effects: tuple[str, ...]) -> FloatArray:
        """Simulated speeds of all rows, judging runs and all, shape (n, 2)."""
        return self.all.speeds(*self._for_all(theta, effects))

    def speed_error(self, theta: FloatArray, effects: tuple[str, ...]) -> float:
        """RMS free-run error of the wheels on the judging runs, m/s."""
        rows = self.judging & self.all.data.judged
        error = self.all.data.speed_mps[rows] - self.speeds(theta, effects)[rows]
        return float(np.sqrt(np.mean(error**2)))

    def pose_error(self, theta: FloatArray, effects: tuple[str, ...]) -> float:
        """RMS error of the pose's windows on the judging runs, in standard deviations of its measurement."""
        windows = self.all.windows(self.horizon_s)
        if not len(windows):
            return float("nan")
        residual = self.all.pose_residuals(*self._for_all(theta, effects), self.horizon_s)
        first_judged = int(self.all.data.run_of_row[self.judging][0])
        error = (residual / self.pose_sigma())[windows.run >= first_judged]
        return float(np.sqrt(np.nanmean(error**2)))

    def _for_all(self, theta: FloatArray, effects: tuple[str, ...]) -> tuple[FloatArray, BoolArray]:
        """The same numbers for the simulator of all runs."""
        on = self.all.enabled((*self.real.baseline.effects, *effects))
        moved = theta * self.simulator.layout.scale / self.all.layout.scale
        names = [name for name in _OVER_SET if name.split(".")[0] in effects]
        for name in names:
            moved = self._over_set(theta, moved, effects, on, self.all.layout.index(name))
        return moved, on

    def _over_set(
        self, theta: FloatArray, moved: FloatArray, effects: tuple[str, ...], on: BoolArray, at: int
    ) -> FloatArray:
        """`moved` with the number at `at` such that the diagnosed runs come out as they did."""
        here = self.simulator.speeds(theta, self.simulator.enabled((*self.real.baseline.effects, *effects)))

        def with_factor(factor: float) -> FloatArray:
            changed = moved.copy()
            changed[at] *= factor
            return changed

        def apart(factor: float) -> float:
            seen = self.all.speeds(with_factor(factor), on)[: len(here)]
            return float(np.sum((seen - here) ** 2))

        from scipy.optimize import minimize_scalar

        best = minimize_scalar(apart, bounds=(0.8, 2.5), method="bounded", options={"xatol": 0.003})
        return with_factor(float(best.x))


def _clean(recordings: RecordingSet, truth: Truth) -> RecordingSet:
    """The same runs without noise: counts need not be whole, external poses are exact."""
    baseline = recordings.baseline
    assert baseline is not None
    scale = baseline.metres_per_count
    assert scale is not None
    runs = []
    for number, run in enumerate(recordings.runs):
        rows = truth.run == number
        runs.append(_clean_run(run, truth, rows, scale))
    return replace(recordings, runs=tuple(runs))


def _clean_run(run: Run, truth: Truth, rows: BoolArray, metres_per_count: float) -> Run:
    columns = dict(run.columns)
    dt = np.diff(run.t_s, prepend=run.t_s[0])[:, None]
    counts = np.cumsum(truth.speed[rows] * dt, axis=0) / metres_per_count
    pose = truth.pose[rows]
    for i, wheel in enumerate(WHEELS):
        columns[f"ticks_{wheel}"] = counts[:, i]
        columns[f"vel_{wheel}_mps"] = truth.recorded[rows, i]
    for k, name in enumerate(TRUTH_COLUMNS):
        if name in columns:
            columns[name] = pose[:, k]
    if GYRO_COLUMN in columns:
        turn = np.diff(pose[:, 2], prepend=pose[0, 2])
        columns[GYRO_COLUMN] = turn / np.maximum(np.diff(run.t_s, prepend=run.t_s[0] - 0.05), 1e-9)
    return replace(run, columns=columns)
