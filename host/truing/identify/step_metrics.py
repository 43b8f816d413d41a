"""Gain and time constant of each step of a run, as the paper's Tables III and IV count them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from truing.baseline import Baseline
from truing.identify.levels import STEADY_SHARE, InputKind, Level, find_levels
from truing.identify.quantity import Quantity
from truing.recording import FloatArray, Run, Wheel, WheelSpeed

Direction: TypeAlias = Literal["up", "down", "reversal", "none"]

# A first-order wheel has gone this share of its way after one time constant.
ONE_TIME_CONSTANT = 1.0 - np.exp(-1.0)
# The speed before a step is the mean over this long before it.
BEFORE_S = 0.1
# A step must stand out from the ripple by this factor to have a time constant.
STAND_OUT = 3.0
# Ripple above this share of the steady speed is worth a note.
LARGE_RIPPLE = 0.1
# A time constant of fewer rows than this hangs on the interpolation between them.
FEW_ROWS = 2.0
# A steady window whose halves differ by more than this share of the step had not settled.
SETTLED_SHARE = 0.02


@dataclass(frozen=True, slots=True)
class StepMetrics:
    """What one wheel did at one level of the input.

    Attributes
    ----------
    input, previous : effort fraction, or m/s in velocity mode.
    gain : mm/s per % of effort, or a ratio in velocity mode; unknown at zero input.
    time_constant : of the transition into this level, s.
    steady_mps : mean speed over the last 40 % of the level, None when the level is too short.
    notes : what a reader should know before using the numbers.
    """

    wheel: Wheel
    kind: InputKind
    number: int
    input: float
    previous: float
    start_s: float
    duration_s: float
    direction: Direction
    gain: Quantity
    time_constant: Quantity
    steady_mps: float | None
    notes: tuple[str, ...] = ()


def step_metrics(
    run: Run, wheel: Wheel, baseline: Baseline | None = None
) -> tuple[tuple[StepMetrics, ...], str | None]:
    """Metrics of every step of a wheel's input; or none, with the reason."""
    levels = find_levels(run, wheel)
    if levels.reason is not None:
        return (), levels.reason
    speed = run.speed(wheel, baseline)
    steps = [level for level in levels.levels if level.value != 0.0 or level.previous != 0.0]
    measured = (_measure(run, wheel, speed, level, number) for number, level in enumerate(steps, start=1))
    return tuple(measured), None


def _measure(run: Run, wheel: Wheel, speed: WheelSpeed, level: Level, number: int) -> StepMetrics:
    steady, ripple, drift, reason = _steady(run.t_s, speed.values, level)
    notes: list[str] = []
    if reason is not None:
        gain = Quantity.unknown(gain_unit(level.kind), reason)
        time_constant = Quantity.unknown("s", reason)
    else:
        gain = _gain(level, steady)
        time_constant, change = _time_constant(run.t_s, speed, level, steady, ripple)
        if abs(drift) > max(SETTLED_SHARE * abs(change), STAND_OUT * ripple) and change != 0.0:
            share = 100.0 * abs(drift / change)
            notes.append(f"not settled: the speed still moved by {share:.0f} % of the step")
        if time_constant.value is not None and time_constant.value < FEW_ROWS * run.interval_s:
            notes.append(f"coarse: a row of the log is {run.interval_s:.3g} s, more than half of τ")
        large = max(LARGE_RIPPLE * abs(steady), 2.0 * speed.resolution)
        if level.value != 0.0 and ripple > large:
            notes.append(f"the steady speed of {steady:.3g} m/s ripples by {ripple:.2g} m/s")
    return StepMetrics(
        wheel=wheel,
        kind=level.kind,
        number=number,
        input=level.value,
        previous=level.previous,
        start_s=level.start_s,
        duration_s=level.duration_s,
        direction=_direction(level),
        gain=gain,
        time_constant=time_constant,
        steady_mps=None if reason is not None else steady,
        notes=tuple(notes),
    )


