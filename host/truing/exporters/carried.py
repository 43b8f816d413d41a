"""What each format carries of a model: its error on recordings in the program that runs it."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from truing.errors import TruingError
from truing.model.robot_model import RobotModel
from truing.progress import Progress
from truing.recording.run import RecordingSet

from . import exporter
from .consumers import CONSUMERS, own, simulation
from .recorded import Task, error_mps, tasks
from .source import from_baseline
from .terms import DEFAULTS, ExportOptions, present, without


@dataclass(frozen=True, slots=True)
class Carried:
    """One format.

    Attributes
    ----------
    consumer : what runs it, or "" where nothing here does.
    given_mps : error of the baseline beside the recordings in the same format; None without one.
    after_mps : error of the model as the format holds it.
    terms : by term of the model: the error with this term left out, or None where the format cannot hold it.
    why_not : why nothing ran it.
    """

    kind: str
    consumer: str
    given_mps: float | None
    after_mps: float | None
    terms: dict[str, float | None]
    why_not: str = ""


@dataclass(frozen=True, slots=True)
class Check:
    """All formats; our own simulation of the model on the same recordings, m/s; what is not simulated."""

    own_mps: float
    formats: tuple[Carried, ...]
    left_out: tuple[str, ...] = ()


def check(
    model: RobotModel,
    recordings: RecordingSet,
    kinds: Sequence[str] = tuple(CONSUMERS),
    options: ExportOptions = DEFAULTS,
    progress: Progress | None = None,
) -> Check:
    """Simulate recordings in the programs that the formats are for.

    Parameters
    ----------
    kinds : formats; those that nothing runs are in the result without numbers.
    """
    all_tasks = tasks(recordings)
    given = None if recordings.baseline is None else from_baseline(recordings.baseline)[0]
    found = []
    for number, kind in enumerate(kinds, start=1):
        found.append(_format(kind, model, given, all_tasks, options))
        if progress is not None:
            progress(number / len(kinds))
    left_out = tuple(task.left_out for task in all_tasks if task.left_out)
    return Check(error_mps(all_tasks, own(model), model), tuple(found), left_out)


def _format(
    kind: str, model: RobotModel, given: RobotModel | None, all_tasks: Sequence[Task], options: ExportOptions
) -> Carried:
    consumer = CONSUMERS.get(kind)
    if consumer is None:
        return Carried(kind, "", None, None, {}, "it is a set of parameters, which nothing runs")
    if not consumer.installed:
        return Carried(kind, "", None, None, {}, f"the package {consumer.module} is not installed")

    def error(one: RobotModel) -> float:
        with tempfile.TemporaryDirectory() as folder:
            return error_mps(all_tasks, simulation(kind, one, Path(folder), options), model)

    holds = exporter(kind).HOLDS
    try:
        after = error(model)
    except TruingError as stop:
        # A file that cannot be made (an FMU without a compiler) is no reason to say nothing of others.
        return Carried(kind, "", None, None, {}, stop.message)
    terms = {
        term: error(without(model, holds - {term})) if term in holds else None
        for term in sorted(present(model))
    }
    return Carried(kind, consumer.name, None if given is None else error(given), after, terms)
