"""Each real recording diagnosed, and what every step of physics does to the error on unseen runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truing.diagnose.data.encoder_faults import find_encoder_fault
from truing.diagnose.data.set_data import set_data
from truing.diagnose.diagnosis_input import Options
from truing.diagnose.effects.speed_filter import direct_lag
from truing.diagnose.engine import diagnose
from truing.diagnose.result import NAMING, Diagnosis
from truing.identify.grey_box import fit_wheel
from truing.progress import Progress
from truing.recording.run import WHEELS, RecordingSet, Wheel
from truing.studies.real.drivetrains import read_drivetrain
from truing.studies.real.emps import read_emps, travel_error_mm
from truing.studies.real.mom import LineEnd, constants_runs, line_ends
from truing.studies.real.mrclam import read_mrclam
from truing.studies.real.plain_fit import Drop, PlainJudge

FRICTION, DELAY, FILTER = "coulomb_friction", "input_delay", "speed_filter"
# What is tried by plain least squares on every drivetrain, each beside what stands before the plus.
STEPS: tuple[tuple[str, ...], ...] = (
    (FRICTION,),
    (FRICTION, DELAY),
    (FRICTION, FILTER),
    (FRICTION, FILTER, DELAY),
)
EMPS_STEPS: tuple[tuple[str, ...], ...] = ((FRICTION,), (FRICTION, "direction_asymmetry"))
# The identification's own ladder step, whose error on left-out runs stands beside ours.
REFERENCE = "delay"


@dataclass(frozen=True, slots=True)
class Step:
    """The last of some effects, beside the others: what it does to the error on unseen runs."""

    effects: tuple[str, ...]
    drop: Drop

    @property
    def effect(self) -> str:
        """The one that is added."""
        return self.effects[-1]


@dataclass(frozen=True, slots=True)
class WheelStudy:
    """One wheel of a set.

    Attributes
    ----------
    scale : 98th percentile of |speed|, m/s, what per cents refer to.
    base : error of the refitted baseline on unseen runs.
    named : what the verdict names for this wheel, and what that does; None where it names nothing.
    steps : effects one after the other, whatever the verdict.
    reference : the identification's error on left-out runs (friction and delay), m/s; None without one.
    """

    wheel: Wheel
    scale: float
    base: float
    named: Step | None
    steps: tuple[Step, ...]
    reference: float | None


@dataclass(frozen=True, slots=True)
class SetStudy:
    """One set.

    Attributes
    ----------
    name : short, as the table says it.
    diagnosis : of the whole set.
    alone : of the wheel that can be judged, where the other's encoder is at fault.
    recorder_lag_s : the recorder's lag as its own positions show it; None where it logs none.
    """

    name: str
    diagnosis: Diagnosis
    alone: Diagnosis | None
    wheels: tuple[WheelStudy, ...]
    recorder_lag_s: float | None

    @property
    def deciding(self) -> Diagnosis:
        """The diagnosis that names effects."""
        return self.diagnosis if self.alone is None else self.alone


@dataclass(frozen=True, slots=True)
class EmpsStudy:
    """The positioning axis.

    Attributes
    ----------
    steps : on quarters of the first file that were left out.
    travel_mm : error of one open loop over (first file, second file), by what was named or tried.
    """

    diagnosis: Diagnosis
    wheel: WheelStudy
    travel_mm: dict[str, tuple[float, float]]


@dataclass(frozen=True, slots=True)
class CommandedStudy:
    """The commanded twist against the cameras; scales with 95 % intervals (jackknife over parts)."""

    diagnosis: Diagnosis
    delay: Step
    turning: Step
    forward_scale: tuple[float, float, float]
    yaw_scale: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class DriftStudy:
    """The MOM paper: drift found in runs made from its constants, and the line's real end."""

    diagnosis: Diagnosis
    ends: tuple[LineEnd, ...]


def study_drivetrain(folder: Path, say: Progress) -> SetStudy:
    """Diagnose one set under `real/` from its linear baseline, and judge each step of physics."""
    recordings = read_drivetrain(folder)
    assert recordings.baseline is not None
    diagnosis = diagnose(recordings, Options(), lambda share: say(0.4 * share))
    bad = find_encoder_fault(recordings, recordings.baseline)
    alone = None if bad is None else diagnose(recordings, Options(wheel=bad.other))
    say(0.5)
    judge = PlainJudge(set_data(recordings))
    wheels = []
    for wheel in WHEELS:
        trusted = bad is None or wheel != bad.wheel
        said = (diagnosis if alone is None else alone) if trusted else diagnosis
        wheels.append(_study_wheel(recordings, judge, wheel, said, STEPS))
        say(0.75 if wheel == "left" else 1.0)
    lag = direct_lag(judge.data)
    return SetStudy(
        short_name(folder.name), diagnosis, alone, tuple(wheels), None if lag is None else lag.time_constant_s
    )