def gain_unit(kind: InputKind) -> str:
    """The unit of a gain: the paper's in effort mode, a plain ratio in velocity mode."""
    return "mm/s per %" if kind == "effort" else "1"


def _direction(level: Level) -> Direction:
    if level.value == level.previous:
        return "none"
    if level.value * level.previous < 0.0:
        return "reversal"
    return "up" if abs(level.value) > abs(level.previous) else "down"


def _inside(t_s: FloatArray, start_s: float, end_s: float) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Rows whose whole interval lies between two times (to a thousandth of an interval)."""
    tolerance = 1e-3 * float(np.median(np.diff(t_s)))
    begin = np.concatenate((t_s[:1], t_s[:-1]))
    return np.flatnonzero((begin >= start_s - tolerance) & (t_s <= end_s + tolerance) & (t_s > begin))


def _steady(t_s: FloatArray, speed: FloatArray, level: Level) -> tuple[float, float, float, str | None]:
    """Steady speed, ripple (deviation from a line), drift (second half less first), all m/s; or why not."""
    rows = _inside(t_s, level.end_s - STEADY_SHARE * level.duration_s, level.end_s)
    if rows.size < 3:
        return 0.0, 0.0, 0.0, f"the level lasts only {level.duration_s:.2f} s ({rows.size} steady rows)"
    weights = t_s[rows] - t_s[rows - 1]
    steady = float(np.average(speed[rows], weights=weights))
    half = rows.size // 2
    drift = float(speed[rows[-half:]].mean() - speed[rows[:half]].mean())
    line = np.polyval(np.polyfit(t_s[rows] - t_s[rows[0]], speed[rows], 1), t_s[rows] - t_s[rows[0]])
    ripple = float(np.std(speed[rows] - line))
    return steady, ripple, drift, None


def _gain(level: Level, steady_mps: float) -> Quantity:
    unit = gain_unit(level.kind)
    if level.value == 0.0:
        return Quantity.unknown(unit, "no gain at zero input")
    # m/s per unit effort is 10 mm/s per per cent.
    return Quantity(steady_mps / level.value * (10.0 if level.kind == "effort" else 1.0), unit)


def _time_constant(
    t_s: FloatArray, speed: WheelSpeed, level: Level, steady: float, ripple: float
) -> tuple[Quantity, float]:
    """Time to 63.2 % of the way into the level (s), and the change of speed (m/s)."""
    if level.value == level.previous:
        return Quantity.unknown("s", "the run begins at this level"), 0.0
    before_rows = _inside(t_s, level.start_s - BEFORE_S, level.start_s)
    if before_rows.size == 0:
        before_rows = np.flatnonzero(t_s <= level.start_s)[-1:]
    before = float(speed.values[before_rows].mean())
    change = steady - before
    floor = max(STAND_OUT * ripple, 2.0 * speed.resolution)
    if abs(change) <= floor:
        return Quantity.unknown("s", f"the speed changes by {abs(change):.3g} m/s, within the ripple"), change
    rows = _inside(t_s, level.start_s, level.end_s)
    # A mean over an interval stands for the speed at its middle.
    times = np.concatenate(([level.start_s], 0.5 * (t_s[rows - 1] + t_s[rows])))
    gone = np.concatenate(([0.0], (speed.values[rows] - before) / change))
    crossed = np.flatnonzero(gone >= ONE_TIME_CONSTANT)
    if crossed.size == 0:
        return Quantity.unknown("s", "the speed never reaches 63.2 % of its way"), change
    k = int(crossed[0])
    if k <= 1:
        interval = float(t_s[rows[0]] - t_s[rows[0] - 1])
        return Quantity.unknown("s", f"shorter than the log can show (one row is {interval:.3g} s)"), change
    share = (ONE_TIME_CONSTANT - gone[k - 1]) / (gone[k] - gone[k - 1])
    crossing = times[k - 1] + share * (times[k] - times[k - 1])
    return Quantity(float(crossing - level.start_s), "s"), change
