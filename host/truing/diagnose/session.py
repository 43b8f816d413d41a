"""One diagnosis as a user asks for it: read, check, compare, and say what follows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from truing.baseline import Baseline, WheelModel, read_baseline
from truing.diagnose.checks import check_data
from truing.diagnose.compensation import compensate
from truing.diagnose.next_experiment import propose
from truing.diagnose.profiles import Limits
from truing.diagnose.result import Check, Diagnosis
from truing.diagnose.sim_runs import read_sim_runs
from truing.diagnose.untrusted import one_wheel, untrusted_wheel, with_untrusted
from truing.errors import IdentifyError
from truing.importers import import_file, is_foreign
from truing.recording import WHEELS, FloatArray, RecordingSet, Run, Wheel
from truing.recording_reader import read_recording_set

Progress = Callable[[float], None]

_FROM_OUTSIDE = ("truth_x_m", "truth_y_m", "truth_theta_rad", "gyro_z_radps")


@dataclass(frozen=True, slots=True)
class Options:
    """How to diagnose.

    Attributes
    ----------
    sim_runs : folder with another simulator's output, instead of the baseline's own.
    wheels_only : leave pose and yaw rate aside.
    jobs : threads; None: one for each core.
    commanded : the wheels were not measured, or saw what is looked for: hold the pose against the commands.
    floor_m : floor that a proposed run may use, m; None: as much as the recorded runs used.
    wheel : judge this wheel alone.
    """

    sim_runs: Path | None = None
    wheels_only: bool = False
    jobs: int | None = None
    floor_m: float | None = None
    commanded: bool = False
    wheel: Wheel | None = None


def _unheard(share: float) -> None:
    """Progress that nobody watches."""


def read_for_diagnosis(path: Path, model: Path | None) -> RecordingSet:
    """A recording set, a folder of CSV files, one CSV file, or a foreign file, with its baseline."""
    if not is_foreign(path):
        return read_recording_set(path, model)
    imported = import_file(path)
    baseline = None if model is None else read_baseline(model)
    return RecordingSet(path.name.split(".")[0], imported.runs, baseline, path)


def diagnose_recordings(
    recordings: RecordingSet, options: Options | None = None, progress: Progress | None = None
) -> Diagnosis:
    """Check the recordings, diagnose them, and add what follows: board values and the next run.

    Raises
    ------
    TruingError : the recordings allow no verdict; says why.
    """
    options = options or Options()
    say = progress or _unheard
    if options.wheels_only:
        recordings = without_pose(recordings)
    if options.sim_runs is None:
        return _diagnose(recordings, options, say)
    check_data(recordings)
    simulated = read_sim_runs(options.sim_runs, recordings)
    stand_in, said = stand_in_for(simulated, options, lambda share: say(0.5 * share))
    real = replace(recordings, baseline=stand_in)
    diagnosis = _diagnose(real, options, lambda share: say(0.5 + 0.5 * share))
    return _with_simulated(diagnosis, recordings, simulated, said)


def without_pose(recordings: RecordingSet) -> RecordingSet:
    """The same runs without what is known from outside the wheels."""

    def stripped(run: Run) -> Run:
        columns = {name: values for name, values in run.columns.items() if name not in _FROM_OUTSIDE}
        return replace(run, columns=columns)

    return replace(recordings, runs=tuple(stripped(run) for run in recordings))


def stand_in_for(
    simulated: RecordingSet, options: Options, say: Progress
) -> tuple[Baseline, tuple[Check, ...]]:
    """The baseline that behaves as another simulator does: its output is diagnosed like a recording.

    What the simulator contains beyond the baseline comes out as effects, and joins the stand-in.
    """
    from truing.diagnose.engine import diagnose_set

    baseline = simulated.baseline
    assert baseline is not None
    found = diagnose_set(simulated, progress=say, jobs=options.jobs)
    values = {(entry.wheel, entry.name): entry.with_effects.value for entry in found.numbers}
    wheels = {}
    for wheel in WHEELS:
        given = baseline.left if wheel == "left" else baseline.right
        wheels[wheel] = WheelModel(
            values.get((wheel, "gain_mps"), given.gain_mps),
            values.get((wheel, "time_constant_s"), given.time_constant_s),
        )
    effects = dict(baseline.effects)
    if found.verdict == "missing_physics":
        for effect in found.effects:
            effects[effect.name] = {name: item.value for name, item in effect.parameters.items()}
    text = f"your simulator is matched to {found.fit.model_rmse:.3g} {found.fit.unit} by a stand-in"
    extra = sorted(set(effects) - set(baseline.effects))
    if extra:
        text += f" that contains {', '.join(extra)}"
    said = [Check("stand_in", text)]
    if found.verdict in ("ambiguous", "unexplained"):
        what = "what your simulator contains beyond the baseline is not in the catalogue, or not clear"
        step = "Give the numbers and effects of your simulator in the baseline"
        said.append(Check("stand_in", f"{what}; the verdict may blame the robot for it", "doubt", step))
    return replace(baseline, left=wheels["left"], right=wheels["right"], effects=effects), tuple(said)


def _diagnose(recordings: RecordingSet, options: Options, say: Progress) -> Diagnosis:
    from truing.diagnose.engine import diagnose_set

    if recordings.baseline is None:
        raise IdentifyError(
            f"{recordings.path or recordings.name}: there is no baseline.toml beside it to compare with",
            "Give --model a baseline.toml: [wheel.left] and [wheel.right] with gain_mps and time_constant_s",
        )
    checked = check_data(recordings)
    bad = None if options.commanded else untrusted_wheel(recordings, recordings.baseline)
    wheel = options.wheel or (None if bad is None else bad.other)
    judged = recordings if wheel is None else one_wheel(recordings, wheel)
    diagnosis = diagnose_set(judged, progress=say, jobs=options.jobs, commanded=options.commanded)
    if bad is not None and options.wheel != bad.other:
        diagnosis = with_untrusted(diagnosis, bad)
    known = {(check.topic, check.run, check.wheel) for check in diagnosis.checks}
    more = tuple(check for check in checked.checks if (check.topic, check.run, check.wheel) not in known)
    named = {effect.name for effect in diagnosis.effects}
    diagnosis = replace(
        diagnosis,
        checks=(*diagnosis.checks, *more),
        not_exercised=tuple(sorted({*diagnosis.not_exercised, *checked.blocked} - named)),
    )
    if diagnosis.verdict == "ambiguous" and diagnosis.next_experiment is None:
        limits = None if options.floor_m is None else Limits(floor_m=options.floor_m)
        found = propose(diagnosis.explanations, recordings, diagnosis.noise, limits)
        diagnosis = replace(diagnosis, next_experiment=found)
    return replace(diagnosis, compensation=compensate(diagnosis, recordings.baseline))


def _with_simulated(
    diagnosis: Diagnosis, recordings: RecordingSet, simulated: RecordingSet, said: tuple[Check, ...]
) -> Diagnosis:
    """The error as given is that of the simulator itself, not of its stand-in."""
    squares, count = 0.0, 0
    speeds: dict[str, FloatArray] = {}
    for real, made in zip(recordings, simulated, strict=True):
        pairs = [
            (real.speed(wheel, recordings.baseline).values, made.speed(wheel, recordings.baseline).values)
            for wheel in WHEELS
        ]
        speeds[real.name] = np.stack([pair[1] for pair in pairs], axis=1)
        squares += sum(float(((a - b)[1:] ** 2).sum()) for a, b in pairs)
        count += 2 * (len(real) - 1)
    traces = tuple(
        replace(trace, baseline=speeds[trace.run]) if len(trace.t_s) == len(speeds[trace.run]) else trace
        for trace in diagnosis.traces
    )
    fit = replace(diagnosis.fit, baseline_rmse=float(np.sqrt(squares / count)))
    return replace(diagnosis, fit=fit, checks=(*diagnosis.checks, *said), traces=traces)
