"""The odometry error model of the MOM Simulator View paper against its own Table 2.

The paper advances a pose by, equations (1) to (3) and the error model at the end of its section 4.2,

    x(k+1)     = x(k) + D (1 + e) cos(theta(k) + T)
    y(k+1)     = y(k) + D (1 + e) sin(theta(k) + T)
    theta(k+1) = theta(k) + T + D k

with D the commanded advance of a step (m), T its commanded turn (rad), e = 0.0655 the error of distance, and
k the drift per metre: -0.2635 where T = 0, -0.02635 where T < 0, +0.02635 where T > 0 (rad/m). D and T come
from the wheels' speeds; equation (4) prints v0 = (vr - vl)/2 for the forward speed, which is zero on a
straight line: the sign is a slip, and the mean (vr + vl)/2 is meant (it is equation (8) of Bakirci 2023).

On a straight line (T = 0, N steps, L = N D) the sums close: theta ends at theta_0 + k L, so that an end
heading gives k; and the chord is L (1 + e) sin(kL/2)/(kL/2) for short steps, so that an end point gives e.
The path has three end coordinates and the model two numbers: what is left over is the model's own error.
The paper gives the step of this run in time (100 ms) and not in length; short steps are taken, and those of
0.02 m, over which its drift was measured, beside them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from truing.arrays import FloatArray

# Halving it moves the end by less than half a millimetre.
STEP_M = 0.001
# "-0.00527 radians for a distance of 0.02 m": what the paper's drift was measured over.
PAPER_STEP_M = 0.02


@dataclass(frozen=True, slots=True)
class Pose:
    """A pose as the paper prints it: m, m, degrees."""

    x_m: float
    y_m: float
    theta_deg: float

    def distance_m(self, other: Pose) -> float:
        """Distance on the floor."""
        return math.hypot(self.x_m - other.x_m, self.y_m - other.y_m)

    def turn_deg(self, other: Pose) -> float:
        """Heading less the other's, -180 to 180 degrees."""
        return (self.theta_deg - other.theta_deg + 180.0) % 360.0 - 180.0

    def to_json(self) -> dict[str, float]:
        """For `--json`."""
        return {"x_m": self.x_m, "y_m": self.y_m, "theta_deg": self.theta_deg}


@dataclass(frozen=True, slots=True)
class ErrorModel:
    """Distance scale e, and drift (rad/m) on straight lines and on turns of either sense."""

    scale: float
    straight: float
    turning_right: float = -0.02635
    turning_left: float = 0.02635

    def drift(self, turns_rad: FloatArray) -> FloatArray:
        """Drift of steps with these commanded turns, rad/m, of the same shape."""
        turning = np.where(turns_rad < 0.0, self.turning_right, self.turning_left)
        return np.where(turns_rad == 0.0, self.straight, turning)


# Table 2: a straight line of "approximately" 2.5 m; its printed end lies 2.79 m from the start.
START = Pose(0.5, 0.5, 45.0)
DESIRED = Pose(2.4728, 2.4728, 45.0)
PRINTED_MODEL = Pose(3.0663, 1.2849, 349.611)
REAL = Pose(3.2081, 1.4842, 354.571)
PAPER_MODEL = ErrorModel(0.0655, -0.2635)
NO_ERROR = ErrorModel(0.0, 0.0, 0.0, 0.0)


def advance(speeds_mps: tuple[float, float], wheelbase_m: float, step_s: float) -> tuple[float, float]:
    """D (m) and T (rad) of a step from the speeds of left and right wheel: (4) with its sign put right."""
    left, right = speeds_mps
    return 0.5 * (right + left) * step_s, (right - left) / wheelbase_m * step_s


