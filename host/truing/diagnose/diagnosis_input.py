"""Input of a diagnosis: its options, reading recordings with their baseline, leaving signals out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from truing.diagnose.measured import Measured
from truing.importers import ImportOptions, read_runs
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
    """

    sim_runs: Path | None = None
    wheels_only: bool = False
    jobs: int | None = None
    floor_m: float | None = None
    commanded: bool = False
    wheel: Wheel | None = None
    accept: tuple[str, ...] = ()
    measured: tuple[Measured, ...] = ()


def read_input(path: Path, model: Path | None) -> RecordingSet:
    """A recording set, a folder of CSV files, one CSV file, or a foreign file, with its baseline."""
    return read_runs(path, model, options=ImportOptions())
