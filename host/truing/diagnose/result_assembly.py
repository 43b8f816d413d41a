"""Assembly of the result: effects with intervals, localisation of the mismatch, errors on runs left out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.diagnose.applicable import not_exercised, weakly_exercised
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.compare import differences
from truing.diagnose.data.recorder_report import recorded_signals
from truing.diagnose.data.set_data import SetData
from truing.diagnose.data.traces import RunTraces
from truing.diagnose.fit import Fit
from truing.diagnose.held_out import HeldOut, folds_of, held_out
from truing.diagnose.intervals import covariance, effect_parameters
from truing.diagnose.locate import wheel_spans
from truing.diagnose.oscillation import Oscillation, find_oscillation
from truing.diagnose.pose_windows import pose_folds, pose_noise, pose_rmse, pose_spans, pose_traces
from truing.diagnose.problem import Problem
from truing.diagnose.residual_tests import residual_structure
from truing.diagnose.result import (
    NAMING,
    Diagnosis,
    EffectParameter,
    Explanation,
    FitErrors,
    MismatchSpan,
    NamedEffect,
    RankedEffect,
    Scope,
    SignalNoise,
    Split,
    WheelNumbers,
)
from truing.diagnose.search import effect_set
from truing.diagnose.verdict import MIN_PREDICTED_SHARE, Reasoning, has_structure, share_explained
from truing.recording.run import WHEELS, RecordingSet

SIGNALS = ("vel_left_mps", "vel_right_mps")
# A signal whose mismatch is below this many times its noise is not listed.
MIN_MISMATCH = 0.15
# Share of an unexplained mismatch that the listed spans hold: less than of a fitted effect, since its shape
# is only estimated.
UNEXPLAINED_COVERED = 0.85
# The predictable part of a residual is taken for the mismatch where it holds this share of the energy;
# otherwise the residual smoothed over so many seconds.
MIN_PREDICTED_FOR_SHAPE, SMOOTHED_S = 0.25, 0.25
# Events are values beyond so many times a residual's usual size; share of the energy above which they are
# the mismatch.
EVENT_TIMES, EVENT_ENERGY_SHARE = 3.0, 0.5
# Upper limit of a confidence.
MAX_CONFIDENCE = 0.99


@dataclass(frozen=True, slots=True)
class _Evaluated:
    """A fit that the verdict holds possible, its residuals on runs left out, its covariance (p, p)."""

    fit: Fit
    held_out: HeldOut
    covariance: FloatArray


def assemble_result(recordings: RecordingSet, reasoning: Reasoning) -> Diagnosis:
    """Fill every field of the result but checks, next experiment and compensation."""
    problem, data = reasoning.problem, reasoning.problem.data
    folds = folds_of(data)
    windows = pose_folds(problem, folds)
    fitted_under = reasoning.fitted_under
    base = held_out(fitted_under, reasoning.base, folds, windows)
    explanations = [
        _Evaluated(
            done,
            base if done is reasoning.base else held_out(fitted_under, done, folds, windows),
            covariance(problem, done),
        )
        for done in _explanations(reasoning)
    ]
    first = explanations[0]
    shown = first.fit
    return Diagnosis(
        name=recordings.name,
        verdict=reasoning.verdict,
        runs=data.names,
        fit=_errors(reasoning, base, first),
        effects=_effects(reasoning, base, explanations),
        mismatch=_mismatch(reasoning),
        not_exercised=not_exercised(data),
        weakly_exercised=weakly_exercised(data),
        pose_fit=_pose_errors(reasoning, shown),
        confidence=reasoning.confidence,
        left_over_share=_left_over(reasoning),
        recorder={} if data.commanded else recorded_signals(recordings, data),
        baseline_effects={
            name: effect_parameters(problem, shown, name, first.covariance) for name in problem.base_effects
        },
        exact={
            name: problem.simulator.internal(name, shown.theta)
            for name in (*problem.base_effects, *shown.effects)
        },
        notes=_notes(reasoning, base, first),
        ranking=_ranking(reasoning),
        noise=_noise(problem),
        splits=_splits(problem, folds, base, first.held_out),
        numbers=_numbers(reasoning, first),
        explanations=tuple(
            Explanation(one.fit.effects, one.fit.theta, reasoning.confidence) for one in explanations
        ),
        traces=_traces(reasoning, shown),
    )


def _left_over(reasoning: Reasoning) -> float:
    """Share of the refitted baseline's error energy above the noise that the verdict leaves unexplained."""
    if reasoning.verdict == "partly_explained":
        return 1.0 - max(share_explained(reasoning.problem, reasoning.best, reasoning.base), 0.0)
    return 1.0 if reasoning.verdict == "unexplained" else 0.0


