"""Real drivetrains and the baseline each is diagnosed from: what a user without friction and delay has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from truing.errors import FileError
from truing.identify.first_baseline import linear_baseline
from truing.recording.baseline import RobotGeometry
from truing.recording.reader import read_recording_set
from truing.recording.run import RecordingSet

# Where a folder of recordings has its sets.
PLACES = ("real", "more/sets", "other/sets")


def read_drivetrain(folder: Path) -> RecordingSet:
    """A recording set with the linear baseline that its own runs give."""
    recordings = read_recording_set(folder)
    robot = RobotGeometry(name=folder.name)
    if recordings.baseline is not None and recordings.baseline.robot is not None:
        robot = recordings.baseline.robot
    return replace(recordings, baseline=linear_baseline(recordings.runs, robot))


def set_folders(recordings: Path) -> tuple[Path, ...]:
    """The folders of the sets under `real/`, in the order of their names.

    Raises
    ------
    FileError : there is no such folder, or it is empty.
    """
    real = recordings / "real"
    folders = _sets_in(real)
    if not folders:
        raise FileError(real, "holds no recording set", "Each set is a folder with runs/*.csv in it")
    return tuple(folders)


def all_set_folders(recordings: Path, further: Sequence[Path] = ()) -> tuple[Path, ...]:
    """The folders of all sets at hand, in the order of their names; of two with one name the first.

    Those under `real/`, `more/sets/` and `other/sets/` of the recordings, and of further folders.

    Raises
    ------
    FileError : there is none, or a further folder holds none.
    """
    for folder in further:
        if not _sets_in(folder):
            raise FileError(folder, "holds no recording set", "Each set is a folder with runs/*.csv in it")
    places = [*(recordings / place for place in PLACES), *further]
    found: dict[str, Path] = {}
    for path in (path for place in places for path in _sets_in(place)):
        found.setdefault(path.name, path)
    if not found:
        raise FileError(recordings, "holds no recording set", "Each set is a folder with runs/*.csv in it")
    return tuple(found[name] for name in sorted(found, key=str.lower))


def _sets_in(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if (path / "runs").is_dir()) if folder.is_dir() else []
