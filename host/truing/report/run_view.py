"""What a picture of a run shows, ready to draw: the PNG and the HTML page share it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from truing.arrays import FloatArray
from truing.identify.first_order import FirstOrderFit, WheelData
from truing.recording.run import WHEELS, Geometry, Run, RunMetadata, Wheel

# Blue and vermilion of Okabe and Ito's palette: apart for every kind of colour vision, and in grey.
COLOURS: dict[Wheel, str] = {"left": "#0072B2", "right": "#D55E00"}
NEUTRAL = "#4a4a4a"
REFERENCE = "#009E73"

PathSource: TypeAlias = Literal["odometry", "wheel travel"]


@dataclass(frozen=True, slots=True)
class WheelView:
    """One wheel's curves, each of shape (n,) on the view's times; NaN breaks a line at a gap.

    Attributes
    ----------
    speed : measured, m/s.
    commanded : the speed that the command asks for, m/s: the command itself in velocity mode,
        command times identified gain in effort mode; None where neither is known.
    simulated : free-run simulation of the fitted first-order model, m/s, or None.
    effort : applied, per cent.
    """

    speed: FloatArray
    commanded: FloatArray | None
    simulated: FloatArray | None
    effort: FloatArray


@dataclass(frozen=True, slots=True)
class PathView:
    """Where the robot went, shape (n,) each: x and y in m, heading in rad."""

    x_m: FloatArray
    y_m: FloatArray
    theta_rad: FloatArray
    source: PathSource
    reference: tuple[FloatArray, FloatArray] | None


@dataclass(frozen=True, slots=True)
class RunView:
    """A run as pictures show it.

    Attributes
    ----------
    t_s : shape (n,), ends of the rows' intervals, s; inputs are constant over an interval.
    middle_s : shape (n,), middles of the intervals, where a mean speed belongs.
    commanded_label : what `commanded` means.
    path : None when the run has neither pose nor what one could be computed from.
    path_reason : why there is no path.
    """

    name: str
    t_s: FloatArray
    middle_s: FloatArray
    left: WheelView
    right: WheelView
    commanded_label: str
    path: PathView | None
    path_reason: str
    metadata: RunMetadata | None

    @property
    def wheels(self) -> tuple[tuple[Wheel, WheelView], ...]:
        """Left and right with their names."""
        return (("left", self.left), ("right", self.right))

    @property
    def same_command(self) -> bool:
        """Whether both wheels are asked for the same speed, to within half a per cent of the largest."""
        left, right = self.left.commanded, self.right.commanded
        if left is None or right is None:
            return False
        largest = max(float(np.nanmax(np.abs(left))), float(np.nanmax(np.abs(right))))
        return bool(np.nanmax(np.abs(left - right)) <= 0.005 * largest)

    @property
    def title(self) -> str:
        """The plan's title if the metadata has one, else the run's name."""
        plan = self.metadata.plan if self.metadata is not None else {}
        return str(plan.get("title") or plan.get("name") or self.name)


def view_run(
    run: Run, baseline: Geometry | None = None, fits: dict[Wheel, FirstOrderFit] | None = None
) -> RunView:
    """Collect what pictures of a run show.

    Parameters
    ----------
    fits : the fitted model of each wheel, for the simulated curve and for what an effort asks for.
    """
    fits = fits or {}
    wheels = {wheel: _view_wheel(run, wheel, baseline, fits.get(wheel)) for wheel in WHEELS}
    path, reason = _view_path(run, baseline)
    velocity = run.mode is not None and "velocity" in run.mode
    step = np.diff(run.t_s, prepend=run.t_s[0])
    return RunView(
        name=run.name,
        t_s=run.t_s,
        middle_s=run.t_s - 0.5 * step,
        left=wheels["left"],
        right=wheels["right"],
        commanded_label="commanded" if velocity else "command × gain",
        path=path,
        path_reason=reason,
        metadata=run.metadata,
    )


def _view_wheel(run: Run, wheel: Wheel, baseline: Geometry | None, fit: FirstOrderFit | None) -> WheelView:
    gaps = run.gaps()
    command = run.command(wheel)
    commanded = None
    if command is not None and run.mode is not None:
        active = np.array([mode != "idle" for mode in run.mode])
        if "velocity" in run.mode:
            commanded = _broken(np.where(active, command, 0.0), gaps)
        elif fit is not None and fit.gain.value is not None:
            commanded = _broken(fit.gain.value * np.where(active, command, 0.0), gaps)
    simulated = None
    if fit is not None and fit.gain.value is not None and fit.time_constant.value is not None:
        data = WheelData([run], wheel, baseline)
        simulated = _broken(data.simulate(fit.gain.value, fit.time_constant.value), gaps)
    speed = _broken(run.speed(wheel, baseline).values, gaps)
    return WheelView(speed, commanded, simulated, _broken(100.0 * run.effort(wheel), gaps))


def _broken(values: FloatArray, gaps: np.ndarray[tuple[int], np.dtype[np.intp]]) -> FloatArray:
    """A copy with NaN on the first row behind each gap, whose interval is the gap itself."""
    out = np.array(values, dtype=np.float64)
    out[gaps] = np.nan
    return out


def _view_path(run: Run, baseline: Geometry | None) -> tuple[PathView | None, str]:
    reference = None
    if "truth_x_m" in run.columns and "truth_y_m" in run.columns:
        reference = (run.columns["truth_x_m"], run.columns["truth_y_m"])
    pose = run.pose()
    if pose is not None:
        return PathView(*pose, "odometry", reference), ""
    wheelbase = None if baseline is None else baseline.wheelbase_m
    left, right = run.travel("left", baseline), run.travel("right", baseline)
    if wheelbase is None or left is None or right is None:
        return None, "No path: the run has no pose, and no baseline says how far apart the wheels are."
    return PathView(*integrate_path(left, right, wheelbase), "wheel travel", reference), ""


def integrate_path(
    left_m: FloatArray, right_m: FloatArray, wheelbase_m: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Midpoint odometry, equation (24) of the paper, from wheel travel.

    Parameters
    ----------
    left_m, right_m : shape (n,), travel at the rim since the start, m.

    Returns
    -------
    x, y (m) and theta (rad), each of shape (n,), starting at zero.
    """
    turn = np.diff(right_m - left_m, prepend=(right_m - left_m)[0]) / wheelbase_m
    ahead = 0.5 * np.diff(left_m + right_m, prepend=(left_m + right_m)[0])
    theta = np.cumsum(turn)
    middle = theta - 0.5 * turn
    return np.cumsum(ahead * np.cos(middle)), np.cumsum(ahead * np.sin(middle)), theta
