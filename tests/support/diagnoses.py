"""Diagnoses made up for tests of what is said and drawn about them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from support.recorded_sets import recordings
from truing.diagnose.data.traces import RunTraces
from truing.diagnose.result import (
    Check,
    Diagnosis,
    EffectParameter,
    FitErrors,
    MismatchSpan,
    NamedEffect,
    NextExperiment,
    RankedEffect,
    SignalNoise,
    Split,
    WheelNumbers,
)
from truing.plan import Kind, Plan, Segment

NOISE_MPS = 0.011


def friction(**changes: object) -> NamedEffect:
    effect = NamedEffect(
        "coulomb_friction",
        "both",
        {
            "left": EffectParameter(0.051, (0.049, 0.053), "effort"),
            "right": EffectParameter(0.047, (0.045, 0.049), "effort"),
        },
        0.98,
        0.043,
        0.012,
    )
    return replace(effect, **changes)


def deadband(**changes: object) -> NamedEffect:
    parameters = {"deadband": EffectParameter(0.05, (0.046, 0.054), "effort")}
    return replace(NamedEffect("driver_deadband", "body", parameters, 0.4, 0.043, 0.0125), **changes)


def plan() -> Plan:
    levels = ((0.8, 0.0), (1.0, 0.4), (1.0, 0.0), (1.0, -0.4), (0.8, 0.0))
    segments = tuple(Segment(Kind.EFFORT, seconds, u, u) for seconds, u in levels)
    return Plan("coast_down_40", "Steps and letting go, up to 40 % effort", segments, 20)


def numbers(verdict_value: float = 1.52) -> tuple[WheelNumbers, ...]:
    half = 0.004
    return (
        WheelNumbers(
            "left", "gain_mps", "m/s", 1.45, 1.50, EffectParameter(verdict_value, (1.516, 1.524), "m/s")
        ),
        WheelNumbers("left", "time_constant_s", "s", 0.35, 0.34, EffectParameter(0.35, (0.346, 0.354), "s")),
        WheelNumbers(
            "right", "gain_mps", "m/s", 1.45, 1.45, EffectParameter(1.45, (1.45 - half, 1.45 + half), "m/s")
        ),
        WheelNumbers("right", "time_constant_s", "s", 0.35, 0.34, EffectParameter(0.35, (0.346, 0.354), "s")),
    )


def traces(seed: int = 1, bump_mps: float = 0.08) -> tuple[RunTraces, ...]:
    """Recordings of a plain robot; the simulation misses a bump for one second of run 2, left wheel."""
    rng = np.random.default_rng(seed)
    out = []
    start = 0.0
    for run in recordings(4):
        t, shape = run.t_s, (len(run), 2)
        speeds = [run.speed(side, recordings(1).baseline).values for side in ("left", "right")]
        truth = np.stack(speeds, axis=1)
        measured = truth + NOISE_MPS * rng.standard_normal(shape)
        refit = truth.copy()
        if run.name.startswith("02"):
            refit[40:60, 0] -= bump_mps
        effort = np.stack([run.effort("left"), run.effort("right")], axis=1)
        valid = np.ones(shape, dtype=np.bool_)
        valid[0] = False
        angle = np.cumsum(truth, axis=0) * 0.05 / 0.0635
        heading = np.cumsum(truth[:, 1] - truth[:, 0]) * 0.05 / 0.283
        out.append(
            RunTraces(
                run.name,
                t,
                np.full(len(t), 0.05),
                effort,
                measured,
                0.95 * refit,
                refit,
                truth,
                np.full(shape, NOISE_MPS),
                valid,
                angle,
                heading,
                start,
            )
        )
        start += run.duration_s
    return tuple(out)


def missing_physics(**changes: object) -> Diagnosis:
    made = traces()
    names = tuple(trace.run for trace in made)
    noise = tuple(
        SignalNoise(signal, 0.004, 0.01, NOISE_MPS, 0.05, "repeated moments")
        for signal in ("vel_left_mps", "vel_right_mps")
    )
    diagnosis = Diagnosis(
        name="stingray",
        verdict="missing_physics",
        runs=names,
        fit=FitErrors(0.051, 0.043, 0.012, NOISE_MPS),
        effects=(friction(),),
        mismatch=(
            MismatchSpan(names[1], "vel_left_mps", 2.0, 2.6, 0.31, "near standstill, after a reversal", 6.2),
            MismatchSpan(names[2], "vel_left_mps", 4.0, 4.6, 0.21, "near standstill, after a reversal", 5.0),
            MismatchSpan(names[2], "vel_right_mps", 1.0, 2.0, 0.1, "at middle speed", 2.0),
        ),
        not_exercised=("current_limit",),
        confidence=0.98,
        notes=("supply sag and winding heating cannot be distinguished here",),
        checks=(Check("few_runs", "one run only", "warning", "Record at least four runs"),),
        ranking=(
            RankedEffect(("coulomb_friction",), 120.0, 96.0, True, 0.012, 2),
            RankedEffect(("driver_deadband",), 110.0, 60.0, True, 0.02, 1),
            RankedEffect(("quadratic_drag",), 3.0, float("nan"), False, note="promised too little"),
        ),
        noise=noise,
        splits=(
            Split(names[:2], names[2:], 0.043, 0.012, NOISE_MPS),
            Split(names[2:], names[:2], 0.041, 0.013),
        ),
        numbers=numbers(),
        seconds=7.2,
        traces=made,
    )
    return replace(diagnosis, **changes)


def ambiguous() -> Diagnosis:
    experiment = NextExperiment(
        plan(),
        (("coulomb_friction",), ("driver_deadband",)),
        7.5,
        "dry friction stops a wheel in finite time",
    )
    return missing_physics(
        verdict="ambiguous",
        effects=(
            friction(confidence=0.6, indistinguishable_from=("driver_deadband",)),
            deadband(indistinguishable_from=("coulomb_friction",), explanation=1),
        ),
        next_experiment=experiment,
        confidence=0.6,
    )


def parameters_only() -> Diagnosis:
    fit = FitErrors(0.051, 0.012, 0.012, NOISE_MPS)
    return missing_physics(verdict="parameters_only", effects=(), mismatch=(), ranking=(), notes=(), fit=fit)


def consistent() -> Diagnosis:
    return missing_physics(
        verdict="consistent", effects=(), mismatch=(), checks=(), notes=(), numbers=numbers(1.45), ranking=()
    )


def partly_explained() -> Diagnosis:
    return missing_physics(verdict="partly_explained", left_over_share=0.2)


def unexplained() -> Diagnosis:
    return missing_physics(verdict="unexplained", effects=())
