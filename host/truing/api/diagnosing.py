"""`truing.diagnose`: what a simulation leaves out of recordings."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from truing.api.models import AnyModel
from truing.api.reading import Source, read
from truing.diagnose.diagnosis_input import Options, with_what_to_compare
from truing.diagnose.engine import diagnose as diagnose_recordings
from truing.diagnose.measured import parse_measured
from truing.diagnose.result import Diagnosis
from truing.diagnose.simulation.warm import compile_once
from truing.progress import Progress, ignore_progress
from truing.recording.run import Wheel

LOGGER = logging.getLogger("truing")


def diagnose(
    recordings: Source,
    baseline: AnyModel | None = None,
    *,
    wheel: Wheel | None = None,
    wheels_only: bool = False,
    commanded: bool = False,
    sim_runs: str | Path | None = None,
    accept: Sequence[str] = (),
    measured: Mapping[str, float] | None = None,
    learn: bool = False,
    floor_m: float | None = None,
    jobs: int | None = None,
    progress: Progress = ignore_progress,
) -> Diagnosis:
    """Say where a simulation differs from recordings, and which physics it leaves out.

    Parameters
    ----------
    recordings : what `read` returned, or what it takes.
    baseline : what the simulation knows, instead of the recordings' own: the path of a baseline.toml, a
        `Baseline`, a model, or what `identify` or `fit` returned. Without any, the first-order model that
        fits the runs best.
    wheel : judge this wheel alone.
    wheels_only : leave the pose from outside the robot and the yaw rate aside.
    commanded : compare the pose with what the efforts command, and judge no wheel.
    sim_runs : folder with another simulator's output: CSV files of the same names, rows and efforts.
    accept : effects that are taken for the model, whatever the verdict.
    measured : numbers of the robot that were measured by hand (`wheel_radius_m`, `wheelbase_m` in m,
        `counts_per_rev`); their errors are ruled out.
    learn : learn a correction for what the model leaves (`learned` of the result); some 10 s more.
    floor_m : how far a proposed run may go, m.
    jobs : threads; the default is one for each processor.
    progress : called with the share of the work done, 0 to 1.

    Returns
    -------
    Diagnosis
        `verdict`, `confidence`, `effects` with their parameters and 95 % intervals, `fit` with the errors
        (m/s), `next_experiment`, `to_json()`. `export` writes the corrected model.

    Raises
    ------
    TruingError
        The recordings allow no verdict; says why.

    Examples
    --------
    >>> import truing
    >>> result = truing.diagnose("docs/example")  # some seconds
    >>> result.verdict, [effect.name for effect in result.effects]
    ('missing_physics', ['stribeck_friction'])
    """
    known = parse_measured(f"{name}={value!r}" for name, value in (measured or {}).items())
    folder = None if sim_runs is None else Path(sim_runs)
    options = Options(folder, wheels_only, jobs, floor_m, commanded, wheel, tuple(accept), known, learn)
    found = with_what_to_compare(read(recordings, baseline), options, LOGGER.info)
    compile_once(LOGGER.info, wheels=len(found.wheels))
    return replace(diagnose_recordings(found, options, progress), recordings=found)
