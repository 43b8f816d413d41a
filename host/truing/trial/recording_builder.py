"""Makes a trial's recording set: sets strengths, drives plans, reads sensors, writes files and the answer."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from truing.arrays import BoolArray, FloatArray
from truing.errors import WeakEffectError
from truing.log.columns import LOG_COLUMNS
from truing.plan import Kind, Plan
from truing.progress import Progress
from truing.recording.run import GYRO_COLUMN, TRUTH_COLUMNS, Run
from truing.recording.writer import replace_file, write_run
from truing.trial.drives import (
    DrivenRun,
    DrivenSet,
    TrialDrive,
    board_robot,
    drive_set,
    host_robot,
    longest_drive_s,
)
from truing.trial.effects import ALL
from truing.trial.robot import Robot
from truing.trial.spec import FULL_STRENGTH, WEAK_STRENGTH, Trial, with_strengths
from truing.trial.strength import (
    FirstOrder,
    RowMotion,
    play,
    pose_strength,
    row_motion,
    wheel_strength,
)
from truing.trial.user_baseline import baseline_text

# What a trial keeps of a board's log.
_COLUMNS = tuple(name for name in LOG_COLUMNS if name not in ("segment", "faults"))

# Simulations that the search for a strength may take, and how near S must come, in its logarithm.
_MAX_STEPS, _SECANT_STEPS = 9, 3
_MIN_RAW = 1e-4
_NEAR = 0.2
# Time for what is driven after the plans: runs that a diagnosis asks for, and runs that judge.
_MORE_S = 140.0
# Rows a second of the board's log.
_RATE_HZ = 20


@dataclass(frozen=True)
class PreparedTrial:
    """A trial whose effects have their strengths, not yet driven.

    Attributes
    ----------
    robot : effects and all.
    raw : raw strength of each effect.
    strengths : S of each effect alone.
    noise_mps : RMS of noise and disturbance in the rows' speeds.
    """

    trial: Trial
    robot: Robot
    raw: tuple[float, ...]
    strengths: tuple[float, ...]
    noise_mps: float


def prepare_trial(trial: Trial) -> PreparedTrial:
    """Set the effects' strengths, by driving the robot without them and playing that back with them.

    Raises
    ------
    WeakEffectError : this robot cannot have the effect at that strength.
    """
    quiet = with_strengths(dataclasses.replace(trial, effects=()), ())
    rehearsal = drive_set(host_robot(quiet, trial.seed), trial.plans, quiet, trial.seed)
    noise = _noise_mps(rehearsal, row_motion(rehearsal, play(rehearsal, quiet, trial.seed), quiet), quiet)
    closed_loop = any(segment.kind is not Kind.EFFORT for plan in trial.plans for segment in plan.segments)
    first_order = FirstOrder(rehearsal)

    def measure(k: int, value: float) -> float:
        if not closed_loop:
            return strength_of(trial, k, value, rehearsal, first_order, noise)
        # The controller works against the effect: the efforts are not those of the robot without it.
        robot = alone(trial, k, value)
        driven = drive_set(host_robot(robot, trial.seed), trial.plans, robot, trial.seed)
        return strength_of(trial, k, value, driven, FirstOrder(driven), noise)

    found = [_find_strength(trial, k, functools.partial(measure, k)) for k in range(len(trial.effects))]
    raw = tuple(value for value, _ in found)
    return PreparedTrial(
        trial, with_strengths(trial, raw), raw, tuple(reached for _, reached in found), noise
    )


class RecordingBuilder:
    """A prepared trial on its robot: its plans are driven, and whatever is asked for later.

    Parameters
    ----------
    on_board : on the virtual board with the flashed image, or on the host robot.
    folder : where the recording set goes.
    """

    def __init__(self, prepared: PreparedTrial, folder: Path, *, on_board: bool) -> None:
        self.prepared = prepared
        self.folder = folder
        self._written = 0
        trial = prepared.trial
        make = board_robot if on_board else host_robot
        longest_s = longest_drive_s(trial.plans, more_s=_MORE_S)
        self._drive = TrialDrive(make(prepared.robot, trial.seed), prepared.robot, trial.seed, longest_s)

    def drive(self, plans: Sequence[Plan], progress: Progress | None = None) -> None:
        """Drive plans, one right after the other.

        Raises
        ------
        BoardFault : the board stopped.
        """
        for number, plan in enumerate(plans, 1):
            self._drive.drive(plan)
            if progress is not None:
                progress(number / len(plans))

    def write(self, folder: Path | None = None) -> None:
        """Write the runs that were driven since the last writing, and the baseline beside them."""
        driven = self._drive.so_far()
        folder = folder or self.folder
        motion = row_motion(driven, driven.samples, self.prepared.robot)
        for number in range(self._written, len(driven.runs)):
            run = driven.runs[number]
            made = with_sensors(run, motion, motion.run == number, self.prepared, number)
            write_run(made, folder / "runs" / f"{made.name}.csv")
        self._written = len(driven.runs)
        trial = self.prepared.trial
        text = baseline_text(trial.robot, trial.baseline_gain_mps, trial.baseline_time_constant_s, _RATE_HZ)
        replace_file(folder / "baseline.toml", text.encode())

    def write_truth(self, folder: Path) -> None:
        """Write what happened in the rows of all runs without noise, with the effects and without them.

        Under the very same efforts; what the disturbance did is in neither. Of `truth.npz`: `speed`,
        `recorded` (N, 2) m/s, `pose` (N, 3), and the same after `plain_`.
        """
        driven, prepared = self._drive.so_far(), self.prepared
        bare = with_strengths(dataclasses.replace(prepared.trial, effects=()), ())
        arrays: dict[str, FloatArray] = {}
        for prefix, robot in (("", prepared.robot), ("plain_", bare)):
            motion = row_motion(driven, play(driven, robot, prepared.trial.seed), robot)
            arrays |= {
                f"{prefix}speed": motion.speed_mps,
                f"{prefix}recorded": motion.recorded_mps,
                f"{prefix}pose": motion.pose,
            }
        folder.mkdir(parents=True, exist_ok=True)
        np.savez(folder / "truth.npz", allow_pickle=False, run=motion.run, **arrays)

    def close(self) -> None:
        """Put the robot away."""
        self._drive.close()


def alone(trial: Trial, k: int, value: float) -> Robot:
    """Return the robot with one of its effects only."""
    return with_strengths(dataclasses.replace(trial, effects=(trial.effects[k],)), (value,))


def strength_of(
    trial: Trial, k: int, value: float, driven: DrivenSet, first_order: FirstOrder, noise_mps: float
) -> float:
    """S of one effect at a raw strength, under the efforts of a driven set."""
    effect = ALL[trial.effects[k].name]
    robot = alone(trial, k, value)
    motion = row_motion(driven, play(driven, robot, trial.seed), robot)
    if effect.domain == "pose":
        return pose_strength(motion, driven, robot, trial.sensors.truth_mm, trial.sensors.truth_mrad)
    return wheel_strength(first_order, motion, noise_mps, tied=effect.tied)


def _noise_mps(driven: DrivenSet, motion: RowMotion, robot: Robot) -> float:
    """RMS of what the encoders report beyond the undisturbed motion."""
    seen = np.concatenate([_tick_speed(run, robot) for run in driven.runs])
    return float(np.sqrt(np.mean((seen - motion.speed_mps) ** 2)))


def _tick_speed(run: DrivenRun, robot: Robot) -> FloatArray:
    metres = 2.0 * np.pi * robot.radius_m / robot.counts_per_rev
    travel = np.column_stack([run.run.columns["ticks_left"], run.run.columns["ticks_right"]]) * metres
    dt = np.diff(run.run.t_s)[:, None]
    speed = np.zeros_like(travel)
    speed[1:] = np.diff(travel, axis=0) / np.maximum(dt, 1e-9)
    return speed


def _find_strength(trial: Trial, k: int, measure: Callable[[float], float]) -> tuple[float, float]:
    """Raw strength at which S is about what the trial wants, and S there.

    Secant steps in logarithms, until S is near what is wanted; it must lie in the class that was drawn.
    """
    effect = ALL[trial.effects[k].name]
    floor, ceiling = (WEAK_STRENGTH[0], FULL_STRENGTH[0]) if trial.weak else (FULL_STRENGTH[0], np.inf)
    wanted = min(max(trial.effects[k].strength, floor * 1.06), ceiling / 1.06)
    tried: list[tuple[float, float]] = []
    value, slope = effect.start, 1.0
    for step in range(_MAX_STEPS):
        reached = max(measure(value), 1e-6)
        tried.append((value, reached))
        if abs(np.log(reached / wanted)) < _NEAR and floor <= reached < ceiling:
            return value, reached
        if step and tried[-1][0] != tried[-2][0]:
            rise = np.log(tried[-1][1] / tried[-2][1]) / np.log(tried[-1][0] / tried[-2][0])
            slope = float(np.clip(rise, 0.4, 6.0))
        value = float(np.clip(value * (wanted / reached) ** (1.0 / slope), _MIN_RAW, effect.max_strength))
        low = max((v for v, s in tried if s < wanted), default=_MIN_RAW)
        high = min((v for v, s in tried if s >= wanted), default=effect.max_strength)
        if step >= _SECANT_STEPS or not low <= value <= high:
            # Grip and limits set in at once: halving finds what a secant passes by.
            value = float(np.sqrt(low * high)) if low < high else value
        if value == tried[-1][0]:
            break
    value, reached = min(tried, key=lambda pair: abs(float(np.log(pair[1] / wanted))))
    if not floor <= reached < ceiling:
        raise WeakEffectError(
            f"{effect.name}: S reaches {reached:.2f} on this robot, {wanted:.2f} was wanted",
            "take another seed",
        )
    return value, reached


def with_sensors(
    run: DrivenRun, motion: RowMotion, rows: BoolArray, prepared: PreparedTrial, number: int
) -> Run:
    """The run as its recorder has it: the log's columns, a filtered speed, an external pose, a gyro."""
    sensors = prepared.trial.sensors
    rng = np.random.default_rng([prepared.trial.seed, 0x73656E73, number])
    columns = {name: run.run.columns[name] for name in _COLUMNS if name in run.run.columns}
    order = list(_COLUMNS)
    pose = motion.pose[rows]
    if prepared.robot.filter_s > 0.0:
        for i, side in enumerate(("left", "right")):
            # The filter's noise is that of the counts, less what it averages away; the log's mm/s remain.
            columns[f"vel_{side}_mps"] = np.round(motion.recorded_mps[rows, i], 3)
    if sensors.truth_mm > 0.0:
        spread = (sensors.truth_mm * 1e-3, sensors.truth_mm * 1e-3, sensors.truth_mrad * 1e-3)
        seen = pose + rng.normal(0.0, spread, (len(run.run), 3))
        for k, name in enumerate(TRUTH_COLUMNS):
            columns[name] = np.round(seen[:, k], 5)
            order.append(name)
    if sensors.gyro_radps > 0.0:
        turn = np.diff(pose[:, 2], prepend=pose[0, 2])
        dt = np.diff(run.run.t_s, prepend=run.run.t_s[0] - 0.05)
        columns[GYRO_COLUMN] = np.round(
            turn / np.maximum(dt, 1e-9) + rng.normal(0.0, sensors.gyro_radps, len(run.run)), 5
        )
        order.append(GYRO_COLUMN)
    return dataclasses.replace(run.run, columns=columns, order=tuple(order), metadata=None)


def answer_of(made: PreparedTrial) -> dict[str, Any]:
    """What is sealed."""
    trial = made.trial
    return {
        "schema": 1,
        "seed": trial.seed,
        "family": trial.family,
        "weak": trial.weak,
        "effects": [
            {
                "name": concealed.name,
                "raw": value,
                "strength": strength,
                "outside": ALL[concealed.name].outside,
            }
            for concealed, value, strength in zip(trial.effects, made.raw, made.strengths, strict=True)
        ],
        "hidden": made.robot.build()[1].to_dict(),
        "changes": made.robot.changes,
        "robot": dataclasses.asdict(trial.robot),
        "driving": trial.driving,
        "sensors": dataclasses.asdict(trial.sensors),
        "disturbance": dataclasses.asdict(trial.disturbance),
        "noise_mps": made.noise_mps,
    }
