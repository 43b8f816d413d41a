"""From reasoning to the answer that a user gets: effects with intervals, places, errors on unseen runs."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import uniform_filter1d

from truing.diagnose.applicable import not_exercised, weakly_exercised
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.checks import DataChecks
from truing.diagnose.compare import differences
from truing.diagnose.data import SetData
from truing.diagnose.fit import Fit
from truing.diagnose.held_out import HeldOut, folds_of, held_out
from truing.diagnose.intervals import covariance, effect_parameters
from truing.diagnose.locate import wheel_spans
from truing.diagnose.pose_windows import pose_folds, pose_noise, pose_rmse, pose_spans, pose_traces
from truing.diagnose.problem import Problem
from truing.diagnose.result import (
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
from truing.diagnose.traces import RunTraces
from truing.diagnose.verdict import LEAST_FORETOLD, Reasoning, foretells
from truing.model.kernel import FloatArray, IntArray
from truing.recording import WHEELS, RecordingSet

SIGNALS = ("vel_left_mps", "vel_right_mps")
# A signal whose mismatch is below this many times its noise is no place.
LEAST_PLACE = 0.15
# Spans of what nothing explains hold less of it than those of a fitted effect: its tails are guessed.
LEFT_COVERED = 0.85
# What a flexible model foretells is the mismatch where that is this share of a residual's energy; where it is
# less, the residual smoothed over so many seconds.
MOSTLY_FORETOLD, SMOOTHED_S = 0.25, 0.25
# Events stand out of a residual by so many times its usual size, and hold this share of its energy.
EVENT_TIMES, EVENTFUL = 3.0, 0.5
# Nothing is surer than this.
MOST_SURE = 0.99


def write_up(recordings: RecordingSet, reasoning: Reasoning, checks: DataChecks | None = None) -> Diagnosis:
    """Fill every field of the answer but the next experiment and the board's compensation."""
    problem, data = reasoning.problem, reasoning.problem.data
    folds = folds_of(data)
    windows = pose_folds(problem, folds)
    explanations = _explanations(reasoning)
    shown = explanations[0]
    every = {id(done): done for done in (reasoning.base, *explanations)}
    unseen = {key: held_out(problem, done, folds, windows) for key, done in every.items()}
    spreads = {id(done): covariance(problem, done) for done in explanations}
    return Diagnosis(
        name=recordings.name,
        verdict=reasoning.verdict,
        runs=data.names,
        fit=_errors(reasoning, shown),
        effects=_effects(reasoning, unseen, spreads),
        mismatch=_places(reasoning),
        not_exercised=not_exercised(data),
        weakly_exercised=weakly_exercised(data),
        pose_fit=_pose_errors(reasoning, shown),
        confidence=reasoning.confidence,
        notes=reasoning.notes,
        checks=() if checks is None else checks.checks,
        ranking=_ranking(reasoning),
        noise=_noise(problem),
        splits=_splits(problem, folds, unseen[id(reasoning.base)], unseen[id(shown)]),
        numbers=_numbers(reasoning, shown, spreads[id(shown)]),
        explanations=tuple(
            Explanation(done.effects, done.theta, reasoning.confidence) for done in explanations
        ),
        traces=_traces(reasoning, shown),
    )


def _explanations(reasoning: Reasoning) -> list[Fit]:
    """What the answer stands by, the best first: the refitted baseline where no effect is named."""
    if reasoning.verdict in ("missing_physics", "ambiguous"):
        return [reasoning.best, *reasoning.rivals]
    return [reasoning.base]


