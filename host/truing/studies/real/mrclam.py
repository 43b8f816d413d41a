"""MRCLAM, data set 6, robot 1: commands of an iRobot Create, and its pose by cameras.

The data set (Leung, Halpern, Barfoot and Liu 2011, International Journal of Robotics Research 30, "The
UTIAS multi-robot cooperative localization and mapping dataset") logs twists that were commanded, called
odometry there, and the pose from a Vicon system. No wheel was measured. In a recording set the twist
becomes the two wheels' commanded speeds,

    left = v - w b / 2,   right = v + w b / 2,   effort = speed / full speed,

the wheel columns hold the commanded travel, and the truth columns the cameras' pose. The set is diagnosed
as commanded: nothing is said about wheels, and the pose is held against what the efforts command.
"""

from __future__ import annotations

import gzip
from itertools import pairwise
from pathlib import Path

import numpy as np

from truing.arrays import BoolArray, FloatArray
from truing.errors import FileError
from truing.recording.baseline import Baseline, RobotGeometry, WheelModel
from truing.recording.run import TRUTH_COLUMNS, RecordingSet, Run

COMMANDS, POSES = "D6_Robot1_Odometry.dat.gz", "D6_Robot1_Groundtruth.dat.gz"
# iRobot Create Open Interface, 2006: "Drive Direct", -500 to 500 mm/s a wheel; 258 mm between the wheels.
FULL_SPEED_MPS = 0.5
WHEELBASE_M = 0.258
INTERVAL_S = 0.05
RUNS = 8
# Cameras that saw nothing for longer leave the pose unknown (they see the robot every 16 ms).
LONGEST_BLIND_S = 0.1


def read_mrclam(recordings: Path) -> RecordingSet:
    """The recording in eight runs, with a baseline that follows its command at once.

    Raises
    ------
    FileError : the files are not there.
    """
    folder = recordings / "raw" / "mrclam"
    commands, poses = _table(folder / COMMANDS), _table(folder / POSES)
    begin = max(commands[0, 0], poses[0, 0])
    end = min(commands[-1, 0], poses[-1, 0])
    cuts = np.linspace(begin, end, RUNS + 1)
    runs = [
        _run(f"{number:02d}_part", commands, poses, np.arange(a, b, INTERVAL_S))
        for number, (a, b) in enumerate(pairwise(cuts), start=1)
    ]
    return RecordingSet("MRCLAM 6, robot 1", tuple(runs), obedient_baseline(folder), folder)


def obedient_baseline(folder: Path) -> Baseline:
    """Full speed at full effort, reached within half a row: the twist as it is commanded."""
    wheel = WheelModel(FULL_SPEED_MPS, 0.5 * INTERVAL_S)
    robot = RobotGeometry("MRCLAM 6, robot 1", wheelbase_m=WHEELBASE_M)
    return Baseline(folder / "baseline.toml", wheel, wheel, robot, 1.0 / INTERVAL_S)


def _table(path: Path) -> FloatArray:
    if not path.is_file():
        raise FileError(path, "no such file")
    with gzip.open(path) as lines:
        return np.asarray(np.loadtxt(lines), dtype=np.float64)


def _run(name: str, commands: FloatArray, poses: FloatArray, at: FloatArray) -> Run:
    twist = np.stack([_mean_held(commands[:, 0], commands[:, k], at) for k in (1, 2)], axis=1)
    spin = 0.5 * WHEELBASE_M * twist[:, 1]
    columns = {"t_s": at - at[0]}
    for wheel, speed in (("left", twist[:, 0] - spin), ("right", twist[:, 0] + spin)):
        columns[f"effort_{wheel}"] = speed / FULL_SPEED_MPS
        columns[f"pos_{wheel}_m"] = np.concatenate(([0.0], np.cumsum(speed[1:] * np.diff(at))))
    pose = poses[:, 1:].copy()
    pose[:, 2] = np.unwrap(pose[:, 2])
    seen = _seen(poses[:, 0], at)
    for k, column in enumerate(TRUTH_COLUMNS):
        columns[column] = np.where(seen, np.interp(at, poses[:, 0], pose[:, k]), np.nan)
    return Run(name, columns, order=tuple(columns))


def _mean_held(t_s: FloatArray, values: FloatArray, at: FloatArray) -> FloatArray:
    """Mean over the interval before each row of a command that holds until the next, shape (n,)."""
    total = np.concatenate(([0.0], np.cumsum(values[:-1] * np.diff(t_s))))
    edges = np.concatenate(([2.0 * at[0] - at[1]], at))
    return np.asarray(np.diff(np.interp(edges, t_s, total)) / np.diff(edges))


def _seen(t_s: FloatArray, at: FloatArray) -> BoolArray:
    """Whether the cameras saw the robot close enough to each row, shape (n,)."""
    after = np.clip(np.searchsorted(t_s, at), 1, len(t_s) - 1)
    return np.asarray(t_s[after] - t_s[after - 1] <= LONGEST_BLIND_S)
