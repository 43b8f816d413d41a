"""What each step of a run shows: gain, time constant, dead time, overshoot, undershoot, ripple."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from truing.arrays import FloatArray
from truing.identify.levels import STEADY_SHARE, InputKind, Level, find_levels
from truing.identify.quantity import Quantity
from truing.identify.signals import shown_resolution
from truing.identify.step_noise import WindowNoise, window_noise
from truing.identify.step_response import Response, ripple_of, rows_before, rows_inside
from truing.recording.run import Geometry, Run, Wheel, WheelSpeed

Direction: TypeAlias = Literal["up", "down", "reversal", "none"]

# A step must stand out from the ripple by this factor to have a time constant.
STAND_OUT = 3.0
# Ripple above this share of the steady speed is worth a note.
LARGE_RIPPLE = 0.1
# A time constant of fewer rows than this hangs on the interpolation between them.
FEW_ROWS = 2.0
# A steady window whose halves differ by more than this share of the step had not settled.
SETTLED_SHARE = 0.02
# Standard deviations to the end of a 95 % interval.
NORMAL = 1.96


@dataclass(frozen=True, slots=True)
class StepMetrics:
    """What one wheel did at one level of the input.

    Attributes
    ----------
    input, previous : effort fraction, or m/s in velocity mode.
    gain : mm/s per % of effort, or a ratio in velocity mode; unknown at zero input.
    time_constant : of the transition into this level, s.
    dead_time : from the step to where a first-order response through 28.3 % and 63.2 % of the way begins, s.
    overshoot, undershoot : furthest excursion above and below the new steady speed after it was first
        reached, per cent of the change of speed; what noise alone would show counts as zero.
    ripple : standard deviation of the steady speed about a line, mm/s.
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
    dead_time: Quantity
    overshoot: Quantity
    undershoot: Quantity
    ripple: Quantity
    steady_mps: float | None
    notes: tuple[str, ...] = ()


def step_metrics(
    run: Run, wheel: Wheel, baseline: Geometry | None = None
) -> tuple[tuple[StepMetrics, ...], str | None]:
    """Metrics of every step of a wheel's input; or none, with the reason."""
    levels = find_levels(run, wheel)
    if levels.reason is not None:
        return (), levels.reason
    speed = run.speed(wheel, baseline)
    noises = dict(zip(levels.levels, _noises(run.t_s, speed.values, levels.levels), strict=True))
    measured: list[StepMetrics] = []
    before: WindowNoise | None = None
    for level in levels.levels:
        if level.value != 0.0 or level.previous != 0.0:
            measured.append(_measure(run, wheel, speed, level, len(measured) + 1, noises[level], before))
        before = noises[level]
    return tuple(measured), None


def _noises(t_s: FloatArray, speed: FloatArray, levels: Sequence[Level]) -> list[WindowNoise | None]:
    """Noise of each level's steady window."""
    windows = [
        speed[rows_inside(t_s, level.end_s - STEADY_SHARE * level.duration_s, level.end_s)]
        for level in levels
    ]
    return window_noise(windows)


def _measure(
    run: Run,
    wheel: Wheel,
    speed: WheelSpeed,
    level: Level,
    number: int,
    noise: WindowNoise | None,
    noise_before: WindowNoise | None,
) -> StepMetrics:
    steady, ripple, drift, reason = _steady(run.t_s, speed.values, level)
    notes: list[str] = []
    if reason is not None:
        gain = Quantity.unknown(gain_unit(level.kind), reason)
        time_constant = dead_time = Quantity.unknown("s", reason)
        overshoot = undershoot = Quantity.unknown("% of the step", reason)
        spread = Quantity.unknown("mm/s", reason)
    else:
        window_s = STEADY_SHARE * level.duration_s
        shown = shown_resolution(speed.values, speed.resolution)
        counted = speed.resolution > 0.0
        # Of counts only the two ends of the window are rounded; each value of a speed is.
        share = run.interval_s / window_s
        rounding = shown * (share if counted else math.sqrt(share / 12.0) * NORMAL)
        gain = _gain(level, steady, _half_width_of_mean(noise, shown, counted, rounding))
        change, refusal = _change(run.t_s, speed, level, steady, ripple)
        spread = ripple_of(noise, speed.resolution)
        if refusal is not None:
            time_constant = dead_time = Quantity.unknown("s", refusal)
            overshoot = undershoot = Quantity.unknown("% of the step", refusal)
        else:
            response = Response.of(run, speed, level, steady, change, noise, noise_before, drift)
            time_constant, dead_time = response.times()
            overshoot, undershoot = response.excursions()
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
        dead_time=dead_time,
        overshoot=overshoot,
        undershoot=undershoot,
        ripple=spread,
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