def _effects(
    reasoning: Reasoning, held: dict[int, HeldOut], spreads: dict[int, FloatArray]
) -> tuple[NamedEffect, ...]:
    problem, before = reasoning.problem, held[id(reasoning.base)]
    out: list[NamedEffect] = []
    explanations = _explanations(reasoning)
    for number, done in enumerate(explanations):
        others = [one for one in explanations if one is not done]
        for name in sorted(done.effects, key=lambda name: -_weight(problem, done, name)):
            if any(known.name == name for known in out):
                continue
            without_it = {rival for one in others if name not in one.effects for rival in one.effects}
            alternatives = sorted(without_it - set(done.effects) or without_it)
            parameters = effect_parameters(problem, done, name, spreads[id(done)])
            scope, wheels = scope_of(name, parameters)
            pose = max(_differences_without(problem, done, name)[:2]) < LEAST_PLACE and len(
                problem.pose_counted
            )
            unseen = held[id(done)]
            errors = (
                (pose_rmse(problem, before.pose), pose_rmse(problem, unseen.pose))
                if pose
                else (before.rmse(problem.counted, wheels), unseen.rmse(problem.counted, wheels))
            )
            out.append(
                NamedEffect(
                    name,
                    scope,
                    parameters,
                    _confidence(reasoning, explanations, name),
                    *errors,
                    indistinguishable_from=tuple(alternatives),
                    domain="pose" if pose else "wheel",
                    unit="m" if pose else "m/s",
                    explanation=number,
                )
            )
    return tuple(out)


def _confidence(reasoning: Reasoning, explanations: list[Fit], name: str) -> float:
    """That an effect is there: the confidence of the explanations that have it."""
    others = explanations[1:]
    share = (1.0 - reasoning.confidence) / max(len(others), 1)
    first = reasoning.confidence if name in explanations[0].effects else 0.0
    return min(first + share * sum(name in one.effects for one in others), MOST_SURE)


def _weight(problem: Problem, done: Fit, name: str) -> float:
    return max(_differences_without(problem, done, name))


def without(problem: Problem, done: Fit, name: str) -> Fit:
    """The same numbers with one effect switched off."""
    left = tuple(other for other in done.effects if other != name)
    return Fit(left, done.theta, done.columns, problem.residual(done.theta, left))


def _differences_without(problem: Problem, done: Fit, name: str) -> tuple[float, float, float]:
    return differences(problem, done, without(problem, done, name))


def scope_of(name: str, parameters: dict[str, EffectParameter]) -> tuple[Scope, tuple[int, ...]]:
    """Whom an effect concerns: a wheel whose own numbers' intervals exclude nothing, both, or the body."""
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
            nothing = parameter.off
            if not low <= nothing <= high and abs(value.value - nothing) > 0.0:
                sides.add(parameter.wheel)
    if not sided:
        return "body", (0, 1)
    if sides == {"left"}:
        return "left", (0,)
    if sides == {"right"}:
        return "right", (1,)
    return "both", (0, 1)


def _errors(reasoning: Reasoning, shown: Fit) -> FitErrors:
    problem = reasoning.problem
    if problem.data.commanded:
        return _pose_errors(reasoning, shown) or FitErrors(0.0, 0.0, 0.0, 0.0, "m")

    def rmse(done: Fit) -> float:
        error = (problem.data.speed_mps - done.residual.speeds)[problem.counted > 0.0]
        return float(np.sqrt(np.mean(error**2))) if error.size else 0.0

    floor = float(np.sqrt(np.mean(problem.noise.rms**2)))
    return FitErrors(rmse(reasoning.given), rmse(reasoning.base), rmse(shown), floor)


def _pose_errors(reasoning: Reasoning, shown: Fit) -> FitErrors | None:
    problem = reasoning.problem
    if not len(problem.pose_counted):
        return None
    floor = pose_rmse(problem, np.ones_like(shown.residual.pose))
    given, refit, model = (
        pose_rmse(problem, done.residual.pose) for done in (reasoning.given, reasoning.base, shown)
    )
    return FitErrors(given, refit, model, floor, "m")


def _places(reasoning: Reasoning) -> tuple[MismatchSpan, ...]:
    problem = reasoning.problem
    if reasoning.verdict in ("consistent", "parameters_only"):
        return ()
    spans: list[MismatchSpan] = []
    if reasoning.verdict == "unexplained":
        shape = unexplained_shape(reasoning)
        spans += wheel_spans(problem.data, shape, problem.noise.rms, LEAST_PLACE, LEFT_COVERED)
        return tuple(spans)
    for name in reasoning.best.effects:
        bare = without(problem, reasoning.best, name)
        shape = reasoning.best.residual.speeds - bare.residual.speeds
        spans += wheel_spans(problem.data, shape, problem.noise.rms, LEAST_PLACE)
        spans += pose_spans(problem, reasoning.best.residual.pose - bare.residual.pose, LEAST_PLACE)
    return tuple(spans)


