"""The transition into a level: when it crosses its marks, how far it overshoots, with 95 % intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truing.arrays import FloatArray
from truing.identify.identifiable import LARGEST_RATIO
from truing.identify.levels import STEADY_SHARE, Level
from truing.identify.quantity import Quantity
from truing.identify.step_noise import WindowNoise
from truing.recording.run import Run, WheelSpeed

# A first-order wheel has gone these shares of its way after one time constant, and after a third of one.
ONE_TIME_CONSTANT = 1.0 - math.exp(-1.0)
ONE_THIRD = 1.0 - math.exp(-1.0 / 3.0)
# The speed before a step is the mean over this long before it.
BEFORE_S = 0.1
PERCENT = "% of the step"
# The normal deviate that 2.5 % exceed.
TWO_SIDED = 1.96


def rows_inside(t_s: FloatArray, start_s: float, end_s: float) -> NDArray[np.intp]:
    """Rows whose whole interval lies between two times (to a thousandth of an interval)."""
    tolerance = 1e-3 * float(np.median(np.diff(t_s)))
    begin = np.concatenate((t_s[:1], t_s[:-1]))
    return np.flatnonzero((begin >= start_s - tolerance) & (t_s <= end_s + tolerance) & (t_s > begin))


def rows_before(t_s: FloatArray, level: Level) -> NDArray[np.intp]:
    """Rows just before a step; the last one before it where none fits."""
    rows = rows_inside(t_s, level.start_s - BEFORE_S, level.start_s)
    return rows if rows.size else np.flatnonzero(t_s <= level.start_s)[-1:]


def ripple_of(noise: WindowNoise | None, resolution_mps: float) -> Quantity:
    """The steady speed's standard deviation about a line, mm/s."""
    if noise is None:
        return Quantity.unknown("mm/s", "the steady window has too few rows")
    # Equal counts over rounded times leave a spread of rounding errors.
    if noise.spread <= 1e-6 * resolution_mps:
        return Quantity(0.0, "mm/s", (0.0, 1000.0 * 0.5 * resolution_mps))
    low, high = noise.spread_interval()
    return Quantity(1000.0 * noise.spread, "mm/s", (1000.0 * low, 1000.0 * high))


@dataclass(frozen=True, slots=True)
class _Crossing:
    """When the response reached a share of its way, s after the step.

    Attributes
    ----------
    last_s : when it did so for the last time; noise makes a slow response cross its mark several times.
    deviation_mps : standard deviation of the response against its mark.
    """

    share: float
    first_s: float
    last_s: float
    deviation_mps: float


