"""Pose residuals against an outside reference: folds, errors in metres, localisation, traces."""

from __future__ import annotations

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.diagnose.data.traces import PoseTraces
from truing.diagnose.problem import Problem
from truing.diagnose.result import MismatchSpan, SignalNoise
from truing.recording.run import GYRO_COLUMN, TRUTH_COLUMNS

COMPONENTS = ("distance", "sideways", "heading")
# Spans hold this share of a component's mismatch.
COVERED = 0.9
# Half a usual wheelbase, m: turns a heading error into metres at the wheel where no wheelbase is known.
LEVER_M = 0.15


def pose_folds(problem: Problem, folds: IntArray) -> IntArray:
    """Fold of each window, shape (m,): that of its last row."""
    if not len(problem.pose_counted):
        return np.zeros(0, dtype=np.int64)
    return np.asarray(folds[problem.simulator.windows(problem.data.pose_horizon_s).last])


def pose_rmse(problem: Problem, pose: FloatArray) -> float:
    """RMS error of a window's end, m: of the place, and of the heading at half the wheelbase."""
    lever = 0.5 * (problem.data.baseline.wheelbase_m or 2.0 * LEVER_M)
    metres = pose * problem.pose_sigma * np.array([1.0, 1.0, lever])
    return float(np.sqrt(np.mean(np.sum(metres**2, axis=1)))) if len(metres) else 0.0


def pose_noise(problem: Problem) -> list[SignalNoise]:
    """Noise of displacements over a window: every component of a reference pose, or the turn of a gyro."""
    if not len(problem.pose_counted):
        return []
    source = "scatter of short pose windows about the best model"
    kinds = list(zip(TRUTH_COLUMNS, ("m", "m", "rad"), problem.pose_sigma.tolist(), strict=True))
    if not problem.data.has_truth:
        kinds = [(GYRO_COLUMN, "rad", float(problem.pose_sigma[2]))]
    return [SignalNoise(signal, 0.0, sigma, sigma, 0.0, source, unit) for signal, unit, sigma in kinds]


def pose_spans(problem: Problem, shape: FloatArray, min_times_noise: float) -> list[MismatchSpan]:
    """Windows that hold the energy of a pose mismatch.

    Parameters
    ----------
    shape : shape (m, 3), standard deviations, the mismatch without its noise.
    min_times_noise : a component whose mismatch is below this many times its noise is left out.
    """
    spans: list[MismatchSpan] = []
    if not len(shape):
        return spans
    data, windows = problem.data, problem.simulator.windows(problem.data.pose_horizon_s)
    total = float(np.sum(shape**2))
    for k, signal in enumerate(TRUTH_COLUMNS):
        energy = shape[:, k] ** 2
        if np.sqrt(energy.mean()) < min_times_noise:
            continue
        if k == 2 and not data.has_truth:
            signal = GYRO_COLUMN
        order = np.argsort(energy)[::-1]
        count = int(np.searchsorted(np.cumsum(energy[order]), COVERED * energy.sum())) + 1
        for window in sorted(order[:count]):
            first, last = int(windows.first[window]), int(windows.last[window])
            spans.append(
                MismatchSpan(
                    run=data.names[int(windows.run[window])],
                    signal=signal,
                    t_start_s=float(data.t_s[first]),
                    t_end_s=float(data.t_s[last]),
                    share=float(energy[window] / total),
                    regime=f"{COMPONENTS[k]} over {data.t_s[last] - data.t_s[first]:.1f} s",
                    times_noise=float(abs(shape[window, k])),
                )
            )
    return spans


def pose_traces(
    problem: Problem, run: int, given: FloatArray, refit: FloatArray, shown: FloatArray
) -> PoseTraces | None:
    """One run's windows for pictures; the three residuals are (m, 3) in standard deviations."""
    if not len(problem.pose_counted):
        return None
    data, windows = problem.data, problem.simulator.windows(problem.data.pose_horizon_s)
    here = windows.run == run
    sigma = problem.pose_sigma
    return PoseTraces(
        data.t_s[windows.first[here]],
        data.t_s[windows.last[here]],
        given[here] * sigma,
        refit[here] * sigma,
        shown[here] * sigma,
        sigma,
    )