def _notes(reasoning: Reasoning, base: HeldOut, shown: _Evaluated) -> tuple[str, ...]:
    """Whose choice the effects are, what remains, and where errors do not fall on runs left out."""
    notes = []
    if reasoning.accepted:
        notes.append("the effects are those given with --accept, not the diagnosis's own choice")
    oscillation = find_oscillation(reasoning.problem, shown.fit)
    if oscillation is not None and reasoning.verdict in ("unexplained", "partly_explained"):
        notes.append(_oscillation_note(oscillation, reasoning.problem))
    weight = reasoning.problem.measured
    before, after = base.rmse(weight), shown.held_out.rmse(weight)
    if shown.fit.effects and after > before and not len(reasoning.problem.pose_counted):
        notes.append("on runs left out of the fit the named effects do not lower the error")
    return tuple(notes)


def _oscillation_note(oscillation: Oscillation, problem: Problem) -> str:
    which = ", both wheels together" if oscillation.together else ", one wheel against the other"
    which = which if problem.data.counted.any(axis=0).all() else ""
    remains = f"what remains oscillates at {oscillation.frequency_hz:.1f} Hz{which}"
    return f"{remains}: look for a part that swings or springs"


def _explanations(reasoning: Reasoning) -> list[Fit]:
    """Fits that the verdict holds possible, best first: the refitted baseline where no effect is named."""
    if reasoning.verdict in NAMING:
        return [reasoning.best, *reasoning.rivals]
    return [reasoning.base]


def _effects(
    reasoning: Reasoning, before: HeldOut, explanations: list[_Evaluated]
) -> tuple[NamedEffect, ...]:
    problem = reasoning.problem
    out: list[NamedEffect] = []
    fits = [one.fit for one in explanations]
    for number, (done, evaluated) in enumerate(zip(fits, explanations, strict=True)):
        others = [one for one in fits if one is not done]
        for name in sorted(done.effects, key=lambda name: -_weight(problem, done, name)):
            if any(listed.name == name for listed in out):
                continue
            without_it = {rival for one in others if name not in one.effects for rival in one.effects}
            alternatives = sorted(without_it - set(done.effects) or without_it)
            parameters = effect_parameters(problem, done, name, evaluated.covariance)
            scope, wheels = scope_of(name, parameters)
            pose = max(_differences_without(problem, done, name)[:2]) < MIN_MISMATCH and len(
                problem.pose_counted
            )
            after = evaluated.held_out
            errors = (
                (pose_rmse(problem, before.pose), pose_rmse(problem, after.pose))
                if pose
                else (before.rmse(problem.measured, wheels), after.rmse(problem.measured, wheels))
            )
            out.append(
                NamedEffect(
                    name,
                    scope,
                    parameters,
                    _confidence(reasoning, fits, name),
                    *errors,
                    indistinguishable_from=tuple(alternatives),
                    domain="pose" if pose else "wheel",
                    unit="m" if pose else "m/s",
                    explanation=number,
                )
            )
    return tuple(out)


def _confidence(reasoning: Reasoning, fits: list[Fit], name: str) -> float:
    """Confidence that an effect is present: that of the explanations that contain it."""
    others = fits[1:]
    share = (1.0 - reasoning.confidence) / max(len(others), 1)
    first = reasoning.confidence if name in fits[0].effects else 0.0
    return min(first + share * sum(name in one.effects for one in others), MAX_CONFIDENCE)


def _weight(problem: Problem, done: Fit, name: str) -> float:
    return max(_differences_without(problem, done, name))


def without(problem: Problem, done: Fit, name: str) -> Fit:
    """The same numbers with one effect switched off."""
    left = tuple(other for other in done.effects if other != name)
    return Fit(left, done.theta, done.columns, problem.residual(done.theta, left))


def _differences_without(problem: Problem, done: Fit, name: str) -> tuple[float, float, float]:
    return differences(problem, done, without(problem, done, name))


def scope_of(name: str, parameters: dict[str, EffectParameter]) -> tuple[Scope, tuple[int, ...]]:
    """Scope of an effect: a wheel whose parameters' intervals exclude "no effect", both, or the body."""
    effect = CATALOGUE[name]
    sides: set[str] = set()
    sided = False
    for parameter in effect.parameters:
        if parameter.wheel is None:
            continue
        sided = True
        for key, value in parameters.items():
            if parameter.wheel not in key:
                continue
            low, high = value.ci95
            if not low <= parameter.off <= high and abs(value.value - parameter.off) > 0.0:
                sides.add(parameter.wheel)
    if not sided:
        return "body", (0, 1)
    if sides == {"left"}:
        return "left", (0,)
    if sides == {"right"}:
        return "right", (1,)
    return "both", (0, 1)