@dataclass(frozen=True, slots=True)
class Response:
    """One transition.

    Attributes
    ----------
    times_s : shape (n,), middles of the rows' intervals after the step, the step itself first.
    gone : shape (n,), share of the way, zero first.
    change_mps : the way.
    sign : of the motion, so that above and below mean faster and slower.
    noise : while the speed changes: the larger of the two levels'; None where neither window told.
    drift_mps : second half of the steady window less its first.
    steady_deviation, before_deviation : standard deviations of the two ends of the way, m/s.
    """

    times_s: FloatArray
    gone: FloatArray
    change_mps: float
    sign: float
    interval_s: float
    resolution_mps: float
    noise: WindowNoise | None
    steady_deviation: float
    before_deviation: float
    drift_mps: float

    @classmethod
    def of(
        cls,
        run: Run,
        speed: WheelSpeed,
        level: Level,
        steady_mps: float,
        change_mps: float,
        noise: WindowNoise | None,
        noise_before: WindowNoise | None,
        drift_mps: float = 0.0,
    ) -> Response:
        """The transition into `level`."""
        t_s = run.t_s
        rows = rows_inside(t_s, level.start_s, level.end_s)
        before_rows = rows_before(t_s, level)
        before = steady_mps - change_mps
        # A mean over an interval stands for the speed at its middle.
        at_s = t_s[rows] if run.instant else 0.5 * (t_s[rows - 1] + t_s[rows])
        times = np.concatenate(([0.0], at_s - level.start_s))
        gone = np.concatenate(([0.0], (speed.values[rows] - before) / change_mps))
        known = [item for item in (noise, noise_before) if item is not None]
        # A wheel that comes to rest has no noise there, but had it on the way.
        loud = max(known, key=lambda item: item.sigma, default=None)
        larger = steady_mps if abs(steady_mps) >= abs(before) else before
        return cls(
            times,
            gone,
            change_mps,
            math.copysign(1.0, larger),
            float(t_s[rows[0]] - t_s[rows[0] - 1]) if rows.size else run.interval_s,
            speed.resolution,
            loud,
            0.0 if noise is None else noise.mean_deviation,
            0.0 if noise_before is None else noise_before.deviation_of(len(before_rows)),
            drift_mps,
        )

    def times(self) -> tuple[Quantity, Quantity]:
        """Time constant and dead time, s.

        The time constant is the first crossing of 63.2 %. A first-order response after a dead time has gone
        28.3 % after the dead time and a third of a time constant, so that the dead time is 1.5 times that
        crossing less half the other (Smith's two points).
        """
        one = self._crossing(ONE_TIME_CONSTANT)
        if isinstance(one, str):
            return Quantity.unknown("s", one), Quantity.unknown("s", one)
        low, high = self._margins(one, one.first_s)
        time_constant = self._with_interval(one.first_s, low, high)
        if time_constant.ci95 is not None and time_constant.ci95[1] > LARGEST_RATIO * time_constant.ci95[0]:
            reason = (
                f"not pinned down: {one.first_s:.2g} s, anything up to {time_constant.ci95[1]:.2g} s fits"
            )
            return Quantity.unknown("s", reason), Quantity.unknown("s", reason)
        third = self._crossing(ONE_THIRD)
        if isinstance(third, str):
            return time_constant, Quantity.unknown("s", third)
        dead = 1.5 * third.first_s - 0.5 * one.first_s
        early, late = self._margins(third, one.first_s)
        down = math.hypot(1.5 * early, 0.5 * high)
        up = math.hypot(1.5 * late, 0.5 * low)
        return time_constant, self._with_interval(max(dead, 0.0), down + min(dead, 0.0), up + min(dead, 0.0))

    def _crossing(self, share: float) -> _Crossing | str:
        above = self.gone >= share
        crossed = np.flatnonzero(above)
        if crossed.size == 0:
            return f"the speed never reaches {100 * share:.1f} % of its way"
        k = int(crossed[0])
        if k <= 1:
            return f"shorter than the log can show (one row is {self.interval_s:.3g} s)"
        ups = np.flatnonzero(~above[:-1] & above[1:]) + 1
        part = (share - float(self.gone[k - 1])) / float(self.gone[k] - self.gone[k - 1])
        between = 0.0 if self.noise is None else self.noise.deviation_between(part)
        # Counts round a row's mean speed by up to half a count at either end of its interval.
        rounding = self.resolution_mps / math.sqrt(6.0) * math.hypot(1.0 - part, part)
        # The mark moves with both ends of the way.
        mark = math.hypot(share * self.steady_deviation, (1.0 - share) * self.before_deviation)
        return _Crossing(
            share,
            self._time_of(share, k),
            self._time_of(share, int(ups[-1])),
            math.hypot(max(between, rounding), mark),
        )

    def _time_of(self, share: float, k: int) -> float:
        part = (share - float(self.gone[k - 1])) / float(self.gone[k] - self.gone[k - 1])
        return float(self.times_s[k - 1] + part * (self.times_s[k] - self.times_s[k - 1]))

    def _margins(self, crossing: _Crossing, tau_s: float) -> tuple[float, float]:
        """How far before and after its first crossing a mark may have been reached, s.

        The slope is that of a first-order response of `tau_s`: the one between two noisy rows is steep
        just where noise made the speed cross early.
        """
        share = crossing.share
        slope_mps2 = (1.0 - share) * abs(self.change_mps) / tau_s
        quantile = TWO_SIDED if self.noise is None else self.noise.quantile
        half = quantile * crossing.deviation_mps / slope_mps2
        step = self.interval_s
        # A chord between two rows lies inside the curve, and a row's mean a little inside too.
        chord = step * step / (6.0 * max(tau_s, step))
        # What had not settled in the window where the end of the way was read.
        end = float(self.times_s[-1])
        window = STEADY_SHARE * end
        rest = tau_s / window * (math.exp(-(end - window) / tau_s) - math.exp(-end / tau_s))
        unsettled = tau_s * share * rest / (1.0 - share)
        return half + chord, half + chord + unsettled + crossing.last_s - crossing.first_s

    def _with_interval(self, value: float, down: float, up: float) -> Quantity:
        """A time and its interval, s; no time is below zero."""
        if self.noise is None:
            return Quantity(value, "s", None)
        return Quantity(value, "s", (max(value - down, 0.0), max(value + up, 0.0)))

    def excursions(self) -> tuple[Quantity, Quantity]:
        """Overshoot and undershoot, per cent of the change of speed."""
        beyond = self.sign * math.copysign(1.0, self.change_mps) * (self.gone - 1.0)
        arrived = np.flatnonzero(self.gone >= 1.0)
        if arrived.size == 0:
            reason = "the speed never reaches its steady value"
            return Quantity.unknown(PERCENT, reason), Quantity.unknown(PERCENT, reason)
        # A speed that still creeps passes its own mean without an overshoot.
        creep = self.sign * self._told_drift() / abs(self.change_mps)
        after = beyond[arrived[0] :]
        speeding = self.sign * self.change_mps > 0.0
        above, below = after - max(creep, 0.0), -after - max(-creep, 0.0)
        first, second = (above, below) if speeding else (below, above)
        # The undershoot counts from the first peak on; before it the response is still on its way.
        first_excursion = self._excursion(first)
        back = self._excursion(second[int(first.argmax()) :])
        return (first_excursion, back) if speeding else (back, first_excursion)

    def _told_drift(self) -> float:
        """How far the speed still moved in the steady window, m/s; zero where noise could do it alone."""
        if self.noise is None or abs(self.drift_mps) <= 2.0 * self.noise.quantile * self.steady_deviation:
            return 0.0
        return self.drift_mps

    def _excursion(self, beyond: FloatArray) -> Quantity:
        peak = max(float(beyond.max()), 0.0)
        way = abs(self.change_mps)
        if self.noise is None:
            return Quantity(100.0 * peak, PERCENT)
        sigma = max(self.noise.sigma, self.resolution_mps / math.sqrt(6.0))
        chance = (
            max(self.noise.largest_of(len(beyond)), TWO_SIDED * self.resolution_mps / math.sqrt(6.0)) / way
        )
        margin = self.noise.quantile * math.hypot(sigma, self.steady_deviation) / way
        high = peak + margin
        if peak <= chance:
            return Quantity(0.0, PERCENT, (0.0, 100.0 * high))
        return Quantity(100.0 * peak, PERCENT, (100.0 * max(peak - max(chance, margin), 0.0), 100.0 * high))
