"""First-order wheel model fitted by free-run simulation: v' = (gain u - v) / time constant.

The simulation sees the efforts and each run's first speed, never the measured speeds after it.
Between rows the solution is exact (the effort is constant there), and what is compared with the
recording is the mean speed over each interval, because that is what a log holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.identify.quantity import Quantity
from truing.identify.uncertainty import half_widths
from truing.recording.run import Geometry, Run, Wheel

# Starting time constants per decade; every local minimum of this scan is a start.
SCAN_PER_DECADE = 8
# A time constant whose 95 % interval reaches further than this factor either way is not known.
LARGEST_TIME_FACTOR = 4.0
# The slopes of a first-order response are smooth on this share of its time constant.
BLOCKS_PER_TIME_CONSTANT = 5
# The largest effort must reach this for a gain to mean anything.
MIN_EFFORT = 0.005


@dataclass(frozen=True, slots=True)
class FirstOrderFit:
    """A fitted wheel.

    Attributes
    ----------
    gain : steady speed per unit effort, m/s.
    time_constant : s.
    rms_mps : free-run error over the fitted runs, m/s, equal weight per run.
    rms_percent : the same in per cent of `scale_mps`, the 98th percentile of |speed| over the set.
    run_percent : free-run error of each run, per cent.
    """

    wheel: Wheel
    label: str
    runs: tuple[str, ...]
    gain: Quantity
    time_constant: Quantity
    rms_mps: float | None = None
    rms_percent: float | None = None
    run_percent: tuple[float, ...] = ()
    scale_mps: float = 0.0
    notes: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "wheel": self.wheel,
            "label": self.label,
            "runs": list(self.runs),
            "gain_mps": self.gain.to_json(),
            "time_constant_s": self.time_constant.to_json(),
            "free_run_rmse_mps": self.rms_mps,
            "free_run_rmse_percent": self.rms_percent,
            "free_run_rmse_percent_by_run": list(self.run_percent),
            "p98_speed_mps": self.scale_mps,
            "notes": list(self.notes),
        }


class WheelData:
    """Efforts and speeds of one wheel over several runs, laid end to end.

    A run begins a new stretch, and so does every gap: what drove the wheel inside a gap is
    unknown, so the simulation starts afresh from the measured speed behind it.

    Attributes
    ----------
    effort, speed, interval : shape (n,), effort fraction, m/s, s.
    start : shape (n,), true where a stretch begins; those rows are given, not judged.
    weight : shape (n,), square root of the weight of each row; zero where it is not judged.
    run_of : shape (n,), number of the run that each row belongs to.
    """

    def __init__(self, runs: Sequence[Run], wheel: Wheel, baseline: Geometry | None) -> None:
        efforts, speeds, intervals, starts, weights, numbers = [], [], [], [], [], []
        for number, run in enumerate(runs):
            measured = run.speed(wheel, baseline)
            interval = np.diff(run.t_s, prepend=run.t_s[0])
            start = np.zeros(len(run), dtype=bool)
            start[0] = True
            start[run.gaps()] = True
            if measured.source != "vel":
                # A differenced speed behind a gap is the mean over the gap: the next one begins the stretch.
                start[np.minimum(run.gaps() + 1, len(run) - 1)] = True
            judged = ~start & (interval > 0.0)
            efforts.append(run.effort(wheel))
            speeds.append(measured.values)
            intervals.append(interval)
            starts.append(start)
            weights.append(np.where(judged, 1.0 / np.sqrt(max(int(judged.sum()), 1)), 0.0))
            numbers.append(np.full(len(run), number))
        self.effort = np.concatenate(efforts)
        self.speed = np.concatenate(speeds)
        self.interval = np.concatenate(intervals)
        self.start = np.concatenate(starts)
        self.weight = np.concatenate(weights)
        self.run_of = np.concatenate(numbers)
        self.run_count = len(runs)
        self.instant = all(run.instant and run.speed(wheel, baseline).source == "vel" for run in runs)

    def simulate(self, gain_mps: float, time_constant_s: float) -> FloatArray:
        """Free-run mean speed over each row's interval, or speed at its time, shape (n,), m/s."""
        driven, released = self._responses(time_constant_s)
        return gain_mps * driven + released

    def best_gain(self, time_constant_s: float) -> tuple[float, float]:
        """The gain that fits best at a given time constant (it enters linearly), and the cost."""
        driven, released = self._responses(time_constant_s)
        wanted = self.weight * (self.speed - released)
        basis = self.weight * driven
        energy = float(basis @ basis)
        gain = float(basis @ wanted) / energy if energy > 0.0 else 0.0
        rest = wanted - gain * basis
        return gain, float(rest @ rest)

    def residual(self, gain_mps: float, time_constant_s: float) -> FloatArray:
        """Simulated minus measured, shape (n,), m/s, zero where a row is not judged."""
        error = self.simulate(gain_mps, time_constant_s) - self.speed
        return np.where(self.weight > 0.0, error, 0.0)

    def run_rms(self, residual: FloatArray) -> FloatArray:
        """Root mean square of a residual per run, shape (run_count,), m/s."""
        weighted = (self.weight * residual) ** 2
        return np.sqrt(np.bincount(self.run_of, weighted, minlength=self.run_count))

    def _responses(self, time_constant_s: float) -> tuple[FloatArray, FloatArray]:
        """Speed per unit gain, and speed left from the stretch's first row, as rows hold it, shapes (n,)."""
        x = self.interval / time_constant_s
        keep = np.where(self.start, 0.0, np.exp(-x))
        driven = np.where(self.start, 0.0, -np.expm1(-x) * self.effort)
        released = np.where(self.start, self.speed, 0.0)
        driven_end, released_end = _recursion(keep, np.stack([driven, released]))
        if self.instant:
            return driven_end, released_end
        # Mean of an exponential over the interval, per unit of its value at the start.
        mean = np.where(x > 1e-9, -np.expm1(-x) / np.maximum(x, 1e-9), 1.0)
        driven_begin = np.concatenate(([0.0], driven_end[:-1]))
        released_begin = np.concatenate(([0.0], released_end[:-1]))
        driven = self.effort + (driven_begin - self.effort) * mean
        return np.where(self.start, 0.0, driven), np.where(self.start, self.speed, released_begin * mean)