def _errors(reasoning: Reasoning, base: HeldOut, shown: _Evaluated) -> FitErrors:
    problem = reasoning.problem
    if problem.data.commanded:
        return _pose_errors(reasoning, shown.fit) or FitErrors(0.0, 0.0, 0.0, 0.0, "m")

    given, refit, model = (
        problem.free_run_rmse(done.residual.speeds) for done in (reasoning.given, reasoning.base, shown.fit)
    )
    return FitErrors(
        given,
        refit,
        model,
        min(mean_of_judged(problem, problem.floor.rms), model),
        heldout_refit_rmse=base.rmse(problem.measured),
        heldout_model_rmse=shown.held_out.rmse(problem.measured),
    )


def mean_of_judged(problem: Problem, rms: FloatArray) -> float:
    """Root mean square of the noise of both wheels (2,), or of the one that was measured."""
    return float(np.sqrt(np.mean(rms[list(problem.data.judged_sides)] ** 2)))


def _pose_errors(reasoning: Reasoning, shown: Fit) -> FitErrors | None:
    problem = reasoning.problem
    if not len(problem.pose_counted):
        return None
    floor = pose_rmse(problem, np.ones_like(shown.residual.pose))
    given, refit, model = (
        pose_rmse(problem, done.residual.pose) for done in (reasoning.given, reasoning.base, shown)
    )
    return FitErrors(given, refit, model, floor, "m")


def _mismatch(reasoning: Reasoning) -> tuple[MismatchSpan, ...]:
    problem = reasoning.problem
    if reasoning.verdict in ("consistent", "parameters_only"):
        return ()
    spans: list[MismatchSpan] = []
    if reasoning.verdict in ("unexplained", "partly_explained"):
        done = reasoning.best if reasoning.verdict == "partly_explained" else reasoning.base
        if problem.data.commanded:
            return tuple(pose_spans(problem, done.residual.pose, MIN_MISMATCH))
        shape = unexplained_shape(problem, done)
        spans += wheel_spans(problem.data, shape, problem.noise.rms, MIN_MISMATCH, UNEXPLAINED_COVERED)
        return tuple(spans)
    for name in reasoning.best.effects:
        bare = without(problem, reasoning.best, name)
        shape = reasoning.best.residual.speeds - bare.residual.speeds
        if not problem.data.commanded:
            # Where a command is held against the pose, no wheel was measured.
            spans += wheel_spans(problem.data, shape, problem.noise.rms, MIN_MISMATCH)
        spans += pose_spans(problem, reasoning.best.residual.pose - bare.residual.pose, MIN_MISMATCH)
    return tuple(spans)


def unexplained_shape(problem: Problem, done: Fit) -> FloatArray:
    """Estimate of the unexplained part of a fit's residual, shape (n, 2), m/s.

    Its predictable part where that holds much of the energy; otherwise its moving mean, or the events that
    hold most of that mean: events at random times are not predictable. A wheel with neither is left out.
    """
    found = residual_structure(problem, done)
    residual = np.where(problem.counted > 0.0, problem.data.speed_mps - done.residual.speeds, 0.0)
    structured = has_structure(found) & (found.share > MIN_PREDICTED_SHARE)
    smooth = _moving_mean(problem.data, residual)
    outlying = _events(smooth)
    has_events = (outlying**2).sum(axis=0) > EVENT_ENERGY_SHARE * (smooth**2).sum(axis=0)
    shape = np.where(has_events, outlying, np.where(structured, smooth, 0.0))
    shape = np.where(structured & (found.share > MIN_PREDICTED_FOR_SHAPE), found.predicted, shape)
    return shape if shape.any() else smooth


def _events(values: FloatArray) -> FloatArray:
    """The outlying values, all others zero, shape (n, 2)."""
    usual = 1.4826 * np.median(np.abs(values), axis=0)
    return np.where(np.abs(values) > EVENT_TIMES * usual, values, 0.0)


def _moving_mean(data: SetData, values: FloatArray) -> FloatArray:
    """Mean over SMOOTHED_S around each row, within its segment; values of shape (n, 2)."""
    from scipy.ndimage import uniform_filter1d

    rows = max(1, round(SMOOTHED_S / float(np.median(data.interval_s))))
    parts = [
        uniform_filter1d(values[a:b], rows, axis=0, mode="nearest")
        for a, b in zip(data.starts[:-1], data.starts[1:], strict=True)
    ]
    return np.concatenate(parts)


