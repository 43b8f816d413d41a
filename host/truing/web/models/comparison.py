"""Desired, simulated, simulated with the error model, and real: paths, stopping points, speeds, residuals.

The four columns of the MOM paper's Tables 2 to 4. Desired follows the control inputs exactly. Simulated is
the baseline driven by the efforts that the real robot applied, never by its measured speeds. Simulated
(model) adds the active error model: the paper's distorts the commanded motion, a diagnosed one acts on the
wheels under the efforts. Real is the externally measured pose where the run has one, otherwise the robot's
own odometry.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.errors import PlanError, TruingError
from truing.identify.grey_box import simulate_signal
from truing.identify.signals import wheel_signal
from truing.model.wheel import WheelPhysics
from truing.plan import Plan
from truing.recording.baseline import Baseline
from truing.recording.run import TRUTH_COLUMNS, WHEELS, Run, Wheel
from truing.studies.mom_odometry import NO_ERROR, ErrorModel
from truing.web.models.effect_rollout import effect_rollout, has_memory
from truing.web.models.error_model import ModelChoice
from truing.web.models.error_replay import replay_path, steps_of
from truing.web.models.wheel_rollout import rollout
from truing.web.path.sequence_file import cycles_of_plan
from truing.web.path.trajectory import Cycle
from truing.web.pose import Pose, wrapped

COLUMNS = ("Desired", "Simulated", "Simulated (model)", "Real robot")
_MIN_WHEEL_DIFFERENCE_M = 1e-9


@dataclass(frozen=True, slots=True)
class Curve:
    """One version of the run: its path and, where known, its wheel speeds.

    Attributes
    ----------
    t_s : shape (n,).
    path : x (m), y (m), theta (rad), shape (n, 3); None where only the speeds are known.
    left_mps, right_mps : wheel speeds, shape (n,); None where only the path is known.
    """

    name: str
    t_s: FloatArray
    path: FloatArray | None
    left_mps: FloatArray | None = None
    right_mps: FloatArray | None = None

    @property
    def end(self) -> Pose | None:
        """The stopping point."""
        if self.path is None:
            return None
        x, y, theta = self.path[-1].tolist()
        return Pose(x, y, theta)

    def speed(self, wheel: Wheel) -> FloatArray | None:
        """One wheel's speed."""
        return self.left_mps if wheel == "left" else self.right_mps


@dataclass(frozen=True, slots=True)
class Comparison:
    """One run and its simulations; a curve that the files do not determine is None."""

    run: Run
    desired: Curve | None
    simulated: Curve | None
    modelled: Curve | None
    real: Curve
    notes: tuple[str, ...] = ()

    @property
    def titles(self) -> tuple[str, ...]:
        """Of the columns: a run of a virtual board, whose metadata has its seed, is no real robot's."""
        metadata = self.run.metadata
        virtual = metadata is not None and metadata.seed is not None
        return (*COLUMNS[:3], "Virtual robot" if virtual else COLUMNS[3])

    @property
    def curves(self) -> tuple[Curve | None, Curve | None, Curve | None, Curve]:
        """In the order of `COLUMNS`."""
        return self.desired, self.simulated, self.modelled, self.real

    def stopping_points(self) -> list[list[str]]:
        """The rows of Tables 2 to 4, and each column's error with respect to the real robot."""
        ends = [None if curve is None else curve.end for curve in self.curves]
        real = self.real.end
        return [
            ["x, m", *(_text(None if end is None else end.x_m, 4) for end in ends)],
            ["y, m", *(_text(None if end is None else end.y_m, 4) for end in ends)],
            [
                "θ, °",
                *(_text(None if end is None else math.degrees(wrapped(end.theta_rad)), 3) for end in ends),
            ],
            [
                "position error, m",
                *(_text(None if not end or not real else end.distance_m(real), 4) for end in ends),
            ],
            [
                "heading error, °",
                *(_text(None if not end or not real else _heading_error_deg(end, real), 3) for end in ends),
            ],
        ]

    def residual(self, wheel: Wheel, curve: Curve | None = None) -> FloatArray | None:
        """Real minus simulated speed (or another curve's), at the times of the real one, shape (n,), m/s."""
        other = self.simulated if curve is None else curve
        real = self.real.speed(wheel)
        speed = None if other is None else other.speed(wheel)
        if real is None or speed is None or other is None:
            return None
        return real - np.interp(self.real.t_s, other.t_s, speed)


