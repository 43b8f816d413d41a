"""The models of Bakirci 2023: (39) and (40) as printed, and fits on XI and XV judged on runs they never saw.

The paper fits a model to test XI (effort in) and one to test XV (velocity in), and exercises both with the
input of test XVII, which is an effort. It finds that the first carries over and the second does not. A model
from commanded to measured velocity takes m/s; XVII's per cents are another unit, so that the finding says
nothing about the model. Here it is judged on XVI as well, whose input is a velocity, and on XVII both in the
paper's way and with the efforts turned into the speeds that they stand for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from truing.arrays import FloatArray
from truing.errors import IdentifyError
from truing.identify.arx import fit_arx_signal
from truing.identify.even import EvenStretch, even_signal
from truing.identify.grey_box import fit_wheel
from truing.identify.signals import wheel_signal
from truing.identify.state_space import START_ROWS, fit_state_space_signal
from truing.model.linear import ArxModel, StateSpaceModel
from truing.model.wheel import WheelPhysics, simulate_physics
from truing.progress import Progress
from truing.recording.baseline import Baseline
from truing.recording.run import WHEELS, RecordingSet, Run, Wheel
from truing.studies.bakirci_tests import PAPER_TESTS

Model: TypeAlias = ArxModel | StateSpaceModel | WheelPhysics

INTERVAL_S = 0.05
_A = np.array([[0.7592, 0.1390], [-0.4384, -0.0198]])
_B = np.array([0.00121, 0.01456])
# Per cent of effort in, mm/s out.
PRINTED_39 = StateSpaceModel(_A, _B, np.array([1457.0, -120.0]), np.array([0.0002655, 0.0000078]), INTERVAL_S)
# mm/s in, mm/s out; A and B are those of (39) to the last digit.
PRINTED_40 = StateSpaceModel(_A, _B, np.array([976.1, -125.7]), np.array([0.0002091, -0.0002883]), INTERVAL_S)
NEEDED = ("XI", "XV", "XVI", "XVII")
# Rows of a run from which a model's starting state is taken; they are not judged.
HEAD_ROWS = START_ROWS


def rise_time_s(model: StateSpaceModel) -> float:
    """Time to 63.2 % of a step, interpolated between samples, s."""
    count = 400
    response = model.simulate(np.concatenate(([0.0], np.ones(count))), np.zeros(model.order))
    gone = response / model.gain_mps
    k = int(np.flatnonzero(gone >= 1.0 - np.exp(-1.0))[0])
    share = (1.0 - np.exp(-1.0) - gone[k - 1]) / (gone[k] - gone[k - 1])
    return float((k - 1 + share) * model.interval_s)


@dataclass(frozen=True, slots=True)
class PrintedModel:
    """A printed model compared with the paper's tables for the run that it was fitted to.

    Attributes
    ----------
    gain, rise_s : of the model: at rest in the long run, and to 63.2 % of a step.
    table_gain, table_tau_s : means of the printed gains and time constants of that run.
    """

    equation: str
    run: str
    gain: float
    rise_s: float
    table_gain: float
    table_tau_s: float

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "equation": self.equation,
            "fitted_to": self.run,
            "dc_gain": self.gain,
            "rise_to_63_percent_s": self.rise_s,
            "table_gain_mean": self.table_gain,
            "table_tau_mean_s": self.table_tau_s,
        }


def printed_models() -> tuple[PrintedModel, PrintedModel]:
    """(39) and (40) against Table IV."""
    levels = {test.name: test.levels for test in PAPER_TESTS}
    return tuple(  # type: ignore[return-value]
        PrintedModel(
            equation,
            run,
            model.gain_mps,
            rise_time_s(model),
            float(np.mean([level.gain for level in levels[run]])),
            float(np.mean([level.tau_s for level in levels[run]])),
        )
        for equation, run, model in (("(39)", "XI", PRINTED_39), ("(40)", "XV", PRINTED_40))
    )


def printed_39_on_xvii() -> list[tuple[float, float]]:
    """Levels of XVII and by how much (39)'s gain misses the printed one there, relative."""
    levels = next(test.levels for test in PAPER_TESTS if test.name == "XVII")
    return [(level.input, PRINTED_39.gain_mps / level.gain - 1.0) for level in levels]


