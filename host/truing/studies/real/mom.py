"""The MOM Simulator View paper's drift, found again in runs made from its constants, and fitted to its end.

The paper prints no runs: it prints a straight line that was commanded, an error model with its constants,
and where the real robot ended (Table 2). `constants_runs` reconstructs what its robot's odometry would
have recorded if the constants were right: the line at three speeds, and spins both ways, in which its
model drives no distance and so drifts by nothing. `end_run` is the line with the one pose that is known of
the real robot. Its odometry saw the drift ("precise for short distances"), so both are held against what
was commanded. Poses are rounded as the paper prints them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.data.set_data import set_data
from truing.diagnose.simulation.simulator import SetSimulator
from truing.levenberg import minimise
from truing.recording.baseline import Baseline, RobotGeometry, WheelModel
from truing.recording.run import ODOMETRY_COLUMNS, RecordingSet, Run
from truing.studies.mom_odometry import DESIRED, PAPER_MODEL, REAL, START, Pose, advance, replay

EFFECT = "heading_drift"
NAME = "MOM straight line"
# The paper's step, 100 ms; 0.02 m in it (over which it states its drift) are 0.2 m/s.
STEP_S = 0.1
SPEEDS_MPS = (0.1, 0.2, 0.3)
SPIN_RADPS = 0.5
# Not in the paper, and without influence on a drift: they turn twists into two wheels' efforts.
WHEELBASE_M, FULL_SPEED_MPS = 0.4, 1.0
REST_ROWS = 10
# Printed digits: 0.1 mm, 0.001 degrees.
PLACE_M, ANGLE_RAD = 1e-4, math.radians(1e-3)
# Each of the paper's steps is integrated in so many parts.
FINE_PARTS = 20


def constants_runs() -> RecordingSet:
    """Lines and spins as an odometry records them whose robot errs as the paper's model says."""
    length = START.distance_m(DESIRED)
    drives = [(f"line_{1000.0 * speed:.0f}_mmps", speed, 0.0, length / speed) for speed in SPEEDS_MPS]
    full_turn_s = 2.0 * math.pi / SPIN_RADPS
    drives += [("spin_left", 0.0, SPIN_RADPS, full_turn_s), ("spin_right", 0.0, -SPIN_RADPS, full_turn_s)]
    runs = [
        _run(f"{number:02d}_{name}", v_mps, w_radps, seconds)
        for number, (name, v_mps, w_radps, seconds) in enumerate(drives, start=1)
    ]
    return RecordingSet("MOM constants", tuple(runs), _baseline())


def end_run() -> RecordingSet:
    """The commanded line with the pose at its two ends: all that is known of the real robot."""
    run = _run("01_line", SPEEDS_MPS[1], 0.0, START.distance_m(DESIRED) / SPEEDS_MPS[1])
    columns = dict(run.columns)
    x, y = REAL.x_m - START.x_m, REAL.y_m - START.y_m
    facing = math.radians(START.theta_deg)
    turn = math.radians(REAL.turn_deg(START))
    last = (
        x * math.cos(facing) + y * math.sin(facing),
        y * math.cos(facing) - x * math.sin(facing),
        turn,
    )
    for name, value in zip(ODOMETRY_COLUMNS, last, strict=True):
        column = np.full(len(run), np.nan)
        column[0], column[-1] = 0.0, value
        columns[name] = column
    return RecordingSet(NAME, (Run(run.name, columns, order=run.order),), _baseline())


@dataclass(frozen=True, slots=True)
class LineEnd:
    """Where the product's simulation of the commanded line ends under a drift and a scale.

    Attributes
    ----------
    distance_m, heading_deg : from the printed real end.
    """

    name: str
    drift: float
    scale: float
    end: Pose
    distance_m: float
    heading_deg: float


def line_ends(found: dict[str, float]) -> tuple[LineEnd, ...]:
    """The line without an error, with the paper's constants, with `found`, and fitted to the real end.

    Parameters
    ----------
    found : `drift` and `distance_scale`, as diagnosed on the reconstructed runs.
    """
    recordings = end_run()
    simulator = SetSimulator(set_data(recordings, commanded=True), commanded=True)
    cases = [
        ("as commanded", 0.0, 0.0),
        ("paper's constants", PAPER_MODEL.straight, PAPER_MODEL.scale),
        ("found in runs made with them", found["drift"], found["distance_scale"]),
        ("fitted to the real end", *_fit(simulator)),
    ]
    return tuple(LineEnd(name, drift, scale, *_end(simulator, drift, scale)) for name, drift, scale in cases)


