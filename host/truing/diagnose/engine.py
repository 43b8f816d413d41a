"""The diagnosis from end to end: recordings and a baseline in, a verdict with its evidence out."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from truing.diagnose.adequacy import Structure, find_structure
from truing.diagnose.applicable import applicable_effects
from truing.diagnose.data import SetData, set_data
from truing.diagnose.fit import Fit, fit
from truing.diagnose.held_out import folds_of
from truing.diagnose.noise import Noise, estimate_noise
from truing.diagnose.problem import Problem, base_columns, lagged_rows, pose_spread
from truing.diagnose.result import Diagnosis
from truing.diagnose.search import Search
from truing.diagnose.simulation.simulator import SetSimulator
from truing.diagnose.verdict import Reasoning, reason
from truing.diagnose.write_up import write_up
from truing.recording import RecordingSet
from truing.recording_reader import read_recording_set

Progress = Callable[[float], None]

MOST_SINGLES = 14
MOST_PAIRS = 6


def diagnose(
    set_path: str | Path,
    baseline_path: str | Path | None = None,
    *,
    progress: Progress | None = None,
    jobs: int | None = None,
) -> Diagnosis:
    """Diagnose a recording set against a baseline.

    Parameters
    ----------
    baseline_path : a baseline.toml; the set's own where None.
    progress : called with a share from 0 to 1.
    jobs : threads; all cores where None.

    Raises
    ------
    TruingError
        Files that cannot be read, or recordings that allow no verdict.
    """
    return diagnose_set(read_recording_set(set_path, baseline_path), progress=progress, jobs=jobs)


def _unheard(share: float) -> None:
    """Progress that nobody watches."""


def diagnose_set(
    recordings: RecordingSet,
    *,
    progress: Progress | None = None,
    jobs: int | None = None,
    commanded: bool = False,
) -> Diagnosis:
    """The same for recordings in memory, whose `baseline` is set.

    Parameters
    ----------
    commanded : the pose is held against what the efforts command, and the wheels are not judged.
    """
    began = time.monotonic()
    say = progress or _unheard
    data = set_data(recordings, commanded=commanded)
    reasoning = investigate(data, say, jobs or os.cpu_count() or 1)
    say(0.9)
    diagnosis = write_up(recordings, reasoning)
    say(1.0)
    return replace(diagnosis, seconds=time.monotonic() - began)


@dataclass(frozen=True)
class _Stage:
    """One idea of the noise, and the baseline refitted under it."""

    problem: Problem
    base: Fit


def investigate(data: SetData, say: Progress, jobs: int) -> Reasoning:
    """All fits, and what follows from them."""
    simulator = SetSimulator(data, data.baseline, commanded=data.commanded)
    names = applicable_effects(data)
    stage = first_look(data, simulator)
    say(0.1)
    search = Search.around(stage.problem, stage.base, names, jobs)
    say(0.2)
    search.beside(stage.base, MOST_SINGLES)
    say(0.45)
    search = sharpened(search, count=1)
    say(0.55)
    best = search.ranked(1)[:2]
    for anchor in best:
        search.beside(anchor, MOST_PAIRS)
        say(0.7 if anchor is best[0] else 0.8)
    if search.ranked(2):
        search = sharpened(search, count=2)
    return reason(search, names, structure_of)


def first_look(data: SetData, simulator: SetSimulator) -> _Stage:
    """Refit the baseline, and take for noise what even a flexible model does not foretell."""
    lagged = lagged_rows(data)
    counted = data.counted.astype(np.float64)
    white = Noise(np.zeros((2, lagged.shape[0])), np.ones(2), np.ones(2))
    left, right = data.baseline.left, data.baseline.right
    windows = len(simulator.windows(data.pose_horizon_s))
    problem = Problem(
        data=data,
        simulator=simulator,
        noise=white,
        pose_sigma=np.ones(3),
        counted=counted,
        pose_counted=np.zeros(windows),
        lagged=lagged,
        tied=left == right,
        base_effects=tuple(data.baseline.effects),
        base_columns=base_columns(simulator, left == right, tuple(data.baseline.effects)),
    )
    base = fit(problem, (), simulator.start(), iterations=25)
    problem = replace(problem, pose_counted=np.ones(windows))
    problem = replace(problem, pose_sigma=pose_spread(problem, base.theta, ()))
    noise = noise_under(problem, base)
    problem = problem.with_noise(noise)
    return _Stage(problem, fit(problem, (), base.theta, iterations=10))


def noise_under(problem: Problem, best: Fit) -> Noise:
    """The noise if `best` is right but for what a flexible model still foretells."""
    data = problem.data
    residual = data.speed_mps - best.residual.speeds
    floor = np.full(2, resolution_floor(data))
    rough = estimate_noise(residual, problem.counted, problem.lagged, floor)
    found = structure_of(problem.with_noise(rough), best)
    return estimate_noise(residual - found.foretold, problem.counted, problem.lagged, floor)


def structure_of(problem: Problem, done: Fit) -> Structure:
    """What a flexible model foretells of a fit's residual."""
    layout = problem.simulator.layout
    taus = np.array([done.theta[layout.index("tau_left")], done.theta[layout.index("tau_right")]])
    return find_structure(
        problem.data,
        problem.data.speed_mps - done.residual.speeds,
        done.residual.speeds,
        taus,
        problem.noise,
        problem.counted,
        problem.lagged,
        folds_of(problem.data),
    )


def sharpened(search: Search, count: int) -> Search:
    """The same search under the noise that its best fit leaves; only fits that may matter are kept."""
    ranked = search.ranked(count)
    keep = [search.fits[()], *search.ranked(1)[:8], *(search.ranked(2)[:6] if count > 1 else [])]
    best = search.ranked(count - 1)[0]
    if ranked and search.better(ranked[0], best).gain > 0.0:
        best = ranked[0]
    spread = pose_spread(search.problem, best.theta, best.effects)
    problem = search.problem.with_noise(noise_under(search.problem, best), spread)
    return search.under(problem, keep)


def resolution_floor(data: SetData) -> float:
    """RMS that rounding to whole counts gives a differenced speed, m/s: sqrt(1/6) of a count per row."""
    return max(0.4 * data.resolution_mps, 1e-5 * data.top_mps)