def replay(model: ErrorModel, start: Pose, advances_m: FloatArray, turns_rad: FloatArray) -> FloatArray:
    """Poses x (m), y (m), theta (rad) from the start on, shape (n + 1, 3).

    Parameters
    ----------
    advances_m, turns_rad : shape (n,), what was commanded in each step.
    """
    heading = math.radians(start.theta_deg) + np.cumsum(turns_rad + advances_m * model.drift(turns_rad))
    before = np.concatenate(([math.radians(start.theta_deg)], heading))
    travelled = advances_m * (1.0 + model.scale)
    along = before[:-1] + turns_rad
    x = start.x_m + np.cumsum(travelled * np.cos(along))
    y = start.y_m + np.cumsum(travelled * np.sin(along))
    first = [[start.x_m, start.y_m, before[0]]]
    return np.concatenate((first, np.column_stack((x, y, heading))))


def straight_line(step_m: float = STEP_M) -> tuple[FloatArray, FloatArray]:
    """Advances (n,) and turns (n,) of Table 2's line, in whole steps of about `step_m`."""
    length = START.distance_m(DESIRED)
    count = round(length / step_m)
    return np.full(count, length / count), np.zeros(count)


def end_of(path: FloatArray) -> Pose:
    """The last pose of a path."""
    x, y, theta = path[-1].tolist()
    return Pose(x, y, math.degrees(theta))


@dataclass(frozen=True, slots=True)
class LineReplay:
    """Table 2's line under one error model."""

    name: str
    model: ErrorModel
    path: FloatArray
    target: Pose

    @property
    def end(self) -> Pose:
        """Where it ends."""
        return end_of(self.path)

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "model": self.name,
            "distance_scale": self.model.scale,
            "drift_rad_per_m": self.model.straight,
            "end": self.end.to_json(),
            "distance_from_real_m": self.end.distance_m(REAL),
            "heading_from_real_deg": self.end.turn_deg(REAL),
            "distance_from_printed_model_m": self.end.distance_m(PRINTED_MODEL),
            "heading_from_printed_model_deg": self.end.turn_deg(PRINTED_MODEL),
        }


def fit_line(target: Pose) -> ErrorModel:
    """The drift that gives the line the heading of `target`, and the scale that ends it closest to its place.

    The path of a given drift scales with 1 + e, so that e is linear least squares.
    """
    advances, turns = straight_line()
    length = float(advances.sum())
    drift = math.radians(target.turn_deg(START)) / length
    end = end_of(replay(ErrorModel(0.0, drift), START, advances, turns))
    run_x, run_y = end.x_m - START.x_m, end.y_m - START.y_m
    wanted_x, wanted_y = target.x_m - START.x_m, target.y_m - START.y_m
    scale = (run_x * wanted_x + run_y * wanted_y) / (run_x**2 + run_y**2) - 1.0
    return ErrorModel(scale, drift)


@dataclass(frozen=True, slots=True)
class MomStudy:
    """Table 2 replayed: the paper's constants, the fit to the real end, the fit to the printed simulation."""

    unmodelled: LineReplay
    paper: LineReplay
    coarse: LineReplay
    fitted: LineReplay
    implied: LineReplay

    @property
    def replays(self) -> tuple[LineReplay, ...]:
        """All of them, in the order of a table."""
        return self.unmodelled, self.paper, self.coarse, self.fitted, self.implied

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "start": START.to_json(),
            "desired": DESIRED.to_json(),
            "printed_model": PRINTED_MODEL.to_json(),
            "real": REAL.to_json(),
            "replays": [line.to_json() for line in self.replays],
            "not_replayed": ["Table 3", "Table 4"],
        }


def study_mom() -> MomStudy:
    """Replay the line under every model."""

    def line(name: str, model: ErrorModel, target: Pose, step_m: float = STEP_M) -> LineReplay:
        return LineReplay(name, model, replay(model, START, *straight_line(step_m)), target)

    return MomStudy(
        line("no error model", NO_ERROR, DESIRED),
        line("paper's constants", PAPER_MODEL, PRINTED_MODEL),
        line("same, 0.02 m steps", PAPER_MODEL, PRINTED_MODEL, PAPER_STEP_M),
        line("fitted to real end", fit_line(REAL), REAL),
        line("fitted to printed", fit_line(PRINTED_MODEL), PRINTED_MODEL),
    )
