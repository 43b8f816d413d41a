"""Diagnoses of the Python verbs that several tests share: of docs/example each takes 6 s of processor time.

Modules that use it are of one xdist group, so that one process runs them: `xdist_group(GROUP)`.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from truing.api import diagnosing
from truing.diagnose.diagnosis_input import Options
from truing.diagnose.result import Diagnosis
from truing.recording.run import RecordingSet

GROUP = "shared_diagnosis"
_made: dict[bytes, Diagnosis] = {}


@contextmanager
def diagnosed_once() -> Iterator[None]:
    """Within it `truing.diagnose` answers with what it found before for the same recordings and options."""
    diagnose = diagnosing.diagnose_recordings

    def once(recordings: RecordingSet, options: Options, *more: Any) -> Diagnosis:
        key = pickle.dumps((_at_absolute_paths(recordings), options))
        if key not in _made:
            _made[key] = diagnose(recordings, options, *more)
        return _made[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(diagnosing, "diagnose_recordings", once)
        yield


def _at_absolute_paths(recordings: RecordingSet) -> RecordingSet:
    """The same recordings, wherever the working folder was when they were read."""
    baseline = recordings.baseline
    return replace(
        recordings,
        path=_absolute(recordings.path),
        runs=tuple(replace(run, path=_absolute(run.path)) for run in recordings.runs),
        baseline=None if baseline is None else replace(baseline, path=baseline.path.resolve()),
    )


def _absolute(path: Path | None) -> Path | None:
    return None if path is None else path.resolve()
