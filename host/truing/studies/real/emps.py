"""The EMPS positioning axis as a robot of one wheel: what the first file teaches is shown on the second.

EMPS is a DC motor with a ball screw and a carriage under closed-loop position control (Janot, Gautier and
Brunot 2019, "Data set and reference models of EMPS", nonlinearbenchmark.org): no robot. As a recording
set, the axis is the left wheel: its travel is the carriage's and its effort the drive signal over the drive's
full scale. There is no right wheel: its columns are zero, and the diagnosis says that it is never driven and
never moves, and nothing else about it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.data.set_data import set_data
from truing.diagnose.simulation.simulator import SetSimulator
from truing.errors import FileError
from truing.identify.first_baseline import linear_baseline
from truing.recording.baseline import RobotGeometry
from truing.recording.run import RecordingSet, Run

FIRST, SECOND = "DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"
INTERVAL_S = 1e-3
# The files' rows that become one: 100 Hz is ten samples in the axis' time constant of half a second, twice.
ROWS = 10
# Drive signals of this class span -10 to 10 V; gains come out per unit of this.
FULL_SCALE_V = 10.0


def read_emps(recordings: Path) -> tuple[RecordingSet, RecordingSet]:
    """Both files, each a set of one run, with the linear baseline that the first one gives.

    Raises
    ------
    FileError : the files are not there.
    """
    folder = recordings / "raw" / "emps"
    first, second = (_read(folder / name) for name in (FIRST, SECOND))
    baseline = linear_baseline((first,), RobotGeometry(name="EMPS"), wheels=("left",))
    return RecordingSet("EMPS", (first,), baseline, folder), RecordingSet("EMPS", (second,), baseline, folder)


def _read(path: Path) -> Run:
    from scipy.io import loadmat

    if not path.is_file():
        raise FileError(path, "no such file")
    held = loadmat(path)
    position = held["qm"].ravel().astype(np.float64)[::ROWS]
    # The controller holds its output until the next sample: a row is driven by the samples before it.
    drive = held["vir"].ravel().astype(np.float64) / FULL_SCALE_V
    count = len(position) - 1
    mean = drive[: count * ROWS].reshape(count, ROWS).mean(axis=1)
    nothing = np.zeros(count + 1)
    columns = {
        "t_s": ROWS * INTERVAL_S * np.arange(count + 1),
        "effort_left": np.concatenate((drive[:1], mean)),
        "effort_right": nothing,
        "pos_left_m": position - position[0],
        "pos_right_m": nothing,
    }
    return Run(path.stem.lower(), columns, order=tuple(columns), path=path)


def travel_error_mm(recordings: RecordingSet, effects: tuple[str, ...], theta: FloatArray) -> float:
    """RMS error of the carriage's place over a whole run in one open loop, mm.

    Parameters
    ----------
    effects, theta : an explanation, as the diagnosis of any set with the same baseline gives it.
    """
    data = set_data(recordings)
    simulator = SetSimulator(data)
    speeds = simulator.speeds(theta, simulator.enabled(effects))[:, 0]
    travel = np.concatenate(([0.0], np.cumsum(speeds[1:] * data.dt_s[1:])))
    return float(1e3 * np.sqrt(np.mean((travel - data.travel_m[:, 0]) ** 2)))
