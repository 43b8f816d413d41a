"""One way to read whatever holds runs: a set of our own, or a foreign file."""

from __future__ import annotations

from pathlib import Path

from truing.recording.baseline import RobotGeometry, read_baseline
from truing.recording.geometry import with_given_geometry
from truing.recording.reader import read_recording_set
from truing.recording.run import RecordingSet

from .foreign import ImportOptions


def read_runs(
    path: Path,
    model: Path | None = None,
    *,
    geometry: RobotGeometry | None = None,
    options: ImportOptions | None = None,
) -> RecordingSet:
    """A recording set, a folder of CSV files, one CSV file, or a file of another program.

    What an importer found suspicious stands in the runs' warnings. Tests that turn the robot on the spot are
    left out (and that is said) unless the options ask for them: their friction is another one, and one model
    cannot have both.

    Parameters
    ----------
    model : a baseline.toml to use instead of the one beside the runs.
    geometry : numbers of the robot that are not in a baseline, or that correct it.
    options : how to read a file of another program.
    """
    from . import import_file, is_foreign

    given = geometry or RobotGeometry()
    options = options or ImportOptions(spins=False)
    if options.mapping is None and not is_foreign(path):
        return with_given_geometry(read_recording_set(path, model), given)
    imported = import_file(path, options)
    baseline = read_baseline(model) if model is not None else None
    return with_given_geometry(RecordingSet(path.name.split(".")[0], imported.runs, baseline, path), given)