def compare(
    run: Run,
    baseline: Baseline | None,
    plan: Plan | None,
    model: ModelChoice | None = None,
    start: Pose | None = None,
    set_runs: Callable[[], Sequence[Run]] = tuple,
) -> Comparison:
    """Compare a run with its simulations, all starting at the pose `start`.

    Parameters
    ----------
    set_runs : returns the recording set of the run; called if the model has effects with memory.

    Raises
    ------
    TruingError : the run has neither a pose nor wheel speeds.
    """
    start = start or Pose()
    notes: list[str] = []
    width = None if baseline is None else baseline.wheelbase_m or None
    real = _real(run, baseline, start, width, notes)
    cycles = None
    desired = None
    if plan is None:
        notes.append("no plan is known for this run: the desired path is unknown")
    else:
        try:
            cycles = cycles_of_plan(plan, width or 0.283)
        except PlanError:
            notes.append("this run was driven by efforts: there is no desired path")
        else:
            desired = _replay("Desired", NO_ERROR, start, cycles)
    simulated = _simulated(run, baseline, start, width)
    if simulated is None:
        notes.append("the set has no baseline that can be simulated under this run's efforts")
    elif simulated.path is None:
        notes.append("the set's baseline has no wheelbase: speeds are simulated, paths are not")
    modelled = None
    if model is not None and model.kind == "paper":
        if cycles is not None:
            modelled = _replay(COLUMNS[2], model.paper, start, cycles)
        elif simulated is not None and simulated.path is not None and width:
            modelled = _with_paper_errors(simulated, model.paper, start, width)
    elif model is not None and model.kind == "found" and baseline is not None:
        t, speeds, path = _diagnosed_rollout(run, model.applied(baseline), start, set_runs, notes)
        modelled = Curve(COLUMNS[2], t, path, speeds[:, 0], speeds[:, 1])
    return Comparison(run, desired, simulated, modelled, real, tuple(notes))


def _diagnosed_rollout(
    run: Run, robot: Baseline, start: Pose, set_runs: Callable[[], Sequence[Run]], notes: list[str]
) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    if has_memory(robot):
        try:
            return effect_rollout(run, robot, start, set_runs())
        except TruingError as error:
            # Other runs of the set may have other columns, or be damaged.
            notes.append(f"charge, heat and wheel angle start with this run: {error}")
    return effect_rollout(run, robot, start)


def _replay(name: str, model: ErrorModel, start: Pose, cycles: list[Cycle]) -> Curve:
    t, advances, turns = steps_of(cycles)
    path = replay_path(model, start, advances, turns)
    return Curve(name, np.concatenate(([0.0], t)), path)


def _real(run: Run, baseline: Baseline | None, start: Pose, width: float | None, notes: list[str]) -> Curve:
    speeds = _speeds(run, baseline)
    if all(name in run.columns and np.isfinite(run.columns[name]).all() for name in TRUTH_COLUMNS):
        pose = tuple(run.columns[name] for name in TRUTH_COLUMNS)
    else:
        found = run.pose()
        if found is not None:
            pose = found
        elif speeds is not None and width:
            notes.append("this run has no pose: its path is integrated from the wheel speeds")
            return Curve(COLUMNS[3], run.t_s, rollout(run.t_s, *speeds, width, start), *speeds)
        elif speeds is not None:
            return Curve(COLUMNS[3], run.t_s, None, *speeds)
        else:
            raise TruingError(
                f"{run.name}: it has neither a pose nor wheel speeds",
                "add a baseline.toml with [robot] wheel_radius_m and counts_per_rev to its set",
            )
    path = _placed(np.column_stack(pose), start)
    return Curve(COLUMNS[3], run.t_s, path, *(speeds or (None, None)))


def _placed(path: FloatArray, start: Pose) -> FloatArray:
    """A path transformed so that it starts at `start`."""
    first = Pose(*path[0].tolist())
    return start.compose(first.inverse()).placed(path)


def _speeds(run: Run, baseline: Baseline | None) -> tuple[FloatArray, FloatArray] | None:
    try:
        return run.speed("left", baseline).values, run.speed("right", baseline).values
    except TruingError:
        return None


def _simulated(run: Run, baseline: Baseline | None, start: Pose, width: float | None) -> Curve | None:
    if baseline is None:
        return None
    sides = []
    for wheel in WHEELS:
        known = baseline.left if wheel == "left" else baseline.right
        physics = WheelPhysics(gain_mps=known.gain_mps, time_constant_s=known.time_constant_s)
        try:
            signal = wheel_signal([run], wheel, baseline)
        except TruingError:
            return None
        sides.append(np.interp(run.t_s, signal.excitation.t_s, simulate_signal(physics, signal)))
    left, right = sides
    path = rollout(run.t_s, left, right, width, start) if width else None
    return Curve(COLUMNS[1], run.t_s, path, left, right)


def _with_paper_errors(simulated: Curve, model: ErrorModel, start: Pose, width: float) -> Curve:
    """The paper's error model applied to the simulated wheel travel, for runs without control inputs."""
    assert simulated.left_mps is not None
    assert simulated.right_mps is not None
    spans = np.diff(simulated.t_s)
    left, right = simulated.left_mps[1:] * spans, simulated.right_mps[1:] * spans
    turns = (right - left) / width
    # The paper's model distinguishes turning steps; a wheel difference of nanometres is not a turn.
    turns = np.where(np.abs(right - left) < _MIN_WHEEL_DIFFERENCE_M, 0.0, turns)
    path = replay_path(model, start, 0.5 * (left + right), turns)
    return Curve(COLUMNS[2], simulated.t_s, path)


def _text(value: float | None, digits: int) -> str:
    # Adding zero removes the sign of a negative zero.
    return "–" if value is None else f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "−")


def _heading_error_deg(a: Pose, b: Pose) -> float:
    return math.degrees(wrapped(a.theta_rad - b.theta_rad))
