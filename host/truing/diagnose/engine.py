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
from truing.diagnose.between_rows import doubt_of_courses, with_courses
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.data import SetData, set_data
from truing.diagnose.fit import Fit, fit
from truing.diagnose.held_out import folds_of
from truing.diagnose.noise import Noise, foretold_doubt, white_noise
from truing.diagnose.problem import CLIP, Problem, base_columns, lagged_rows, noise_left, pose_spread
from truing.diagnose.recorder import with_judged_signal
from truing.diagnose.result import Diagnosis
from truing.diagnose.search import Search
from truing.diagnose.simulation.simulator import SetSimulator
from truing.diagnose.verdict import Reasoning, reason
from truing.diagnose.write_up import write_up
from truing.model.kernel import FloatArray
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
    data = with_courses(with_judged_signal(data))
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
    left, right = data.baseline.left, data.baseline.right
    windows = len(simulator.windows(data.pose_horizon_s))
    problem = Problem(
        data=data,
        simulator=simulator,
        noise=white_noise(lagged),
        pose_sigma=np.ones(3),
        counted=data.counted.astype(float),
        pose_counted=np.zeros(windows),
        lagged=lagged,
        tied=left == right,
        base_effects=tuple(data.baseline.effects),
        base_columns=base_columns(simulator, left == right, tuple(data.baseline.effects)),
        told={name: effect.evidence(data) for name, effect in CATALOGUE.items()},
    )
    base = fit(problem, (), simulator.start(), iterations=25)
    problem = replace(problem, pose_counted=np.ones(windows))
    problem = replace(problem, pose_sigma=pose_spread(problem, base.theta, ()))
    noise = noise_under(problem, base)
    doubt = doubt_of_courses(data)
    if doubt.any():
        doubt = np.hypot(doubt, foretold_doubt(noise, doubt, lagged))
        problem = replace(problem, counted=problem.counted / (1.0 + (doubt / noise.sigma) ** 2))
        noise = noise_under(problem, base)
    problem = problem.with_noise(noise)
    return _Stage(problem, fit(problem, (), base.theta, iterations=10))


def noise_under(problem: Problem, best: Fit) -> Noise:
    """The noise if `best` is right but for what a flexible model still foretells."""
    residual = problem.data.speed_mps - best.residual.speeds
    taus = np.minimum(_taus(problem, best.theta), _taus(problem, problem.simulator.start()))
    rough = noise_left(problem.data, residual, problem.counted, taus)
    found = structure_of(problem.with_noise(rough), best)
    return noise_left(problem.data, residual - found.foretold, problem.counted, taus)


def _taus(problem: Problem, theta: FloatArray) -> FloatArray:
    layout = problem.simulator.layout
    return np.array([theta[layout.index("tau_left")], theta[layout.index("tau_right")]])


def structure_of(problem: Problem, done: Fit) -> Structure:
    """What a flexible model foretells of a fit's residual."""
    taus = _taus(problem, done.theta)
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
    """The same search under the noise that its best fit leaves; only fits that may matter are kept.

    Which fit is best is asked of each under the noise that it leaves itself: judged under a noise that
    holds a slow error, everything that removes that error would seem to be worth little.
    """
    keep = [search.fits[()], *search.ranked(1)[:8], *(search.ranked(2)[:6] if count > 1 else [])]
    problem = search.problem
    noises = [noise_under(problem, one) for one in keep]
    costs = [own_cost(problem, one, noise) for one, noise in zip(keep, noises, strict=True)]
    best = int(np.argmin(costs))
    spread = pose_spread(problem, keep[best].theta, keep[best].effects)
    return search.under(problem.with_noise(noises[best], spread), keep)


def own_cost(problem: Problem, one: Fit, noise: Noise) -> float:
    """Negative log-likelihood of a fit under the noise that it leaves, each number paid for, nats."""
    rows = problem.counted.sum(axis=0)
    pose = 0.5 * float(np.sum(np.minimum(one.residual.pose**2, CLIP**2)))
    price = 0.5 * one.size * float(np.log(max(rows.sum(), 2.0)))
    return float(rows @ np.log(noise.sigma)) + pose + price - problem.evidence(one.effects)
