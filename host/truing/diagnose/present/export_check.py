"""Checks an exported model on the runs of its diagnosis: its error as given must be the one that was claimed.

A baseline is read back and simulated as the next diagnosis would (every effect, the same rows). The formats
of other programs hold a wheel's physics and some of its terms: what they hold is simulated by `truing.model`,
which shares no code with the diagnosis, and what the rest costs is said. (The tests run the files themselves
and compare them with `truing.model`.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.data.encoder_faults import find_encoder_fault, one_wheel
from truing.diagnose.data.recorder import at_renewals, repeated_rows
from truing.diagnose.data.set_data import read_at_rows, set_data
from truing.diagnose.data.traces import RunTraces
from truing.diagnose.initial_speed import with_likely_starts
from truing.diagnose.inter_sample_input import with_inter_sample_input
from truing.diagnose.present.corrected_model import CorrectedModel
from truing.diagnose.problem import weighted_rms
from truing.diagnose.result import Diagnosis
from truing.diagnose.signal_selection import with_selected_signal
from truing.diagnose.simulation.simulator import SetSimulator
from truing.exporters import exporter
from truing.exporters.terms import left_out, without
from truing.model.excitation import excitation
from truing.model.robot_model import RobotModel
from truing.model.wheel import simulate_physics
from truing.recording.baseline import Baseline, parse_baseline
from truing.recording.run import GAP_FACTOR, WHEELS, RecordingSet, Wheel

# Largest relative difference of the error as given from the claimed one: the two are simulated from other
# steps, and the input between rows is found again. Absolute, m/s, for models that fit to nothing.
TOLERANCE, SMALLEST_MPS = 0.05, 1e-4
# How the line of an export begins whose error is another.
FAILED = "WARNING: "


def check_baseline(
    text: str, path: Path, recordings: RecordingSet, diagnosis: Diagnosis, wheel: Wheel | None = None
) -> list[str]:
    """What the exported baseline leaves on the same runs, in a line; none where the wheels were not judged.

    Parameters
    ----------
    text : of the file.
    wheel : the one that was diagnosed alone; None: both.
    """
    if not diagnosis.traces or diagnosis.fit.unit != "m/s":
        return []
    claimed = _claimed(diagnosis)
    found = error_as_given(parse_baseline(text, path), recordings, wheel, instant=_instant(diagnosis))
    return [_verdict("toml", found, claimed, ())]


def check_format(kind: str, corrected: CorrectedModel, diagnosis: Diagnosis) -> list[str]:
    """What a format's model leaves on the same runs, in a line, and what it is that the format leaves out."""
    if not diagnosis.traces or diagnosis.fit.unit != "m/s":
        return []
    if not exporter(kind).HOLDS and kind not in SIMULATED:
        return []
    model = held_model(kind, corrected.model)
    found = error_of_model(model, diagnosis.traces, instant=_instant(diagnosis))
    missing = [
        sentence.split(" is left out")[0] for sentence in left_out(corrected.model, exporter(kind).HOLDS)
    ]
    missing += [name for name in corrected.baseline.effects if name not in corrected.model.effects()]
    # A format may hold an effect, yet not the form of it that was found (gains by the effort's sign, say).
    missing = missing or [f"the exact form of {name}" for name in corrected.baseline.effects]
    return [_verdict(kind, found, _claimed(diagnosis), missing)]


# Formats that hold gain and time constant alone, and are a simulation nevertheless.
SIMULATED = ("simulink",)


def held_model(kind: str, model: RobotModel) -> RobotModel:
    """The model as the format holds it, seen through the recorder's filter, which is no part of the robot."""
    reduced = without(model, exporter(kind).HOLDS)
    left, right = (
        replace(reduced.wheel(wheel), recorder_lag_s=model.wheel(wheel).recorder_lag_s) for wheel in WHEELS
    )
    return replace(reduced, left=left, right=right)


def _instant(diagnosis: Diagnosis) -> bool:
    """Whether the diagnosis took the recorded speeds as read at the rows' times."""
    return any(signal.instant for signal in diagnosis.recorder.values())