def unexplained_shape(reasoning: Reasoning) -> FloatArray:
    """What stands out of the baseline's residual, shape (n, 2), m/s.

    What a flexible model foretells where that is much of it; otherwise its own moving mean, or the events
    that hold most of that: what comes when it likes is foretold by nothing. A wheel with neither is left out.
    """
    from truing.diagnose.engine import structure_of

    problem, base = reasoning.problem, reasoning.base
    found = structure_of(problem, base)
    residual = np.where(problem.counted > 0.0, problem.data.speed_mps - base.residual.speeds, 0.0)
    known = foretells(found) & (found.share > LEAST_FORETOLD)
    smooth = _moving_mean(problem.data, residual)
    loud = _events(smooth)
    eventful = (loud**2).sum(axis=0) > EVENTFUL * (smooth**2).sum(axis=0)
    shape = np.where(eventful, loud, np.where(known, smooth, 0.0))
    shape = np.where(known & (found.share > MOSTLY_FORETOLD), found.foretold, shape)
    return shape if shape.any() else smooth


def _events(values: FloatArray) -> FloatArray:
    """The values without those that are no larger than most, shape (n, 2)."""
    usual = 1.4826 * np.median(np.abs(values), axis=0)
    return np.where(np.abs(values) > EVENT_TIMES * usual, values, 0.0)


def _moving_mean(data: SetData, values: FloatArray) -> FloatArray:
    """Mean over SMOOTHED_S around each row, within its segment; values of shape (n, 2)."""
    rows = max(1, round(SMOOTHED_S / float(np.median(data.interval_s))))
    parts = [
        uniform_filter1d(values[a:b], rows, axis=0, mode="nearest")
        for a, b in zip(data.starts[:-1], data.starts[1:], strict=True)
    ]
    return np.concatenate(parts)


def _ranking(reasoning: Reasoning) -> tuple[RankedEffect, ...]:
    search = reasoning.search
    base = search.fits[()]
    fitted = [
        RankedEffect(
            done.effects,
            search.promised.get(tuple(sorted(done.effects)), math.nan),
            search.better(done, base).gain,
            True,
            parameters=done.size - base.size,
            note=f"bends the speeds by {search.better(done, base).times_noise:.2f} of the noise",
        )
        for names, done in search.fits.items()
        if names
    ]
    fitted.sort(key=lambda entry: -entry.improvement)
    rest = [
        RankedEffect(names, gain, math.nan, False, note="the screen promised too little")
        for names, gain in search.promised.items()
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
                "what a flexible model of inputs and state does not foretell on runs it did not see",
            )
        )
    return (*out, *pose_noise(problem))


def _splits(problem: Problem, folds: IntArray, before: HeldOut, after: HeldOut) -> tuple[Split, ...]:
    data = problem.data
    floor = float(np.sqrt(np.mean(problem.noise.rms**2)))
    out = []
    for part in np.unique(folds):
        rows = folds == part
        counted = problem.counted * rows[:, None]
        judged = [data.names[run] for run in np.unique(data.run_of_row[rows])]
        fitted = [data.names[run] for run in np.unique(data.run_of_row[~rows])]
        out.append(Split(tuple(fitted), tuple(judged), before.rmse(counted), after.rmse(counted), floor))
    return tuple(out)


def _numbers(reasoning: Reasoning, shown: Fit, spread: FloatArray) -> tuple[WheelNumbers, ...]:
    layout = reasoning.problem.simulator.layout
    out = []
    kinds = (("gain", "gain_mps", "m/s"), ("tau", "time_constant_s", "s"))
    for wheel in WHEELS:
        for kind, name, unit in kinds:
            entry = layout.index(f"{kind}_{wheel}")
            half = 0.0
            for k, column in enumerate(shown.columns):
                if entry in column.entries:
                    half = 1.96 * math.sqrt(max(float(spread[k, k]), 0.0))
            value = float(shown.theta[entry])
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
            )
        )
    return tuple(out)