def _recursion(keep: FloatArray, add: FloatArray) -> FloatArray:
    """y[k] = keep[k] y[k-1] + add[k] for each row of `add`, shape (m, n), in log2(n) vector steps.

    Composing neighbouring affine maps pairwise costs more arithmetic than a loop, but none of it
    in Python; 0 <= keep <= 1 keeps it stable.
    """
    keep, value = keep.copy(), add.copy()
    shift = 1
    while shift < keep.size and keep.any():
        value[:, shift:] += keep[shift:] * value[:, :-shift]
        keep[shift:] *= keep[:-shift]
        keep[:shift] = 0.0
        # Below this nothing of the past is left in a double.
        keep[keep < 1e-20] = 0.0
        shift *= 2
    return value


def fit_first_order(
    runs: Sequence[Run],
    wheel: Wheel,
    baseline: Geometry | None = None,
    *,
    label: str = "all runs",
    scale_mps: float | None = None,
) -> FirstOrderFit:
    """Fit gain and time constant of one wheel to several runs at once, equal weight per run.

    Parameters
    ----------
    scale_mps : what per cents refer to; by default the 98th percentile of |speed| over `runs`.
    """
    data = WheelData(runs, wheel, baseline)
    names = tuple(run.name for run in runs)
    scale = scale_mps if scale_mps is not None else float(np.percentile(np.abs(data.speed), 98))

    def unknown(reason: str) -> FirstOrderFit:
        no_gain, no_time = Quantity.unknown("m/s", reason), Quantity.unknown("s", reason)
        return FirstOrderFit(wheel, label, names, no_gain, no_time, scale_mps=scale)

    if float(np.abs(data.effort).max()) < MIN_EFFORT:
        return unknown("the wheel is never driven")
    if not (data.speed != 0.0).any():
        return unknown("the wheel never moves, as far as its encoder says")

    found = _search(data)
    if found is None:
        return unknown("the runs do not tell: no time constant fits better than its neighbours")
    gain, time_constant = found
    residual = data.residual(gain, time_constant)
    run_rms = data.run_rms(residual)
    rms = float(np.sqrt(np.mean(run_rms**2)))
    gain_ci, time_ci = _intervals(data, gain, time_constant, residual)
    found_gain = Quantity(gain, "m/s", gain_ci)
    found_time = Quantity(time_constant, "s", time_ci)
    if gain_ci[0] <= 0.0 <= gain_ci[1]:
        found_gain = Quantity.unknown("m/s", "not pinned down: its 95 % interval holds zero")
    if time_ci[1] > LARGEST_TIME_FACTOR**2 * time_ci[0]:
        low, high = (float(f"{bound:.2g}") for bound in time_ci)
        reason = f"not pinned down: anything from {low:g} to {high:g} s fits"
        found_time = Quantity.unknown("s", reason)
    return FirstOrderFit(
        wheel=wheel,
        label=label,
        runs=names,
        gain=found_gain,
        time_constant=found_time,
        rms_mps=rms,
        rms_percent=100.0 * rms / scale,
        run_percent=tuple((100.0 * run_rms / scale).tolist()),
        scale_mps=scale,
    )


