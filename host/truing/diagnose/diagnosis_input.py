"""Input of a diagnosis: its options, reading recordings with their baseline, leaving signals out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from truing.diagnose.measured import Measured, with_measured
from truing.errors import IdentifyError
from truing.identify.first_baseline import SAID, with_first_baseline
from truing.importers import ImportOptions, read_runs
from truing.recording.geometry import with_radians
from truing.recording.held_load import without_held_load
from truing.recording.run import RecordingSet, Wheel


@dataclass(frozen=True, slots=True)
class Options:
    """How to diagnose.

    Attributes
    ----------
    sim_runs : folder with another simulator's output, instead of the baseline's own.
    wheels_only : leave pose and yaw rate aside.
    jobs : threads; None: one for each core.
    commanded : the wheels were not measured, or share the error in question: compare the pose with the
        commands.
    floor_m : floor that a proposed run may use, m; None: as much as the recorded runs used.
    wheel : diagnose this wheel alone.
    accept : effects that the user takes for the model, whatever the verdict; empty: none.
    measured : numbers of the robot that were measured directly.
    learn : learn a correction for what the model leaves.
    """

    sim_runs: Path | None = None
    wheels_only: bool = False
    jobs: int | None = None
    floor_m: float | None = None
    commanded: bool = False
    wheel: Wheel | None = None
    accept: tuple[str, ...] = ()
    measured: tuple[Measured, ...] = ()
    learn: bool = False

    def suiting(self, recordings: RecordingSet) -> Options:
        """These options as the recordings take them.

        Both sides of an axis hold its numbers: one of them is judged, and a pose means nothing.

        Raises
        ------
        IdentifyError : a command is to be compared with the pose of an axis.
        """
        if recordings.axis is None:
            return self
        if self.commanded:
            raise IdentifyError(
                f"{recordings.name}: what is commanded is compared with a pose, and an axis has none",
                "Diagnose its own motion: leave --commanded away",
            )
        return replace(self, wheel="left", wheels_only=True)


def with_what_to_compare(
    recordings: RecordingSet, options: Options, say: Callable[[str], object]
) -> RecordingSet:
    """The recordings with what a diagnosis compares them with, from the command line as from Python.

    A load that an axis holds is taken out of its efforts: no baseline has one. The baseline gets the numbers
    that were measured. Where there is none, and neither another simulator's output nor the command to compare
    with, there is the first-order model that fits the runs best.

    Parameters
    ----------
    say : told in a sentence that there was no baseline.
    """
    found = with_measured(with_radians(recordings), options.measured)
    if options.sim_runs is not None:
        return found
    found = without_held_load(found)
    if found.baseline is not None or options.commanded:
        return found
    found = with_first_baseline(found)
    say(SAID)
    return found


def read_input(path: Path, model: Path | None) -> RecordingSet:
    """A recording set, a folder of CSV files, one CSV file, or a foreign file, with its baseline."""
    return read_runs(path, model, options=ImportOptions())
