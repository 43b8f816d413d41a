"""The diagnosis from end to end: recordings and a baseline in, a verdict with its evidence out."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from truing.arrays import BoolArray
from truing.diagnose.accepted import with_accepted
from truing.diagnose.applicable import applicable_effects, beyond_an_axis
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.data.checks import check_data
from truing.diagnose.data.encoder_faults import find_encoder_fault, one_wheel, with_encoder_fault
from truing.diagnose.data.recorder import at_renewals, repeated_rows
from truing.diagnose.data.set_data import SetData, set_data
from truing.diagnose.data.sim_runs import read_sim_runs
from truing.diagnose.diagnosis_input import Options
from truing.diagnose.exchanges import best_exchange, extended_exchange, with_exchanges
from truing.diagnose.fit import Fit, fit
from truing.diagnose.initial_speed import with_likely_starts
from truing.diagnose.inter_sample_input import inter_sample_uncertainty, with_inter_sample_input
from truing.diagnose.learned.learner import learned_correction
from truing.diagnose.measured import ruled_out, with_measured
from truing.diagnose.next_experiment import propose
from truing.diagnose.noise import Noise, predicted_uncertainty, white_noise
from truing.diagnose.noise_updates import noise_from_fit
from truing.diagnose.one_wheel import of_one_wheel
from truing.diagnose.ordered_errors import with_ordered_errors
from truing.diagnose.present.compensation import compensate
from truing.diagnose.problem import (
    CLIP,
    Problem,
    base_columns,
    past_rows,
    robust_pose_sigma,
)
from truing.diagnose.profiles import Limits
from truing.diagnose.residual_tests import wheel_taus
from truing.diagnose.result import NAMING, Diagnosis
from truing.diagnose.result_assembly import assemble_result
from truing.diagnose.search import Search
from truing.diagnose.signal_selection import with_selected_signal
from truing.diagnose.simulation.simulator import SetSimulator
from truing.diagnose.simulator_baseline import equivalent_baseline, with_simulator_errors
from truing.diagnose.stepwise import extend_model, without_uncertain_effects
from truing.diagnose.verdict import Reasoning, decide, select_model
from truing.errors import IdentifyError
from truing.identify.row_sampling import with_row_sampling
from truing.progress import Progress, ignore_progress
from truing.recording.held_load import without_held_load
from truing.recording.run import RecordingSet

# Single effects, and second effects beside each of the best single ones, that are fitted at most.
MAX_SINGLES = 14
MAX_PAIRS = 6


def diagnose(
    recordings: RecordingSet, options: Options | None = None, progress: Progress = ignore_progress
) -> Diagnosis:
    """Diagnose recordings against their baseline.

    The recordings are checked, analysed, and the result is completed with the next experiment and
    compensating board parameters.

    Parameters
    ----------
    recordings : with a baseline; `diagnosis_input.read_input` reads them.
    progress : called with a share from 0 to 1.

    Raises
    ------
    TruingError
        The recordings allow no verdict; says why.
    """
    options = (options or Options()).suiting(recordings)
    if options.sim_runs is None:
        recordings = without_held_load(recordings)
    recordings = with_measured(recordings, options.measured)
    if options.wheels_only:
        recordings = recordings.without_pose()
    if options.sim_runs is None:
        return _diagnose(recordings, options, progress)
    check_data(recordings)
    simulated = read_sim_runs(options.sim_runs, recordings)
    assert simulated.baseline is not None
    found = analyse(simulated, lambda share: progress(0.5 * share), options.jobs)
    baseline, checks = equivalent_baseline(simulated.baseline, found)
    diagnosis = _diagnose(
        replace(recordings, baseline=baseline), options, lambda share: progress(0.5 + 0.5 * share)
    )
    return with_simulator_errors(diagnosis, recordings, simulated, checks)


def _diagnose(recordings: RecordingSet, options: Options, progress: Progress) -> Diagnosis:
    if recordings.baseline is None:
        raise IdentifyError(
            f"{recordings.path or recordings.name}: there is no baseline.toml beside it to compare with",
            "Give --model a baseline.toml: [wheel.left] and [wheel.right] with gain_mps and time_constant_s",
        )
    data_checks = check_data(recordings)
    fault = None if options.commanded else find_encoder_fault(recordings, recordings.baseline)
    wheel = options.wheel or (None if fault is None else fault.other)
    selected = recordings if wheel is None else one_wheel(recordings, wheel)
    diagnosis = analyse(
        selected,
        progress,
        options.jobs,
        commanded=options.commanded,
        accept=options.accept,
        excluded=ruled_out(options.measured) | (frozenset() if recordings.axis is None else beyond_an_axis()),
        learn=options.learn,
    )
    if fault is not None and options.wheel != fault.other:
        diagnosis = with_encoder_fault(diagnosis, fault)
    known = {(check.topic, check.run, check.wheel) for check in diagnosis.checks}
    more = tuple(check for check in data_checks.checks if (check.topic, check.run, check.wheel) not in known)
    named = {effect.name for effect in diagnosis.effects}
    diagnosis = replace(
        diagnosis,
        checks=(*diagnosis.checks, *more),
        not_exercised=tuple(sorted({*diagnosis.not_exercised, *data_checks.blocked} - named)),
        has_given=not recordings.baseline.is_fitted,
    )
    if len(diagnosis.explanations) > 1 and diagnosis.next_experiment is None:
        limits = None if options.floor_m is None else Limits(floor_m=options.floor_m)
        experiment = propose(diagnosis.explanations, at_renewals(recordings), diagnosis.noise, limits)
        diagnosis = replace(diagnosis, next_experiment=experiment)
    diagnosis = replace(diagnosis, compensation=compensate(diagnosis, recordings.baseline))
    return diagnosis if options.wheel is None else of_one_wheel(diagnosis, options.wheel)


def analyse(
    recordings: RecordingSet,
    progress: Progress = ignore_progress,
    jobs: int | None = None,
    *,
    commanded: bool = False,
    accept: Sequence[str] = (),
    excluded: frozenset[str] = frozenset(),
    learn: bool = False,
) -> Diagnosis:
    """Fits and verdict for recordings that have been checked, without what follows from the verdict.

    Parameters
    ----------
    jobs : threads; all cores where None.
    commanded : the pose is compared with the commands, and the wheels are not used.
    accept : effects that the user takes for the model.
    excluded : effects that a direct measurement rules out.
    learn : learn a correction for what the model leaves.
    """
    began = time.monotonic()
    measured = at_renewals(recordings)
    repeated = _repeated(recordings, measured)
    measured = measured if commanded else with_row_sampling(measured)
    data = set_data(measured, commanded=commanded, repeated=repeated)
    reasoning = investigate(data, progress, jobs or os.cpu_count() or 1, excluded)
    if accept:
        reasoning = with_accepted(reasoning, accept)
    progress(0.9)
    diagnosis = assemble_result(recordings, reasoning)
    if learn and not data.commanded:
        progress(0.92)
        named = reasoning.best.effects if diagnosis.verdict in NAMING else ()
        beside: tuple[Fit, ...] = (reasoning.best,) if named else (reasoning.base,)
        if diagnosis.verdict in ("partly_explained", "ambiguous"):
            beside = (reasoning.best, reasoning.base)
        diagnosis = replace(diagnosis, learned=learned_correction(reasoning.fitted_under, beside))
    progress(1.0)
    return replace(diagnosis, seconds=time.monotonic() - began)


def _repeated(recordings: RecordingSet, measured: RecordingSet) -> Sequence[BoolArray] | None:
    """Rows of the reduced runs at which only the other wheel was renewed."""
    return None if measured is recordings else repeated_rows(recordings, measured)


@dataclass(frozen=True)
class _Stage:
    """A noise model, and the baseline refitted under it."""

    problem: Problem
    base: Fit


def investigate(
    data: SetData, progress: Progress, jobs: int, excluded: frozenset[str] = frozenset()
) -> Reasoning:
    """All fits but of the excluded effects, and the verdict from them."""
    data = with_inter_sample_input(with_selected_signal(data))
    stage = initial_fit(data, SetSimulator(data, data.baseline, commanded=data.commanded))
    stage = _with_likely_starts(stage)
    names = [name for name in applicable_effects(stage.problem.data) if name not in excluded]
    progress(0.1)
    search = Search.from_baseline(stage.problem, stage.base, names, jobs)
    progress(0.2)
    search.extend(stage.base, MAX_SINGLES)
    progress(0.45)
    search = with_updated_noise(search, count=1)
    progress(0.55)
    for number, anchor in enumerate(search.ranked(1)[:2]):
        search.extend(anchor, MAX_PAIRS)
        progress(0.8 if number else 0.7)
    if search.ranked(2):
        search = with_updated_noise(search, count=2)
    single_fits = search
    search, best = extend_model(search, select_model(search, search.fits[()]))
    best = without_uncertain_effects(search, best)
    search = with_exchanges(search, best, single_fits)
    best = best_exchange(search, best)
    search, best = extended_exchange(search, best)
    progress(0.85)
    return with_ordered_errors(decide(search, best))


def initial_fit(data: SetData, simulator: SetSimulator) -> _Stage:
    """Refit the baseline; the noise is the part of its residual that is not predictable out of sample."""
    past = past_rows(data)
    windows = len(simulator.windows(data.pose_horizon_s))
    problem = Problem(
        data=data,
        simulator=simulator,
        noise=white_noise(past, _error_as_given(data, simulator)),
        pose_sigma=np.ones(3),
        counted=data.counted.astype(float),
        pose_counted=np.zeros(windows),
        past=past,
        tied=simulator.tied,
        base_effects=tuple(data.baseline.effects),
        base_columns=base_columns(simulator, simulator.tied, tuple(data.baseline.effects)),
        direct_evidence={name: effect.evidence(data) for name, effect in CATALOGUE.items()},
    )
    base = fit(problem, (), simulator.start(), iterations=25)
    problem = replace(problem, pose_counted=np.ones(windows))
    problem = replace(problem, pose_sigma=robust_pose_sigma(problem, base.theta, ()))
    noise = noise_from_fit(problem, base)
    uncertainty = inter_sample_uncertainty(data)
    if uncertainty.any():
        uncertainty = np.hypot(uncertainty, predicted_uncertainty(noise, uncertainty, past))
        problem = replace(problem, counted=problem.counted / (1.0 + (uncertainty / noise.sigma) ** 2))
        noise = noise_from_fit(problem, base)
    problem = problem.with_noise(noise)
    return _Stage(problem, fit(problem, (), base.theta, iterations=10))


def _with_likely_starts(stage: _Stage) -> _Stage:
    """The stage with the initial speeds that are most likely under its refitted baseline."""
    problem, base = stage.problem, stage.base
    data = with_likely_starts(problem.data, base.residual.speeds, wheel_taus(problem, base.theta))
    if data is problem.data or data.commanded:
        return stage
    return initial_fit(data, SetSimulator(data, data.baseline))


def _error_as_given(data: SetData, simulator: SetSimulator) -> float:
    """RMS error of the baseline as given, m/s: the scale of the first fit's robust loss."""
    error = (data.speed_mps - simulator.speeds(simulator.start(), simulator.enabled(())))[data.counted]
    return max(float(np.sqrt(np.mean(error**2))) if error.size else 0.0, 1e-3 * data.top_mps)


