"""One task of a fleet: identify and diagnose one set, and write its row. It never raises for a set's sake."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from truing import __version__
from truing.errors import OutputError, TruingError, with_next
from truing.fleet.catalogue import SetEntry
from truing.fleet.storage import Place

if TYPE_CHECKING:
    from truing.diagnose.result import Diagnosis
    from truing.recording.run import RecordingSet

# The same parameters of every set, whatever else its physics has, so that they can be compared.
STRUCTURE = "delay"
Status = Literal["ok", "not_diagnosed", "failed"]


@dataclass(frozen=True, slots=True)
class Job:
    """A set, and what to do with it.

    Attributes
    ----------
    out : the output's folder; part: where in it the row goes.
    diagnose : also a verdict; False: the numbers alone.
    """

    entry: SetEntry
    out: str
    part: str
    diagnose: bool = True


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a task ended. The row itself is in its file.

    Attributes
    ----------
    again : the error was not the set's own: the next run tries it again.
    not_written : why the row could not be written.
    """

    name: str
    status: Status
    error: str
    again: bool
    seconds: float
    cpu_s: float
    not_written: OutputError | None = None


def process(job: Job) -> Outcome:
    """Identify and diagnose a set and write its row; whatever is wrong with the set stands in the row."""
    wall, cpu = time.perf_counter(), time.process_time()
    row = empty_row(job.entry)
    again = False
    try:
        _fill(row, job)
    except TruingError as error:
        row["error"] = with_next(error)
    except Exception as error:
        row["error"], again = f"{type(error).__name__}: {error}", True
    row["seconds"], row["cpu_s"] = time.perf_counter() - wall, time.process_time() - cpu
    return write_row(job, row, again=again)


def write_row(job: Job, row: dict[str, Any], *, again: bool) -> Outcome:
    """Write a row; a full disk is no error of the set, and stands in `Outcome.not_written`."""
    from truing.fleet.part import retry_name, to_bytes

    failed: OutputError | None = None
    try:
        Place(f"{job.out}/{retry_name(job.part) if again else job.part}").write(to_bytes(row))
    except OutputError as error:
        failed = error
    except TruingError as error:
        failed = OutputError(job.out, error.message, error.next_step)
    return Outcome(
        job.entry.name, row["status"], row["error"] or "", again, row["seconds"], row["cpu_s"], failed
    )


def empty_row(entry: SetEntry) -> dict[str, Any]:
    """The row of a set of which nothing is known but where it lies."""
    return {
        "set": entry.name,
        "robot": entry.robot,
        "group": entry.group,
        "recorded": entry.recorded,
        "url": entry.url,
        "status": "failed",
        "error": None,
        "seconds": 0.0,
        "cpu_s": 0.0,
        "truing": __version__,
        "numbers": [],
        "effects": [],
    }


def _fill(row: dict[str, Any], job: Job) -> None:
    from truing.importers import read_runs
    from truing.recording.held_load import without_held_load

    with _here(job.entry.url) as path, _here(job.entry.model) as model:
        assert path is not None
        recordings = read_runs(path, model)
    row["runs"], row["rows"] = len(recordings), sum(len(run) for run in recordings)
    row["numbers"] = _numbers(without_held_load(recordings))
    row["status"] = "not_diagnosed"
    if not job.diagnose:
        return
    found = _diagnosis(recordings)
    fit = found.fit
    row |= {
        "verdict": found.verdict,
        "baseline_rmse": _finite(fit.baseline_rmse),
        "refit_rmse": _finite(fit.refit_rmse),
        "model_rmse": _finite(fit.model_rmse),
        "noise_floor": _finite(fit.noise_floor),
        "rmse_unit": fit.unit,
        "effects": _effects(found),
        "status": "ok",
    }


@contextmanager
def _here(url: str | None) -> Iterator[Path | None]:
    """A set or model as a path of this computer, for as long as it is read."""
    place = None if url is None else Place(url)
    if place is None or place.is_local:
        yield None if place is None else place.path
        return
    with tempfile.TemporaryDirectory(prefix="truing-set-") as folder:
        yield place.fetch(Path(folder))


def _numbers(recordings: RecordingSet) -> list[dict[str, Any]]:
    """Gain, time constant, friction and delay of each wheel, with intervals, from all runs together."""
    from truing.identify.data_checks import refuse_absurd
    from truing.identify.effort_checks import refuse_efforts
    from truing.identify.grey_box import fit_wheel
    from truing.identify.row_sampling import with_row_sampling

    refuse_absurd(recordings)
    refuse_efforts(recordings)
    sampled = with_row_sampling(recordings)
    numbers = []
    for wheel in sampled.wheels:
        found = fit_wheel(sampled.runs, wheel, STRUCTURE, sampled.robot, hold_out=False)
        for name, quantity in found.parameters.items():
            low, high = quantity.ci95 or (None, None)
            numbers.append(
                {
                    "parameter": name,
                    "wheel": wheel,
                    "value": quantity.value,
                    "low": low,
                    "high": high,
                    "unit": quantity.unit,
                    "reason": quantity.reason,
                }
            )
    return numbers


def _diagnosis(recordings: RecordingSet) -> Diagnosis:
    from truing.diagnose.diagnosis_input import Options, with_what_to_compare
    from truing.diagnose.engine import diagnose
    from truing.diagnose.simulation.warm import compile_once

    # One thread: the fleet's own tasks fill the processors.
    options = Options(jobs=1).suiting(recordings)
    compile_once(lambda _text: None, wheels=len(recordings.wheels))
    return diagnose(with_what_to_compare(recordings, options, lambda _text: None), options)


def _effects(found: Diagnosis) -> list[dict[str, Any]]:
    return [
        {
            "effect": effect.name,
            "scope": effect.scope,
            "confidence": _finite(effect.confidence),
            "indistinguishable_from": list(effect.indistinguishable_from),
            "parameters": [
                {
                    "name": name,
                    "value": _finite(parameter.value),
                    "low": _finite(parameter.ci95[0]),
                    "high": _finite(parameter.ci95[1]),
                    "unit": parameter.unit,
                }
                for name, parameter in effect.parameters.items()
            ],
        }
        for effect in found.effects
    ]


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
