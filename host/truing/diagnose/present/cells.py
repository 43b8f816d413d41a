"""Where a residual stands out from its noise: cells of time, and bins of what the robot was doing.

A cell of time is judged by its energy (chi-squared, the residual whitened first), a bin of speed, effort,
angle, heading or time by its mean. What stands out is chosen over all cells together, and over all bins, at
one false-discovery rate (Benjamini & Hochberg 1995). Bins are of the *simulated* speed: the measured one
holds the disturbance that is judged, and would condemn a model that is right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from truing.arrays import BoolArray, FloatArray
from truing.diagnose.data.traces import RunTraces
from truing.diagnose.distributions import chi2_tail, normal_tail
from truing.diagnose.result import Diagnosis
from truing.recording.run import WHEELS, Wheel

FALSE_DISCOVERY_RATE = 0.05
MAX_COLUMNS = 48
MIN_CELL_S = 0.25
MIN_ROWS = 4
BINS = 12
# A bin below this many times the noise is not marked, even if significant.
MIN_TIMES_NOISE = 0.3


@dataclass(frozen=True, slots=True)
class TimeCells:
    """Residual energy by run and time for one wheel.

    Attributes
    ----------
    edges_s : shape (columns + 1,), s.
    times_noise : shape (runs, columns), RMS over the noise's; NaN where a run has no rows.
    p_values, stands_out : the same shape.
    """

    wheel: Wheel
    runs: tuple[str, ...]
    edges_s: FloatArray
    times_noise: FloatArray
    p_values: FloatArray
    stands_out: BoolArray


@dataclass(frozen=True, slots=True)
class Bins:
    """Mean residual of one wheel against one quantity.

    Attributes
    ----------
    centres, mean, error : shape (bins,); mean and its standard error in m/s, NaN where there are no rows.
    p_values, stands_out : the same shape.
    """

    wheel: Wheel
    quantity: str
    unit: str
    centres: FloatArray
    mean: FloatArray
    error: FloatArray
    p_values: FloatArray
    stands_out: BoolArray


@dataclass(frozen=True, slots=True)
class Located:
    """All cells and bins, and how many of them are significant."""

    cells: tuple[TimeCells, ...]
    bins: tuple[Bins, ...]

    @property
    def tested(self) -> int:
        """Number of cells and bins tested."""
        return sum(int(np.isfinite(p_values).sum()) for p_values in self._p_values())

    @property
    def found(self) -> int:
        """Number of significant ones."""
        marks = [part.stands_out for part in self.cells] + [part.stands_out for part in self.bins]
        return sum(int(mark.sum()) for mark in marks)

    def _p_values(self) -> list[FloatArray]:
        return [part.p_values for part in self.cells] + [part.p_values for part in self.bins]


def locate(diagnosis: Diagnosis, *, after: bool = False) -> Located:
    """Test the residual of the refitted baseline, or (`after`) of the model with the named effects."""
    traces = [trace for trace in diagnosis.traces if len(trace.t_s)]
    if not traces:
        return Located((), ())
    noise = {entry.signal: entry.correlation_s for entry in diagnosis.noise}
    memory = [noise.get(f"vel_{wheel}_mps", 0.0) for wheel in WHEELS]
    residuals = [trace.measured - (trace.model if after else trace.refit) for trace in traces]
    cells = [_time_cells(traces, residuals, column, memory[column]) for column in range(2)]
    bins = [
        made
        for quantity, unit, values in _quantities(traces)
        for column in range(2)
        if (made := _bins(traces, residuals, values, column, memory[column], quantity, unit)) is not None
    ]
    return _chosen(cells, bins)


def benjamini_hochberg(p_values: FloatArray, rate: float = FALSE_DISCOVERY_RATE) -> BoolArray:
    """Which p-values are significant at the false discovery rate `rate`, shape (n,); NaN is left out."""
    out = np.zeros(p_values.shape, dtype=np.bool_)
    tested = np.flatnonzero(np.isfinite(p_values))
    if tested.size == 0:
        return out
    order = tested[np.argsort(p_values[tested])]
    allowed = rate * np.arange(1, order.size + 1) / order.size
    below = np.flatnonzero(p_values[order] <= allowed)
    if below.size:
        out[order[: below[-1] + 1]] = True
    return out


def _chosen(cells: Sequence[TimeCells], bins: Sequence[Bins]) -> Located:
    cell_marks = _marked([part.p_values for part in cells])
    bin_marks = _marked([part.p_values for part in bins])
    return Located(
        tuple(
            replace(part, stands_out=mark & (np.nan_to_num(part.times_noise) > 1.0))
            for part, mark in zip(cells, cell_marks, strict=True)
        ),
        tuple(replace(part, stands_out=mark) for part, mark in zip(bins, bin_marks, strict=True)),
    )


def _marked(tables: Sequence[FloatArray]) -> list[BoolArray]:
    """Significant entries of tables that are tested together."""
    if not tables:
        return []
    marks = benjamini_hochberg(np.concatenate([table.ravel() for table in tables]))
    ends = np.cumsum([table.size for table in tables])[:-1]
    parts = np.split(marks, ends)
    return [part.reshape(table.shape) for part, table in zip(parts, tables, strict=True)]


def _whitened(trace: RunTraces, residual: FloatArray, column: int, memory_s: float) -> FloatArray:
    """Innovations of a first-order noise with this memory, in standard deviations, shape (n,)."""
    valid = trace.valid[:, column]
    scaled = np.where(valid, residual[:, column] / trace.noise_sd[:, column], np.nan)
    step = float(np.median(trace.interval_s))
    # The autocorrelation rho^k sums to memory over step.
    rho = max(1.0 - step / memory_s, 0.0) if memory_s > step else 0.0
    out = scaled.copy()
    out[1:] = np.where(
        np.isfinite(scaled[:-1]), (scaled[1:] - rho * scaled[:-1]) / math.sqrt(1.0 - rho**2), scaled[1:]
    )
    return np.asarray(out)


def _time_cells(
    traces: Sequence[RunTraces], residuals: Sequence[FloatArray], column: int, memory_s: float
) -> TimeCells:
    longest = max(float(trace.t_s[-1] - trace.t_s[0]) for trace in traces)
    interval = float(np.median([np.median(trace.interval_s) for trace in traces]))
    width = max(MIN_CELL_S, MIN_ROWS * interval, longest / MAX_COLUMNS)
    count = max(math.ceil(longest / width), 1)
    times: FloatArray = np.full((len(traces), count), np.nan)
    p_values: FloatArray = np.full((len(traces), count), np.nan)
    for row, (trace, residual) in enumerate(zip(traces, residuals, strict=True)):
        white = _whitened(trace, residual, column, memory_s)
        plain = residual[:, column] / trace.noise_sd[:, column]
        where = np.minimum(((trace.t_s - trace.t_s[0]) / width).astype(int), count - 1)
        for cell in range(count):
            inside = (where == cell) & np.isfinite(white)
            if inside.sum() >= MIN_ROWS:
                times[row, cell] = math.sqrt(float(np.mean(plain[inside] ** 2)))
                p_values[row, cell] = chi2_tail(float((white[inside] ** 2).sum()), int(inside.sum()))
    names = tuple(trace.run for trace in traces)
    none = np.zeros(times.shape, dtype=np.bool_)
    return TimeCells(WHEELS[column], names, np.linspace(0.0, width * count, count + 1), times, p_values, none)


def _quantities(traces: Sequence[RunTraces]) -> list[tuple[str, str, list[FloatArray]]]:
    """What residuals are drawn against: name, unit, and per run values of shape (n, 2)."""

    def twice(values: FloatArray) -> FloatArray:
        return np.stack([values, values], axis=1)

    found = [
        ("simulated speed", "m/s", [trace.refit for trace in traces]),
        ("effort", "", [trace.effort for trace in traces]),
    ]
    if all(trace.wheel_angle is not None for trace in traces):
        angles = [np.mod(trace.wheel_angle, 2.0 * np.pi) for trace in traces if trace.wheel_angle is not None]
        found.append(("wheel angle", "rad", angles))
    if all(trace.heading is not None for trace in traces):
        turned = [trace.heading for trace in traces if trace.heading is not None]
        headings = [twice(np.mod(heading, 2.0 * np.pi)) for heading in turned]
        if max(float(np.ptp(heading)) for heading in headings) > 0.5:
            found.append(("heading", "rad", headings))
    elapsed = [twice(trace.start_s + trace.t_s - trace.t_s[0]) for trace in traces]
    found.append(("time since the first run", "s", elapsed))
    return found


def _bins(
    traces: Sequence[RunTraces],
    residuals: Sequence[FloatArray],
    values: Sequence[FloatArray],
    column: int,
    memory_s: float,
    quantity: str,
    unit: str,
) -> Bins | None:
    x = np.concatenate([value[:, column] for value in values])
    r = np.concatenate([residual[:, column] for residual in residuals])
    sd = np.concatenate([trace.noise_sd[:, column] for trace in traces])
    valid = np.concatenate([trace.valid[:, column] for trace in traces])
    interval = float(np.median([np.median(trace.interval_s) for trace in traces]))
    if not valid.any():
        return None
    low, high = float(x[valid].min()), float(x[valid].max())
    if high - low < 1e-6:
        return None
    edges = np.linspace(low, high, BINS + 1)
    where = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, BINS - 1)
    # Rows closer together than the noise's correlation time are not independent.
    share = min(interval / max(2.0 * memory_s - interval, interval), 1.0)
    mean, error, p_values = np.full((3, BINS), np.nan)
    for k in range(BINS):
        inside = (where == k) & valid
        if inside.sum() < MIN_ROWS:
            continue
        mean[k] = float(r[inside].mean())
        noise = float(np.sqrt(np.mean(sd[inside] ** 2)))
        error[k] = noise / math.sqrt(max(share * float(inside.sum()), 1.0))
        if abs(mean[k]) > MIN_TIMES_NOISE * noise:
            p_values[k] = 2.0 * normal_tail(abs(mean[k]) / error[k])
        else:
            p_values[k] = 1.0
    centres = 0.5 * (edges[1:] + edges[:-1])
    none = np.zeros(BINS, dtype=np.bool_)
    return Bins(WHEELS[column], quantity, unit, centres, mean, error, p_values, none)