def with_updated_noise(search: Search, count: int) -> Search:
    """The search under the noise model of its best fit; only the best fits are kept and refined.

    Each fit is evaluated under the noise model of its own residual: a noise model that contains a slow
    model error would give little weight to the effects that remove it.
    """
    keep = [search.fits[()], *search.ranked(1)[:8], *(search.ranked(2)[:6] if count > 1 else [])]
    problem = search.problem
    noises = [noise_from_fit(problem, one) for one in keep]
    costs = [penalised_cost(problem, one, noise) for one, noise in zip(keep, noises, strict=True)]
    best = int(np.argmin(costs))
    pose_sigma = robust_pose_sigma(problem, keep[best].theta, keep[best].effects)
    return search.refitted_under(problem.with_noise(noises[best], pose_sigma), keep)


def penalised_cost(problem: Problem, one: Fit, noise: Noise) -> float:
    """Negative log-likelihood of a fit under its own noise model, penalised per parameter, nats."""
    rows = problem.counted.sum(axis=0)
    pose = 0.5 * float(np.sum(np.minimum(one.residual.pose**2, CLIP**2)))
    penalty = 0.5 * one.size * float(np.log(max(rows.sum(), 2.0)))
    return float(rows @ np.log(noise.sigma)) + pose + penalty - problem.evidence(one.effects)