@dataclass(frozen=True, slots=True)
class Exercise:
    """A model on a run: free-run simulation, each wheel.

    Attributes
    ----------
    input : what the model was fed with.
    seen : whether the model was fitted to this very run.
    percent : error of each wheel, RMS in per cent of the 98th percentile of |speed| of the run.
    rms_mps : the same in m/s.
    curves : left and right: times, measured, simulated, shape (n,) each.
    """

    model: str
    fitted_to: str
    judged_on: str
    input: str
    seen: bool
    percent: tuple[float, float]
    rms_mps: tuple[float, float]
    curves: tuple[tuple[FloatArray, FloatArray, FloatArray], ...]

    @property
    def mean_percent(self) -> float:
        """Mean of both wheels."""
        return 0.5 * sum(self.percent)

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "model": self.model,
            "fitted_to": self.fitted_to,
            "judged_on": self.judged_on,
            "input": self.input,
            "seen": self.seen,
            "free_run_percent": dict(zip(WHEELS, self.percent, strict=True)),
            "free_run_rms_mps": dict(zip(WHEELS, self.rms_mps, strict=True)),
        }


@dataclass(frozen=True, slots=True)
class ModelStudy:
    """The printed models, and the fits of this set on runs they never saw."""

    printed: tuple[PrintedModel, PrintedModel]
    exercises: tuple[Exercise, ...]

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "printed": [model.to_json() for model in self.printed],
            "printed_39_on_xvii": [
                {"effort": effort, "gain_error": error} for effort, error in printed_39_on_xvii()
            ],
            "exercises": [exercise.to_json() for exercise in self.exercises],
        }


def fed_with(run: Run, values: Callable[[Wheel], FloatArray]) -> Run:
    """The run with other numbers in the place of the efforts, which is where models look for their input."""
    columns = dict(run.columns)
    for wheel in WHEELS:
        columns[f"effort_{wheel}"] = values(wheel)
    return replace(run, columns=columns)


def commanded(run: Run) -> Run:
    """The run with its commands (m/s) for input."""

    def command(wheel: Wheel) -> FloatArray:
        found = run.command(wheel)
        if found is None:
            raise IdentifyError(f"{run.name}: it has no commands, which a velocity model is fitted to")
        return found

    return fed_with(run, command)


def paper_runs(recordings: RecordingSet) -> dict[str, Run]:
    """Tests XI, XV, XVI and XVII of a set that `truing paper` has driven, by name."""
    found = {}
    for run in recordings:
        name = run.name.rsplit("_", 1)[-1]
        if name in NEEDED:
            found[name] = run
    missing = [name for name in NEEDED if name not in found]
    if missing:
        raise IdentifyError(
            f"{recordings.path or recordings.name}: it has no run of test {', '.join(missing)}",
            "drive the tests with `truing paper`",
        )
    return found