def _steady(t_s: FloatArray, speed: FloatArray, level: Level) -> tuple[float, float, float, str | None]:
    """Steady speed, ripple (deviation from a line), drift (second half less first), all m/s; or why not."""
    rows = rows_inside(t_s, level.end_s - STEADY_SHARE * level.duration_s, level.end_s)
    if rows.size < 3:
        return 0.0, 0.0, 0.0, f"the level lasts only {level.duration_s:.2f} s ({rows.size} steady rows)"
    weights = t_s[rows] - t_s[rows - 1]
    steady = float(np.average(speed[rows], weights=weights))
    half = rows.size // 2
    drift = float(speed[rows[-half:]].mean() - speed[rows[:half]].mean())
    line = np.polyval(np.polyfit(t_s[rows] - t_s[rows[0]], speed[rows], 1), t_s[rows] - t_s[rows[0]])
    ripple = float(np.std(speed[rows] - line))
    return steady, ripple, drift, None


def _half_width_of_mean(
    noise: WindowNoise | None, resolution_mps: float, counted: bool, rounding: float
) -> float | None:
    """Of the mean speed's 95 % interval, m/s; None where nothing tells.

    Parameters
    ----------
    resolution_mps : smallest step that the speed shows.
    counted : the speed comes from counts. Over a window their rounding errors cancel but for those at its
        two ends, so that the noise that is rounding (variance 1/6 of a count squared) widens nothing.
    rounding : what one count is worth over the window, m/s, which is never beaten.
    """
    if noise is None:
        return None
    own = 1.0
    if counted and noise.sigma > 0.0:
        own = math.sqrt(max(1.0 - resolution_mps**2 / 6.0 / noise.sigma**2, 0.0))
    half = max(own * noise.quantile * noise.mean_deviation, rounding)
    return half if half > 0.0 else None


def _gain(level: Level, steady_mps: float, half_width: float | None) -> Quantity:
    unit = gain_unit(level.kind)
    if level.value == 0.0:
        return Quantity.unknown(unit, "no gain at zero input")
    # m/s per unit effort is 10 mm/s per per cent.
    scale = (10.0 if level.kind == "effort" else 1.0) / level.value
    value = steady_mps * scale
    if half_width is None:
        return Quantity(value, unit)
    half = half_width * abs(scale)
    if value == 0.0:
        return Quantity(value, unit, (0.0, half))  # a wheel that does not answer
    if half >= abs(value):
        return Quantity.unknown(unit, f"not pinned down: {value:.3g} +- {half:.2g} {unit} holds zero")
    return Quantity(value, unit, (value - half, value + half))


def _change(
    t_s: FloatArray, speed: WheelSpeed, level: Level, steady: float, ripple: float
) -> tuple[float, str | None]:
    """How far the speed goes in this step (m/s), or why that tells nothing."""
    if level.value == level.previous:
        return 0.0, "the run begins at this level"
    change = steady - float(speed.values[rows_before(t_s, level)].mean())
    floor = max(STAND_OUT * ripple, 2.0 * speed.resolution)
    if abs(change) <= floor:
        return change, f"the speed changes by {abs(change):.3g} m/s, within the ripple"
    return change, None