def study_emps(recordings: Path, say: Progress) -> EmpsStudy:
    """Diagnose the axis on its first file, and simulate the second with what was found there."""
    first, second = read_emps(recordings)
    diagnosis = diagnose(first, Options(), lambda share: say(0.7 * share))
    judge = PlainJudge(set_data(first))
    wheel = _study_wheel(first, judge, "left", diagnosis, EMPS_STEPS, reference=False)
    say(0.9)
    travel = {}
    for effects in ((), *EMPS_STEPS):
        theta = judge.unseen(effects).theta
        travel[" + ".join(effects) or "baseline"] = _travels(first, second, effects, theta)
    if diagnosis.verdict in NAMING:
        found = diagnosis.explanations[0]
        travel["as diagnosed"] = _travels(first, second, found.effects, found.theta)
    say(1.0)
    return EmpsStudy(diagnosis, wheel, travel)


def study_mrclam(recordings: Path, say: Progress) -> CommandedStudy:
    """Diagnose the commanded twist, and say how much of it the robot does."""
    runs = read_mrclam(recordings)
    assert runs.baseline is not None
    diagnosis = diagnose(runs, Options(commanded=True), lambda share: say(0.5 * share))
    judge = PlainJudge(set_data(runs, commanded=True))
    late, turning = (DELAY,), (DELAY, "wheelbase_error")
    say(0.7)
    index = judge.simulator.layout.index
    done = judge.unseen(turning)
    gains = np.array([theta[index("gain_left")] for theta in (done.theta, *done.refits)])
    forward = gains / runs.baseline.left.gain_mps
    factors = np.array([theta[index("wheelbase_error.factor")] for theta in (done.theta, *done.refits)])
    say(1.0)
    everything = (0, 1, 2)
    return CommandedStudy(
        diagnosis,
        Step(late, judge.drop(judge.unseen(()), judge.unseen(late), everything)),
        Step(turning, judge.drop(judge.unseen(late), done, everything)),
        _jackknife(forward),
        _jackknife(forward / factors),
    )


def study_drift(say: Progress) -> DriftStudy:
    """Find the MOM paper's drift in runs made from its constants, and fit it to the printed real end."""
    diagnosis = diagnose(constants_runs(), Options(commanded=True), say)
    named = {effect.name: effect for effect in diagnosis.effects}
    found = {"drift": 0.0, "distance_scale": 0.0}
    if "heading_drift" in named:
        found = {name: item.value for name, item in named["heading_drift"].parameters.items()}
    return DriftStudy(diagnosis, line_ends(found))


def short_name(folder: str) -> str:
    """Team and file of a drivetrain's folder."""
    return folder.removeprefix("frc_").replace("__", " ").replace("_2020", "").replace("_2022", "")


def _study_wheel(
    recordings: RecordingSet,
    judge: PlainJudge,
    wheel: Wheel,
    diagnosis: Diagnosis,
    steps: Sequence[tuple[str, ...]],
    *,
    reference: bool = True,
) -> WheelStudy:
    columns = (WHEELS.index(wheel),)
    base = judge.unseen(())
    named = named_for(diagnosis, wheel)
    known = (
        fit_wheel(recordings.runs, wheel, REFERENCE, recordings.baseline, intervals=False)
        if reference
        else None
    )
    left_out = None if known is None or known.held_out is None else known.held_out.rms_mps
    return WheelStudy(
        wheel,
        float(np.percentile(np.abs(judge.data.speed_mps[:, columns[0]]), 98.0)),
        judge.rms(base.error, columns),
        Step(named, judge.drop(base, judge.unseen(named), columns)) if named else None,
        tuple(
            Step(effects, judge.drop(judge.unseen(effects[:-1]), judge.unseen(effects), columns))
            for effects in steps
        ),
        left_out,
    )


def named_for(diagnosis: Diagnosis, wheel: Wheel) -> tuple[str, ...]:
    """Effects of the likeliest explanation that concern a wheel, strongest first."""
    other = "left" if wheel == "right" else "right"
    return tuple(
        effect.name for effect in diagnosis.effects if effect.explanation == 0 and effect.scope != other
    )


def _travels(
    first: RecordingSet, second: RecordingSet, effects: tuple[str, ...], theta: np.ndarray
) -> tuple[float, float]:
    return travel_error_mm(first, effects, theta), travel_error_mm(second, effects, theta)


def _jackknife(values: np.ndarray) -> tuple[float, float, float]:
    """Value and 95 % interval from the value of everything and those that each left a part out."""
    parts = values[1:]
    spread = float(np.sqrt((len(parts) - 1) / len(parts) * np.sum((parts - parts.mean()) ** 2)))
    return float(values[0]), float(values[0]) - 1.96 * spread, float(values[0]) + 1.96 * spread
