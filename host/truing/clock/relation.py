"""Two clocks related by round trips: offset, drift, and how well both are known."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from truing.arrays import FloatArray
from truing.errors import ClockError

# Enough for a spread to mean something.
FEWEST = 8
# The quickest of so many neighbours stands for them: the smallest delay has the smallest displacement
# (the clock filter of NTP, RFC 5905 section 10, takes the quickest of eight).
_NEIGHBOURS = 8
# A reading this many robust standard deviations (1.4826 times the median deviation) off the line is none.
_OUTLIER = 8.0
_CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class RoundTrip:
    """Asked at `sent_s`, answered at `received_s` by the host's clock; the device read `device_s` between."""

    sent_s: float
    received_s: float
    device_s: float


@dataclass(frozen=True, slots=True)
class ClockRelation:
    """Device time as a straight line over the host's.

    `device_s = host_s + offset_s` in the middle of the measurement, and from there on the device gains
    `drift_ppm` microseconds a second.

    Attributes
    ----------
    host_s : the middle of the measurement on the host's clock, whose origin is arbitrary.
    offset_s, offset_bounds_s : device minus host then. The bounds hold whatever the two directions took: the
        device read its clock after the request was sent and before the answer was there.
    drift_ppm, drift_ci95_ppm : against the host's clock, whose own error counts in.
    drift_bounds_ppm : as the offset's.
    span_s : from the first round trip to the last.
    round_trips, used : answered, and taken for the regression.
    shortest_s : the quickest round trip.
    scatter_s : standard deviation of the used ones about the line.
    """

    host_s: float
    offset_s: float
    offset_bounds_s: tuple[float, float]
    drift_ppm: float
    drift_ci95_ppm: tuple[float, float]
    drift_bounds_ppm: tuple[float, float]
    span_s: float
    round_trips: int
    used: int
    shortest_s: float
    scatter_s: float

    def device_at(self, host_s: float) -> float:
        """Device time, s, at a moment of the host's clock."""
        passed = host_s - self.host_s
        return host_s + self.offset_s + self.drift_ppm * 1e-6 * passed

    def host_at(self, device_s: float) -> float:
        """The host's time, s, at a moment of the device's clock."""
        passed = device_s - self.host_s - self.offset_s
        return self.host_s + passed / (1.0 + self.drift_ppm * 1e-6)

    def uncertainty_s(self, host_s: float) -> float:
        """How far `device_at` may be off at 95 %, s: the offset's bound, and the drift's interval since."""
        low, high = self.offset_bounds_s
        offset = max(high - self.offset_s, self.offset_s - low)
        low, high = self.drift_ci95_ppm
        drift = max(high - self.drift_ppm, self.drift_ppm - low)
        return offset + drift * 1e-6 * abs(host_s - self.host_s)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self) | {"uncertainty_s": self.uncertainty_s(self.host_s)}


def relate(trips: Sequence[RoundTrip], resolution_s: float = 1e-6) -> ClockRelation:
    """The line through round trips, in the order in which they were made.

    The offset's error is what nobody can see from one end: how a round trip's time is shared between there
    and back. It is bounded by cause and effect alone, over all round trips at once.

    The drift comes from a regression over the middles of those that were quicker than their neighbours: a
    constant difference between there and back does not matter to it, one that grows with the time taken is
    estimated, any other is its scatter. Its interval is Student's, cut where cause and effect forbid it.

    Parameters
    ----------
    resolution_s : step of the device's clock, which is rounded down.

    Raises
    ------
    ClockError : too few round trips, or no straight line fits between them all.
    """
    if len(trips) < FEWEST:
        raise ClockError(f"{len(trips)} round trips are too few to relate two clocks", f"{FEWEST} are needed")
    sent = np.array([trip.sent_s for trip in trips])
    received = np.array([trip.received_s for trip in trips])
    device = np.array([trip.device_s for trip in trips])
    host_s = float(sent[0] + received[-1]) / 2
    # Everything in microseconds from the middle, so that the drift is in ppm and no digit is lost.
    base_s = float(device[0] - sent[0])
    x_sent, x_received = sent - host_s, received - host_s
    # device - base = x + (offset + drift x), so these are bounds of the bracket at the two times.
    upper = ((device - host_s - base_s) - x_sent + resolution_s) * 1e6
    lower = ((device - host_s - base_s) - x_received) * 1e6
    middle_x = (x_sent + x_received) / 2
    middle_y = (upper + lower) / 2
    took = received - sent
    chosen = _quickest(took)
    delay_us = (took - np.min(took)) * 1e6
    offset, drift, half, scatter = _regression(
        middle_x[chosen], middle_y[chosen], delay_us[chosen], resolution_s * 1e6
    )
    offset_bounds, drift_bounds = _bounds(x_sent, upper, x_received, lower)
    drift = min(max(drift, drift_bounds[0]), drift_bounds[1])
    interval = (max(drift - half, drift_bounds[0]), min(drift + half, drift_bounds[1]))
    offset = min(max(offset, offset_bounds[0]), offset_bounds[1])
    return ClockRelation(
        host_s=host_s,
        offset_s=base_s + offset * 1e-6,
        offset_bounds_s=(base_s + offset_bounds[0] * 1e-6, base_s + offset_bounds[1] * 1e-6),
        drift_ppm=drift,
        drift_ci95_ppm=interval,
        drift_bounds_ppm=drift_bounds,
        span_s=float(received[-1] - sent[0]),
        round_trips=len(trips),
        used=len(chosen),
        shortest_s=float(np.min(took)),
        scatter_s=scatter * 1e-6,
    )


