"""Makes a trial's recording set: sets strengths, drives plans, reads sensors, writes files and the answer."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from truing.errors import TruingError
from truing.recording import Run
from truing.recording_writer import replace_file, write_run
from truing.trial.drives import DrivenRun, DrivenSet, SimulatedRobot, board_robot, core_robot, drive_set
from truing.trial.effects import ALL
from truing.trial.robot import Robot
from truing.trial.spec import Trial, with_strengths
from truing.trial.strength import (
    FirstOrder,
    RowMotion,
    play,
    pose_strength,
    row_motion,
    wheel_strength,
)

FloatArray = npt.NDArray[np.float64]

_COLUMNS = (
    "t_s",
    "mode",
    "cmd_left",
    "cmd_right",
    "effort_left",
    "effort_right",
    "ticks_left",
    "ticks_right",
    "vel_left_mps",
    "vel_right_mps",
    "x_m",
    "y_m",
    "theta_rad",
    "battery_v",
)


class WeakEffectError(TruingError):
    """The effect cannot be made as strong on this robot as the trial wants it."""


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


@dataclass(frozen=True)
class MadeTrial:
    """A trial that has been driven."""

    prepared: PreparedTrial
    driven: DrivenSet


def prepare_trial(trial: Trial) -> PreparedTrial:
    """Set the effects' strengths, by driving the robot without them and playing that back with them.

    Raises
    ------
    WeakEffectError : this robot cannot have the effect at that strength.
    """
    quiet = with_strengths(dataclasses.replace(trial, effects=()), ())
    rehearsal = _driven(core_robot(quiet, trial.seed), trial, quiet, None)
    first_order = FirstOrder(rehearsal)
    noise = _noise_mps(rehearsal, row_motion(rehearsal, play(rehearsal, quiet), quiet), quiet)
    found = [_find_strength(trial, k, rehearsal, first_order, noise) for k in range(len(trial.effects))]
    raw = tuple(value for value, _ in found)
    return PreparedTrial(
        trial, with_strengths(trial, raw), raw, tuple(reached for _, reached in found), noise
    )


def drive_made(
    prepared: PreparedTrial, *, on_board: bool, progress: Callable[[float], None] | None = None
) -> MadeTrial:
    """Drive a prepared trial: on the virtual board with the flashed image, or on the core alone."""
    make = board_robot if on_board else core_robot
    simulated = make(prepared.robot, prepared.trial.seed)
    return MadeTrial(prepared, _driven(simulated, prepared.trial, prepared.robot, progress))


def _driven(
    simulated: SimulatedRobot, trial: Trial, robot: Robot, progress: Callable[[float], None] | None
) -> DrivenSet:
    try:
        driven = drive_set(simulated, trial.plans, robot, trial.seed, progress)
    finally:
        simulated.close()
    if driven.faults:
        raise TruingError(f"the board stopped: {', '.join(driven.faults)}")
    return driven


def alone(trial: Trial, k: int, value: float) -> Robot:
    """Return the robot with one of its effects only."""
    return with_strengths(dataclasses.replace(trial, effects=(trial.effects[k],)), (value,))


def strength_of(
    trial: Trial, k: int, value: float, driven: DrivenSet, first_order: FirstOrder, noise_mps: float
) -> float:
    """S of one effect at a raw strength, under the efforts of a driven set."""
    effect = ALL[trial.effects[k].name]
    robot = alone(trial, k, value)
    motion = row_motion(driven, play(driven, robot), robot)
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


def _find_strength(
    trial: Trial, k: int, driven: DrivenSet, first_order: FirstOrder, noise_mps: float
) -> tuple[float, float]:
    """Raw strength at which S is about what the trial wants, and S there: secant steps in logarithms."""
    effect = ALL[trial.effects[k].name]
    wanted = trial.effects[k].strength
    tried: list[tuple[float, float]] = []
    value = effect.start
    slope = 1.0
    for _ in range(6):
        reached = max(strength_of(trial, k, value, driven, first_order, noise_mps), 1e-6)
        tried.append((value, reached))
        if abs(np.log(reached / wanted)) < 0.15:
            break
        if len(tried) > 1 and tried[-1][0] != tried[-2][0]:
            step = np.log(tried[-1][1] / tried[-2][1]) / np.log(tried[-1][0] / tried[-2][0])
            slope = float(np.clip(step, 0.4, 6.0))
        value = float(np.clip(value * (wanted / reached) ** (1.0 / slope), 1e-4, effect.most))
        if value == tried[-1][0]:
            break
    value, reached = min(tried, key=lambda pair: abs(float(np.log(pair[1] / wanted))))
    floor, ceiling = (0.28, 1.0) if wanted < 1.0 else (1.0, np.inf)
    if not floor <= reached <= ceiling:
        raise WeakEffectError(
            f"{effect.name}: S reaches {reached:.2f} on this robot, {wanted:.2f} was wanted",
            "take another seed",
        )
    return value, reached


def write_set(made: MadeTrial, folder: Path) -> None:
    """Write the recording set that the diagnosis gets: runs and baseline, nothing else."""
    trial = made.prepared.trial
    rng = np.random.default_rng([trial.seed, 0x73656E73])
    motion = row_motion(made.driven, made.driven.samples, made.prepared.robot)
    at = 0
    for run in made.driven.runs:
        rows = slice(at, at + len(run.run))
        at += len(run.run)
        write_run(_with_sensors(run, motion, rows, made, rng), folder / "runs" / f"{run.run.name}.csv")
    replace_file(folder / "baseline.toml", baseline_text(trial).encode())


def _with_sensors(
    run: DrivenRun, motion: RowMotion, rows: slice, made: MadeTrial, rng: np.random.Generator
) -> Run:
    """The run as its recorder has it: the log's columns, a filtered speed, who looks from outside, a gyro."""
    sensors = made.prepared.trial.sensors
    columns = {name: run.run.columns[name] for name in _COLUMNS if name in run.run.columns}
    order = list(_COLUMNS)
    if made.prepared.robot.filter_s > 0.0:
        for i, side in enumerate(("left", "right")):
            # The filter's noise is that of the counts, less what it averages away; the log's mm/s remain.
            columns[f"vel_{side}_mps"] = np.round(motion.recorded_mps[rows, i], 3)
    if sensors.truth_mm > 0.0:
        spread = (sensors.truth_mm * 1e-3, sensors.truth_mm * 1e-3, sensors.truth_mrad * 1e-3)
        seen = motion.pose[rows] + rng.normal(0.0, spread, (len(run.run), 3))
        for k, name in enumerate(("truth_x_m", "truth_y_m", "truth_theta_rad")):
            columns[name] = np.round(seen[:, k], 5)
            order.append(name)
    if sensors.gyro_radps > 0.0:
        turn = np.diff(motion.pose[rows, 2], prepend=motion.pose[rows.start, 2])
        dt = np.diff(run.run.t_s, prepend=run.run.t_s[0] - 0.05)
        columns["gyro_z_radps"] = np.round(
            turn / np.maximum(dt, 1e-9) + rng.normal(0.0, sensors.gyro_radps, len(run.run)), 5
        )
        order.append("gyro_z_radps")
    return dataclasses.replace(run.run, columns=columns, order=tuple(order), metadata=None)


def baseline_text(trial: Trial) -> str:
    """The user's baseline.toml."""
    robot = trial.robot
    lines = [
        "[robot]",
        'name = "trial"',
        f"wheel_radius_m = {robot.radius_m:.6g}",
        f"wheelbase_m = {robot.wheelbase_m:.6g}",
        f"counts_per_rev = {robot.counts_per_rev}",
    ]
    for i, side in enumerate(("left", "right")):
        lines += [
            f"[wheel.{side}]",
            f"gain_mps = {trial.baseline_gain_mps[i]:.5g}",
            f"time_constant_s = {trial.baseline_time_constant_s[i]:.5g}",
        ]
    return "\n".join([*lines, "[log]", "rate_hz = 20", ""])


def answer_of(made: PreparedTrial) -> dict[str, Any]:
    """What the seal hides."""
    trial = made.trial
    return {
        "schema": 1,
        "seed": trial.seed,
        "family": trial.family,
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
        "shaking": dataclasses.asdict(trial.shaking),
        "noise_mps": made.noise_mps,
    }