def _best_on_unseen_runs(reasoning: Reasoning) -> dict[tuple[str, ...], float]:
    """Errors on runs left out of the most likely sets of effects, where something is unexplained."""
    if reasoning.verdict not in ("unexplained", "partly_explained"):
        return {}
    search = reasoning.search
    sizes = sorted({len(names) for names in search.fits} - {0})
    best = [one for size in sizes for one in search.ranked(size)[:1]]
    problem = reasoning.fitted_under
    folds = folds_of(problem.data)
    windows = pose_folds(problem, folds)
    return {
        effect_set(*one.effects): held_out(problem, one, folds, windows).rmse(problem.measured)
        for one in best
    }


def _ranking(reasoning: Reasoning) -> tuple[RankedEffect, ...]:
    search = reasoning.search
    base = search.fits[()]
    unseen = _best_on_unseen_runs(reasoning)
    fitted = [
        RankedEffect(
            done.effects,
            search.predicted_gains.get(tuple(sorted(done.effects)), math.nan),
            search.compare(done, base).gain,
            True,
            parameters=done.size - base.size,
            heldout_rmse=unseen.get(names, math.nan),
            note=f"changes a signal by {search.compare(done, base).times_noise:.2f} of the noise",
        )
        for names, done in search.fits.items()
        if names
    ]
    fitted.sort(key=lambda entry: -entry.improvement)
    rest = [
        RankedEffect(names, gain, math.nan, False, note="predicted gain too small")
        for names, gain in search.predicted_gains.items()
        if names not in search.fits and len(names) == 1
    ]
    return tuple(fitted) + tuple(sorted(rest, key=lambda entry: -entry.score))


def _noise(problem: Problem) -> tuple[SignalNoise, ...]:
    data = problem.data
    quantisation = data.resolution_mps / math.sqrt(6.0)
    out = []
    for wheel in range(2):
        rms = float(problem.noise.rms[wheel])
        out.append(
            SignalNoise(
                SIGNALS[wheel],
                quantisation,
                math.sqrt(max(rms**2 - quantisation**2, 0.0)),
                rms,
                float(problem.noise.memory_s[wheel]),
                "the residual that inputs and state do not predict out of sample",
            )
        )
    return (*out, *pose_noise(problem))


def _splits(problem: Problem, folds: IntArray, before: HeldOut, after: HeldOut) -> tuple[Split, ...]:
    data = problem.data
    floor = mean_of_judged(problem, problem.noise.rms)
    out = []
    for part in np.unique(folds):
        rows = folds == part
        weight = problem.measured * rows[:, None]
        judged = [data.names[run] for run in np.unique(data.run_of_row[rows])]
        fitted = [data.names[run] for run in np.unique(data.run_of_row[~rows])]
        out.append(Split(tuple(fitted), tuple(judged), before.rmse(weight), after.rmse(weight), floor))
    return tuple(out)


def _numbers(reasoning: Reasoning, shown: _Evaluated) -> tuple[WheelNumbers, ...]:
    layout = reasoning.problem.simulator.layout
    out = []
    kinds = (("gain", "gain_mps", "m/s"), ("tau", "time_constant_s", "s"))
    for wheel in WHEELS:
        for kind, name, unit in kinds:
            entry = layout.index(f"{kind}_{wheel}")
            half = 0.0
            for k, column in enumerate(shown.fit.columns):
                if entry in column.entries:
                    half = 1.96 * math.sqrt(max(float(shown.covariance[k, k]), 0.0))
            value = float(shown.fit.theta[entry])
            out.append(
                WheelNumbers(
                    wheel,
                    name,
                    unit,
                    float(reasoning.given.theta[entry]),
                    float(reasoning.base.theta[entry]),
                    EffectParameter(value, (value - half, value + half), unit),
                )
            )
    return tuple(out)


def _traces(reasoning: Reasoning, shown: Fit) -> tuple[RunTraces, ...]:
    problem, data = reasoning.problem, reasoning.problem.data
    out = []
    for run, name in enumerate(data.names):
        rows = data.rows_of(run)
        if not rows.any():
            continue
        out.append(
            RunTraces(
                name,
                data.t_s[rows],
                data.dt_s[rows],
                data.effort[rows],
                data.speed_mps[rows],
                reasoning.given.residual.speeds[rows],
                reasoning.base.residual.speeds[rows],
                shown.residual.speeds[rows],
                np.broadcast_to(problem.noise.rms, (int(rows.sum()), 2)).copy(),
                problem.counted[rows] > 0.0,
                None if data.angle_rad is None else data.angle_rad[rows],
                None if data.heading_rad is None else data.heading_rad[rows],
                float(data.elapsed_s[rows][0]),
                pose_traces(
                    problem,
                    run,
                    reasoning.given.residual.pose,
                    reasoning.base.residual.pose,
                    shown.residual.pose,
                ),
                problem.measured[rows],
            )
        )
    return tuple(out)