def error_as_given(
    baseline: Baseline, recordings: RecordingSet, wheel: Wheel | None = None, *, instant: bool = False
) -> float:
    """Free-run error of a baseline on recordings as the diagnosis computes it, m/s.

    `instant`: the speeds were read at the rows' times, not averaged over them.
    """
    judged = replace(recordings, baseline=baseline)
    fault = find_encoder_fault(judged, baseline)
    wheel = wheel or (None if fault is None else fault.other)
    if wheel is not None:
        judged = one_wheel(judged, wheel)
    measured = at_renewals(judged)
    repeated = None if measured is judged else repeated_rows(judged, measured)
    data = with_inter_sample_input(with_selected_signal(set_data(measured, repeated=repeated)))
    data = read_at_rows(data) if instant else data
    simulator = SetSimulator(data, data.baseline)
    speeds = simulator.speeds(simulator.start(), simulator.enabled(()))
    taus = np.array([side.time_constant_s for side in (baseline.left, baseline.right)])
    likely = with_likely_starts(data, speeds, taus)
    if likely is not data:
        simulator = SetSimulator(likely, baseline)
        speeds = simulator.speeds(simulator.start(), simulator.enabled(()))
    return weighted_rms(data.speed_mps - speeds, np.where(data.counted, data.stands_for, 0.0))


def error_of_model(model: RobotModel, traces: Sequence[RunTraces], *, instant: bool = False) -> float:
    """Free-run error of both wheels' physics on diagnosed runs, m/s, from the speeds they start at.

    `instant`: the speeds were read at the rows' times, not averaged over them.
    """
    errors, weights = [], []
    for trace in traces:
        for column, wheel in enumerate(WHEELS):
            simulated = _simulated(model, wheel, trace, column, instant=instant)
            errors.append(trace.measured[:, column] - simulated)
            weight = trace.valid if trace.weight is None else trace.weight
            weights.append(weight[:, column].astype(float))
    return weighted_rms(np.concatenate(errors), np.concatenate(weights))


def _simulated(
    model: RobotModel, wheel: Wheel, trace: RunTraces, column: int, *, instant: bool
) -> FloatArray:
    """Speeds of one wheel in one run, shape (n,), m/s; behind a gap the simulation starts afresh."""
    t = trace.t_s
    interval = float(np.median(np.diff(t)))
    starts = np.array([0, *(np.flatnonzero(np.diff(t) > GAP_FACTOR * interval) + 1).tolist(), len(t)])
    pieces = [(a, b) for a, b in pairwise(starts.tolist()) if b > a]
    bounds = np.array([pieces[0][0], *(b for _, b in pieces)], dtype=np.int64)
    effort = np.ascontiguousarray(trace.effort[:, column])
    driven = excitation(t, effort, np.zeros(len(t)), bounds, np.full(len(pieces), interval))
    driven = replace(driven, mean_over_interval=not instant)
    initial = trace.model[bounds[:-1], column]
    return simulate_physics(model.wheel(wheel).to_vector(), driven, initial).speed_mps


def _claimed(diagnosis: Diagnosis) -> float:
    """The error that the diagnosis claims for what it exports, m/s: with effects where it names some."""
    fit = diagnosis.fit
    if diagnosis.verdict == "consistent":
        return fit.baseline_rmse
    return fit.model_rmse if diagnosis.effects else fit.refit_rmse


def _verdict(kind: str, found_mps: float, claimed_mps: float, missing: Sequence[str]) -> str:
    found, claimed = f"{1000.0 * found_mps:.3g}", f"{1000.0 * claimed_mps:.3g} mm/s"
    if abs(found_mps - claimed_mps) <= max(TOLERANCE * claimed_mps, SMALLEST_MPS):
        return f"checked: {kind}: {found} mm/s on the same runs, as claimed ({claimed})"
    what = f" without {', '.join(missing)}" if missing else ""
    return f"{FAILED}{kind}: {found} mm/s on the same runs{what}, where {claimed} are claimed"