def _search(data: WheelData) -> tuple[float, float] | None:
    """Gain and time constant of the lowest cost: a scan, then least squares from each local minimum."""
    from scipy.optimize import least_squares

    judged = data.interval[data.weight > 0.0]
    shortest = 0.1 * float(np.median(judged))
    longest = 2.0 * float(np.bincount(data.run_of, data.interval).max())
    count = max(int(SCAN_PER_DECADE * np.log10(longest / shortest)), 8)
    grid = np.geomspace(shortest, longest, count)
    scan = [data.best_gain(float(value)) for value in grid]
    costs = np.array([cost for _, cost in scan])
    inner = np.arange(1, count - 1)
    minima = inner[(costs[inner] <= costs[inner - 1]) & (costs[inner] <= costs[inner + 1])]
    if minima.size == 0:
        return None

    def weighted(point: FloatArray) -> FloatArray:
        residual: FloatArray = data.weight * data.residual(float(point[0]), float(np.exp(point[1])))
        return residual

    best: tuple[float, float, float] | None = None
    for k in minima:
        gain = scan[k][0]
        if gain == 0.0:
            continue
        result = least_squares(
            weighted, [gain, np.log(grid[k])], x_scale=[abs(gain), 0.3], jac="3-point", xtol=1e-10, ftol=1e-12
        )
        if best is None or result.cost < best[0]:
            best = (float(result.cost), float(result.x[0]), float(np.exp(result.x[1])))
    if best is None or best[0] > 0.5 * min(costs[0], costs[-1]):
        return None
    return best[1], best[2]


def _intervals(
    data: WheelData, gain: float, time_constant: float, residual: FloatArray
) -> tuple[tuple[float, float], tuple[float, float]]:
    """95 % intervals of gain (m/s) and time constant (s); the latter is symmetric in its logarithm."""
    step = 1e-4
    slope_gain = data.simulate(gain, time_constant) - data.simulate(0.0, time_constant)
    slope_log = (
        data.simulate(gain, time_constant * np.exp(step)) - data.simulate(gain, time_constant * np.exp(-step))
    ) / (2.0 * step)
    jacobian = np.stack((slope_gain / gain, slope_log), axis=1)
    interval = float(np.median(data.interval[data.weight > 0.0]))
    block = max(int(time_constant / BLOCKS_PER_TIME_CONSTANT / interval), 1)
    half_gain, half_log = half_widths(jacobian, residual, data.weight, data.run_of, block).tolist()
    factor = float(np.exp(min(half_log, 50.0)))
    return (gain - half_gain, gain + half_gain), (time_constant / factor, time_constant * factor)
