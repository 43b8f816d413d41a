"""One way to read whatever holds runs: a set of our own, or a foreign file."""

from __future__ import annotations

from pathlib import Path

from truing.recording.baseline import read_baseline
from truing.recording.reader import read_recording_set
from truing.recording.run import RecordingSet


def read_runs(path: Path, model: Path | None = None) -> RecordingSet:
    """A recording set, a folder of CSV files, one CSV file, or a file of another program.

    What an importer found suspicious stands in the runs' warnings. Tests that turn the robot on the spot are
    left out (and that is said): their friction is another one, and one model cannot have both.

    Parameters
    ----------
    model : a baseline.toml to use instead of the one beside the runs.
    """
    from . import ImportOptions, import_file, is_foreign

    if not is_foreign(path):
        return read_recording_set(path, model)
    imported = import_file(path, ImportOptions(spins=False))
    baseline = read_baseline(model) if model is not None else None
    return RecordingSet(path.name.split(".")[0], imported.runs, baseline, path)
