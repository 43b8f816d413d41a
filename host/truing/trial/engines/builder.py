"""Makes a trial's recording set in an engine: sets strengths, drives, records, and knows the answer."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import WeakEffectError
from truing.progress import Progress
from truing.recording.writer import replace_file, write_run
from truing.trial.engines.driving import PlanDriver
from truing.trial.engines.engine import Engine, Motion
from truing.trial.engines.spec import EngineTrial, trial_json
from truing.trial.engines.strength import (
    Closeness,
    added_mps,
    closeness,
    find_raw,
    noise_mps,
    pose_strength,
)
from truing.trial.user_baseline import baseline_text


class _Replay:
    """Efforts that were recorded."""

    def __init__(self, effort: FloatArray) -> None:
        self._effort = effort

    @property
    def ticks(self) -> int:
        """How many intervals there are."""
        return len(self._effort) - 1

    def efforts(self, tick: int, angles_rad: FloatArray) -> tuple[float, float]:  # noqa: ARG002
        """Efforts of the interval that begins at this tick."""
        left, right = self._effort[tick + 1]
        return float(left), float(right)


@dataclass(frozen=True)
class Prepared:
    """A trial whose effects have their strengths.

    Attributes
    ----------
    robot : the engine's, effects and all.
    raw, strengths : of each effect alone; S is 0 for what the baseline's form can follow.
    noise_mps : RMS of noise and disturbance in speeds over 50 ms.
    healthy : the robot without its effects beside the first-order model that fits it best.
    """

    engine: Engine[Any]
    trial: EngineTrial
    robot: Any
    raw: tuple[float, ...]
    strengths: tuple[float, ...]
    noise_mps: float
    healthy: Closeness


def prepare(engine: Engine[Any], trial: EngineTrial) -> Prepared:
    """Set the effects' strengths.

    Raises
    ------
    WeakEffectError : this robot cannot have an effect at its strength.
    """
    plain = engine.healthy(trial.nominal)
    disturbed = _drive(engine, trial, plain, disturbed=True)
    quiet = engine.simulate(plain, [_Replay(motion.effort) for motion in disturbed])
    noise = noise_mps(disturbed, quiet, trial.nominal)
    robot, raw, strengths = plain, [], []
    for number, name in enumerate(trial.names):
        value, reached = _strength(engine, trial, plain, number, noise)
        robot = engine.effects[name].apply(robot, value, trial.rng_of(number))
        raw.append(value)
        strengths.append(reached)
    if len(trial.names) > 1:
        _require_visible_together(engine, trial, raw, robot, noise)
    return Prepared(
        engine, trial, robot, tuple(raw), tuple(strengths), noise, closeness(quiet, trial.nominal)
    )


def _strength(
    engine: Engine[Any], trial: EngineTrial, plain: Any, number: int, noise: float
) -> tuple[float, float]:
    """Raw strength of one effect, and S of it alone."""
    effect, wanted = engine.effects[trial.names[number]], trial.wanted[number]
    if effect.kind == "form":
        return wanted, 0.0
    recorder = trial.recorder

    def measure(value: float) -> float:
        robot = effect.apply(plain, value, trial.rng_of(number))
        motions = _drive(engine, trial, robot, disturbed=False)
        if effect.domain == "pose":
            return pose_strength(motions, trial.nominal, recorder.truth_mm, recorder.truth_mrad)
        return closeness(motions, trial.nominal).rms_mps / noise

    inside = min(max(wanted, trial.limits[0] * 1.1), trial.limits[1] / 1.1)
    return find_raw(effect.name, measure, inside, trial.limits, effect.start)


def _require_visible_together(
    engine: Engine[Any], trial: EngineTrial, raw: Sequence[float], both: Any, noise: float
) -> None:
    """Refuse a pair of which one effect hides the other: a slow actuator leaves low grip nothing to slip.

    Raises
    ------
    WeakEffectError : what one adds to the other is less than the noise.
    """
    together = _drive(engine, trial, both, disturbed=False)
    efforts = [_Replay(motion.effort) for motion in together]
    for number, name in enumerate(trial.names):
        other = 1 - number
        effect = engine.effects[trial.names[other]]
        robot = effect.apply(engine.healthy(trial.nominal), raw[other], trial.rng_of(other))
        without = engine.simulate(robot, efforts)
        recorder = trial.recorder
        if engine.effects[name].domain == "pose":
            added = pose_strength(
                together, trial.nominal, recorder.truth_mm, recorder.truth_mrad, beside=without
            )
        else:
            added = added_mps(together, without, trial.nominal) / noise
        if added < trial.limits[0]:
            raise WeakEffectError(
                f"{name}: beside {trial.names[other]} it adds {added:.2f} of the noise", "take another seed"
            )


def _drive(engine: Engine[Any], trial: EngineTrial, robot: Any, *, disturbed: bool) -> list[Motion]:
    drivers = [PlanDriver(plan, trial.nominal) for plan in trial.plans]
    torques = [trial.torques_nm(run, driver.ticks) for run, driver in enumerate(drivers)]
    return engine.simulate(robot, drivers, torques if disturbed else None)


def write_set(prepared: Prepared, folder: Path, progress: Progress | None = None) -> None:
    """Drive the trial and write its recordings and the user's baseline."""
    trial = prepared.trial
    motions = _drive(prepared.engine, trial, prepared.robot, disturbed=True)
    for number, (motion, plan) in enumerate(zip(motions, trial.plans, strict=True)):
        rng = np.random.default_rng([trial.seed, 0x73656E, number])
        run = trial.recorder.run(motion, PlanDriver(plan, trial.nominal), trial.nominal, rng)
        write_run(run, folder / "runs" / f"{run.name}.csv")
        if progress is not None:
            progress((number + 1) / len(motions))
    gains, constants = trial.baseline_gain_mps, trial.baseline_time_constant_s
    text = baseline_text(trial.nominal, gains, constants, trial.recorder.rate_hz)
    replace_file(folder / "baseline.toml", text.encode())


def answer_of(prepared: Prepared) -> dict[str, Any]:
    """What is sealed. `effects` has what a verdict should name; `inside_form` what it should not."""
    trial, effects = prepared.trial, prepared.engine.effects
    listed = [
        {
            "name": effects[name].catalogue or name,
            "engine_name": name,
            "means": effects[name].means,
            "kind": effects[name].kind,
            "raw": raw,
            "strength": strength,
            "expected": dict(effects[name].expected(prepared.robot)),
            "within": effects[name].within,
        }
        for name, raw, strength in zip(trial.names, prepared.raw, prepared.strengths, strict=True)
    ]
    return {
        "schema": 1,
        "engine": f"{prepared.engine.name} {prepared.engine.version}",
        "family": trial.family,
        "weak": trial.weak,
        "driving": f"{trial.mode} {trial.recorder.rate_hz} Hz",
        "effects": [each for each in listed if each["kind"] != "form"],
        "inside_form": [each for each in listed if each["kind"] == "form"],
        "robot": dataclasses.asdict(prepared.robot),
        "noise_mps": prepared.noise_mps,
        "healthy": dataclasses.asdict(prepared.healthy),
        "trial": trial_json(trial),
    }