def _fit(simulator: SetSimulator) -> tuple[float, float]:
    """Drift and scale for which the line ends closest to where the real robot did."""

    def residual(x: FloatArray) -> FloatArray:
        return _residual(simulator, float(x[0]), float(x[1])) * (1.0, 1.0, 1.0)

    def jacobian(x: FloatArray, at: FloatArray) -> FloatArray:
        steps = 1e-6 * np.eye(2)
        return np.stack([(residual(x + step) - at) / 1e-6 for step in steps], axis=1)

    end = minimise(residual, jacobian, np.zeros(2), np.full(2, -1.0), np.full(2, 1.0))
    return float(end.theta[0]), float(end.theta[1])


def _residual(simulator: SetSimulator, drift: float, scale: float) -> FloatArray:
    """Measured minus simulated end: forward m, lateral m, heading rad, shape (3,)."""
    theta = simulator.start()
    theta[simulator.layout.index(f"{EFFECT}.drift")] = drift
    theta[simulator.layout.index(f"{EFFECT}.distance_scale")] = scale
    residuals = simulator.pose_residuals(theta, simulator.enabled((EFFECT,)), simulator.data.pose_horizon_s)
    return np.asarray(residuals[-1])


def _end(simulator: SetSimulator, drift: float, scale: float) -> tuple[Pose, float, float]:
    forward, lateral, heading = _residual(simulator, drift, scale).tolist()
    facing = math.radians(START.theta_deg)
    end = Pose(
        REAL.x_m - forward * math.cos(facing) + lateral * math.sin(facing),
        REAL.y_m - forward * math.sin(facing) - lateral * math.cos(facing),
        (REAL.theta_deg - math.degrees(heading)) % 360.0,
    )
    return end, end.distance_m(REAL), end.turn_deg(REAL)


def _baseline() -> Baseline:
    """A robot that follows its command almost at once."""
    wheel = WheelModel(FULL_SPEED_MPS, 0.5 * STEP_S)
    robot = RobotGeometry(NAME, wheelbase_m=WHEELBASE_M)
    return Baseline(Path("baseline.toml"), wheel, wheel, robot, 1.0 / STEP_S)


def _run(name: str, v_mps: float, w_radps: float, seconds: float) -> Run:
    driven = round(seconds / STEP_S)
    moving = np.zeros(driven + 2 * REST_ROWS)
    # Whole steps, the last of which ends the commanded distance.
    moving[REST_ROWS : REST_ROWS + driven] = seconds / (driven * STEP_S)
    speeds = np.stack([v_mps - 0.5 * WHEELBASE_M * w_radps, v_mps + 0.5 * WHEELBASE_M * w_radps])
    advances, turns = advance((speeds[0] * moving, speeds[1] * moving), WHEELBASE_M, STEP_S)
    path = _fine_path(np.asarray(advances), np.asarray(turns))
    left, right = _wheels(path)
    columns = {
        "t_s": STEP_S * np.arange(len(moving) + 1),
        "effort_left": np.concatenate(([0.0], moving * speeds[0] / FULL_SPEED_MPS)),
        "effort_right": np.concatenate(([0.0], moving * speeds[1] / FULL_SPEED_MPS)),
        "pos_left_m": left,
        "pos_right_m": right,
        "x_m": np.round(path[:, 0] / PLACE_M) * PLACE_M,
        "y_m": np.round(path[:, 1] / PLACE_M) * PLACE_M,
        "theta_rad": np.round(path[:, 2] / ANGLE_RAD) * ANGLE_RAD,
    }
    return Run(name, columns, order=tuple(columns))


def _fine_path(advances: FloatArray, turns: FloatArray) -> FloatArray:
    """Poses after each step, shape (n + 1, 3); the paper's own steps are short ones."""
    fine = (np.repeat(each / FINE_PARTS, FINE_PARTS) for each in (advances, turns))
    return replay(PAPER_MODEL, Pose(0.0, 0.0, 0.0), *fine)[::FINE_PARTS]


def _wheels(path: FloatArray) -> Sequence[FloatArray]:
    """Travel of left and right wheel along a path, each (n + 1,): what its odometry integrated."""
    steps = np.diff(path, axis=0)
    middle = path[:-1, 2] + 0.5 * steps[:, 2]
    forward = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    turn = 0.5 * WHEELBASE_M * steps[:, 2]
    return [np.concatenate(([0.0], np.cumsum(forward + side * turn))) for side in (-1.0, 1.0)]
