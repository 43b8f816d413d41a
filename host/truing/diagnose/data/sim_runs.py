"""Another simulator's output beside the recordings: matched by file name, checked row by row."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from truing.errors import FileError, RecordingError
from truing.recording.reader import read_run, run_files
from truing.recording.run import MOTION_PAIRS, WHEELS, RecordingSet, Run

# A simulation driven by the recording's own efforts has them to the last printed digit.
EFFORT_TOLERANCE = 5e-3


def read_sim_runs(folder: str | Path, recordings: RecordingSet) -> RecordingSet:
    """The simulated runs as a set of the same names, rows and efforts as the recorded ones.

    Raises
    ------
    FileError, RecordingError : a run has no counterpart, or its rows are not those of the recording.
    """
    files = {file.stem: file for file in run_files(folder)}
    names = [run.name for run in recordings]
    missing = [name for name in names if name not in files]
    if missing:
        others = sorted(set(files) - set(names))
        have = f"it holds {', '.join(others[:3])}" if others else "it holds no other"
        raise FileError(
            folder,
            f"no {missing[0]}.csv, which is one of the recorded runs; {have}",
            "Simulate every recorded run under its own efforts, and give each file the recording's name",
        )
    return replace(recordings, runs=tuple(_matched(read_run(files[run.name]), run) for run in recordings))


def _matched(simulated: Run, recorded: Run) -> Run:
    path = simulated.path or simulated.name
    if len(simulated) != len(recorded):
        raise RecordingError(
            path,
            f"{len(simulated)} rows, and the recording has {len(recorded)}",
            next_step="Simulate at the recording's own times, one row for each of its rows",
        )
    # Device time starts anywhere; what counts is that rows are equally far apart.
    off = np.abs((simulated.t_s - simulated.t_s[0]) - (recorded.t_s - recorded.t_s[0]))
    row = int(off.argmax())
    if off[row] > 0.2 * recorded.interval_s:
        raise RecordingError(
            path,
            f"{simulated.t_s[row]:.4f} s, and the recording has {recorded.t_s[row]:.4f} s",
            column="t_s",
            row=row + 1,
            next_step="Simulate at the recording's own times, one row for each of its rows",
        )
    for wheel in WHEELS:
        made, real = simulated.effort(wheel), recorded.effort(wheel)
        row = int(np.abs(made - real).argmax())
        if abs(made[row] - real[row]) > EFFORT_TOLERANCE:
            raise RecordingError(
                path,
                f"{made[row]:.4g}, and the recording has {real[row]:.4g}",
                column=f"effort_{wheel}",
                row=row + 1,
                next_step="Simulate under the recording's own efforts",
            )
    motion = {name for pair in MOTION_PAIRS.values() for name in pair}
    columns = {name: values for name, values in simulated.columns.items() if name in motion}
    columns |= {name: recorded.columns[name] for name in ("t_s", "effort_left", "effort_right")}
    return Run(recorded.name, columns, recorded.mode, {}, tuple(columns), simulated.path)