def _quickest(took: FloatArray) -> npt.NDArray[np.intp]:
    """Of each group of neighbours the quickest; all of them where there are too few to choose from."""
    groups = len(took) // _NEIGHBOURS
    if groups < FEWEST:
        return np.arange(len(took))
    edges = np.linspace(0, len(took), groups + 1).round().astype(int)
    return np.array([low + int(np.argmin(took[low:high])) for low, high in itertools.pairwise(edges)])


def _regression(
    x_s: FloatArray, y_us: FloatArray, delay_us: FloatArray, step_us: float
) -> tuple[float, float, float, float]:
    """Value at x = 0, slope, half of its 95 % interval, and the residuals' standard deviation.

    `delay_us` is what each took longer than the quickest of all. Where delays fall on one direction more than
    on the other (an adapter that collects bytes, a frame on the bus that grows with what it carries), they
    displace the middle by a share of themselves, which is a third unknown. A message that waited for a frame
    one way can be as quick as others and 0.1 ms off: what lies so far from the line is left out.
    """
    from scipy.stats import t

    columns = [np.ones_like(x_s), x_s]
    if np.ptp(delay_us) > 0.1:
        columns.append(delay_us)
    matrix = np.column_stack(columns)
    first = np.abs(y_us - matrix @ (np.linalg.pinv(matrix) @ y_us))
    kept = first <= max(_OUTLIER * 1.4826 * float(np.median(first)), step_us)
    matrix, y_us = matrix[kept], y_us[kept]
    inverse = np.linalg.pinv(matrix)
    solution = inverse @ y_us
    residual = y_us - matrix @ solution
    freedom = len(y_us) - matrix.shape[1]
    # Readings that happen to agree are still rounded.
    scatter = max(math.sqrt(float(residual @ residual) / freedom), step_us / math.sqrt(12))
    half = float(t.ppf((1 + _CONFIDENCE) / 2, freedom)) * scatter * float(np.linalg.norm(inverse[1]))
    return float(solution[0]), float(solution[1]), half, scatter


def _bounds(
    x_sent: FloatArray, upper: FloatArray, x_received: FloatArray, lower: FloatArray
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Of all lines below `upper` and above `lower` the extremes of their value at 0, and of their slope.

    A line a + s x lies between them where s (x_i - y_j) <= upper_i - lower_j for every pair of limits, which
    bounds s. At each such s the value a is free between the highest lower and the lowest upper limit, both of
    them piecewise linear in s, so that their extremes are at a corner or at an end of the range of s. Of all
    limits the corners of their convex hulls alone matter.
    """
    roof_x, roof = _hull(x_sent, upper)
    floor_x, floor = _hull(x_received, -lower)
    floor = -floor
    run = roof_x[:, None] - floor_x
    rise = roof[:, None] - floor
    low = float(np.max((rise[run < 0.0] / run[run < 0.0]), initial=-math.inf))
    high = float(np.min((rise[run > 0.0] / run[run > 0.0]), initial=math.inf))
    if low > high or np.any(rise[run == 0.0] < 0.0):
        raise ClockError(
            "no straight line relates the two clocks over these round trips: one of them jumped",
            "measure again, while the board is neither restarted nor saving parameters",
        )
    slopes = np.concatenate([[low, high], _slopes(roof_x, roof), _slopes(floor_x, floor)]).clip(low, high)
    lowest = np.max(floor - slopes[:, None] * floor_x, axis=1)
    highest = np.min(roof - slopes[:, None] * roof_x, axis=1)
    return (float(np.min(lowest)), float(np.max(highest))), (low, high)


def _hull(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Corners of the lower convex hull of points (Andrew's monotone chain), from left to right."""
    corners: list[tuple[float, float]] = []
    order = np.lexsort((y, x))
    for here_x, here_y in zip(x[order].tolist(), y[order].tolist(), strict=True):
        if corners and corners[-1][0] == here_x:
            continue  # straight above the one before
        while len(corners) > 1:
            (first_x, first_y), (last_x, last_y) = corners[-2:]
            if (last_x - first_x) * (here_y - first_y) > (last_y - first_y) * (here_x - first_x):
                break
            corners.pop()
        corners.append((here_x, here_y))
    hull = np.array(corners)
    return hull[:, 0], hull[:, 1]


def _slopes(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.asarray(np.diff(y) / np.diff(x))