def study_models(recordings: RecordingSet, progress: Progress | None = None) -> ModelStudy:
    """Fit on XI and XV, judge on XVI and XVII."""
    runs = paper_runs(recordings)
    baseline = recordings.baseline
    effort = _fit_all(runs["XI"], baseline)
    if progress is not None:
        progress(0.5)
    # One number for each wheel turns an effort into the speed that it stands for.
    gains = {wheel: effort["ARX"][wheel].gain_mps for wheel in WHEELS}
    velocity = _fit_all(commanded(runs["XV"]), baseline)
    if progress is not None:
        progress(0.9)
    exercises = []
    for kind, models in effort.items():
        exercises.append(_exercise(kind, models, "XI", "XI", "effort", runs["XI"], baseline))
        exercises.append(_exercise(kind, models, "XI", "XVII", "effort", runs["XVII"], baseline))
        exercises.append(_exercise(kind, models, "XI", "XVI", "applied effort", runs["XVI"], baseline))
    # What the paper did: 25 % goes in as 25 mm/s.
    misread = fed_with(runs["XVII"], lambda wheel: 0.1 * runs["XVII"].effort(wheel))
    meant = fed_with(runs["XVII"], lambda wheel: gains[wheel] * runs["XVII"].effort(wheel))
    for kind, models in velocity.items():
        for judged, said, run in (
            ("XV", "velocity", commanded(runs["XV"])),
            ("XVI", "velocity", commanded(runs["XVI"])),
            ("XVII", "per cent as mm/s", misread),
            ("XVII", "effort × gain of XI", meant),
        ):
            exercises.append(_exercise(kind, models, "XV", judged, said, run, baseline))
    in_si = replace(PRINTED_39, c=0.1 * PRINTED_39.c)
    exercises.append(
        _exercise(
            "(39) as printed", dict.fromkeys(WHEELS, in_si), "paper", "XVII", "effort", runs["XVII"], baseline
        )
    )
    if progress is not None:
        progress(1.0)
    return ModelStudy(printed_models(), tuple(exercises))


def _fit_all(run: Run, baseline: Baseline | None) -> dict[str, dict[Wheel, Model]]:
    fits: dict[str, dict[Wheel, Model]] = {"ARX": {}, "state space": {}, "grey box": {}}
    for wheel in WHEELS:
        signal = wheel_signal([run], wheel, baseline)
        fits["ARX"][wheel] = fit_arx_signal(signal, wheel).model
        fits["state space"][wheel] = fit_state_space_signal(signal, wheel).model
        fits["grey box"][wheel] = fit_wheel([run], wheel, baseline=baseline, intervals=False).physics
    return fits


def _exercise(
    kind: str,
    models: Mapping[Wheel, Model],
    fitted_to: str,
    judged_on: str,
    said: str,
    run: Run,
    baseline: Baseline | None,
) -> Exercise:
    percents, errors, curves = [], [], []
    for wheel in WHEELS:
        times, measured, simulated = free_run(models[wheel], run, wheel, baseline)
        error = float(np.sqrt(np.mean((simulated - measured) ** 2)))
        errors.append(error)
        percents.append(100.0 * error / float(np.percentile(np.abs(run.speed(wheel, baseline).values), 98)))
        curves.append((times, measured, simulated))
    return Exercise(
        kind,
        fitted_to,
        judged_on,
        said,
        fitted_to == judged_on,
        (percents[0], percents[1]),
        (errors[0], errors[1]),
        tuple(curves),
    )


def free_run(
    model: Model, run: Run, wheel: Wheel, baseline: Baseline | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times, measured and simulated speed of the judged rows, shape (n,) each.

    The model sees the inputs, and the speeds of the first rows to know where it starts.
    """
    signal = wheel_signal([run], wheel, baseline)
    if isinstance(model, WheelPhysics):
        starts = signal.excitation.starts[:-1]
        speed = simulate_physics(model.to_vector(), signal.excitation, signal.speed_mps[starts]).speed_mps
        rows = slice(HEAD_ROWS, None)
        return signal.excitation.t_s[rows], signal.speed_mps[rows], speed[rows]
    even = even_signal(signal, 2 * HEAD_ROWS)
    if len(even.stretches) != 1:
        raise IdentifyError(f"{run.name}: it has gaps, and a discrete model is exercised on a whole run")
    stretch = even.stretches[0]
    times = signal.excitation.t_s[0] + even.interval_s * np.arange(len(stretch.speed))
    simulated = _simulate(model, stretch)
    return times[HEAD_ROWS:], stretch.speed[HEAD_ROWS:], simulated


def _simulate(model: ArxModel | StateSpaceModel, stretch: EvenStretch) -> FloatArray:
    if isinstance(model, StateSpaceModel):
        start = model.start(stretch.effort, stretch.speed, HEAD_ROWS)
        return model.simulate(stretch.effort, start)[HEAD_ROWS:]
    skip = HEAD_ROWS - model.history
    return model.simulate(stretch.effort[skip:], stretch.speed[skip:HEAD_ROWS])
