"""Content of the Analysis page: signals in panels by unit, statistics of a span, step metrics, CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import TruingError
from truing.identify.quantity import Quantity
from truing.identify.step_metrics import step_metrics
from truing.recording.baseline import Baseline
from truing.recording.run import WHEELS, Run
from truing.web.views.figures import COLOURS, Line, Panel, panels

SELECTED, MARKED = "#5ccfe6", "#ff7b7b"
USUAL = ("speed_left", "speed_right", "effort_left", "effort_right")
_KNOWN = {
    "effort": ("% effort", 100.0),
    "cmd": ("command", 1.0),
    "ticks": ("counts", 1.0),
    "vel": ("m/s", 1.0),
    "pos": ("m", 1.0),
    "x": ("m", 1.0),
    "y": ("m", 1.0),
    "theta": ("°", 180.0 / math.pi),
    "gyro": ("°/s", 180.0 / math.pi),
    "battery": ("V", 1.0),
}


@dataclass(frozen=True, slots=True)
class Signal:
    """One curve of a run.

    Attributes
    ----------
    name : of the column, or `speed_left` and `speed_right` for the best speed signal of the run.
    values : shape (n,), in `unit`.
    """

    name: str
    unit: str
    values: FloatArray


def signals_of(run: Run, baseline: Baseline | None) -> list[Signal]:
    """All signals that can be drawn, speeds first."""
    found = []
    for wheel in WHEELS:
        try:
            found.append(Signal(f"speed_{wheel}", "m/s", run.speed(wheel, baseline).values))
        except TruingError:
            continue
    for name, values in run.columns.items():
        if name == "t_s":
            continue
        stem = name.removeprefix("truth_").partition("_")[0]
        unit, scale = _KNOWN.get(stem, ("", 1.0))
        found.append(Signal(name, unit, values * scale))
    return found


def analysis_content(
    run: Run,
    baseline: Baseline | None,
    selected: Sequence[str],
    span: tuple[float, float] | None,
    *,
    marks: Sequence[tuple[float, float]] = (),
) -> dict[str, Any]:
    """Figure, statistics and steps of a run, as plain lists and text.

    Parameters
    ----------
    selected : names of the signals to draw.
    span : start and end of the statistics, s; None: the full run.
    marks : stretches that a diagnosis is about, s.
    """
    signals = signals_of(run, baseline)
    drawn = [signal for signal in signals if signal.name in selected]
    units: dict[str, list[Line]] = {}
    for signal in drawn:
        colour = COLOURS[signals.index(signal) % len(COLOURS)]
        if signal.name.endswith(("_left", "_left_mps", "_left_m")):
            colour = COLOURS[0]
        elif signal.name.endswith(("_right", "_right_mps", "_right_m")):
            colour = COLOURS[1]
        dash = "dot" if signal.name.startswith("cmd") else "solid"
        units.setdefault(signal.unit, []).append(Line(signal.name, run.t_s, signal.values, colour, dash))
    parts = [Panel(unit, lines) for unit, lines in units.items()]
    shaded = [(*mark, MARKED, 0.16) for mark in marks]
    if span is not None:
        shaded.append((*span, SELECTED, 0.08))
    figure = panels(parts, marks=shaded, revision=run.name)
    return {
        "signals": [{"name": signal.name, "unit": signal.unit} for signal in signals],
        "figure": figure,
        "statistics": [_statistics(signal, run.t_s, span) for signal in drawn],
        "steps": step_rows(run, baseline),
        "end_s": float(run.t_s[-1]),
        "start_s": float(run.t_s[0]),
    }


STATISTICS_HEAD = ("signal", "rows", "mean", "sd", "min", "max", "slope, 1/s")


def _statistics(signal: Signal, t_s: FloatArray, span: tuple[float, float] | None) -> list[str]:
    inside = np.isfinite(signal.values)
    if span is not None:
        inside &= (t_s >= span[0]) & (t_s <= span[1])
    values, times = signal.values[inside], t_s[inside]
    label = f"{signal.name}, {signal.unit}" if signal.unit else signal.name
    if not values.size:
        return [label, "0", *["–"] * 5]
    slope = math.nan
    if values.size > 1 and np.ptp(times) > 0.0:
        centred = times - times.mean()
        slope = float(centred @ (values - values.mean()) / (centred @ centred))
    sd = float(values.std(ddof=1)) if values.size > 1 else math.nan
    numbers = (float(values.mean()), sd, float(values.min()), float(values.max()), slope)
    return [label, str(values.size), *map(_short, numbers)]


STEPS_HEAD = (
    "wheel",
    "t, s",
    "input",
    "steady, m/s",
    "gain",
    "τ, s",
    "delay, s",
    "overshoot, %",
    "ripple, mm/s",
)
# Decimals of gain, time constant, dead time, overshoot and ripple: finer than their uncertainty.
_STEP_DIGITS = (3, 3, 3, 1, 2)


def step_rows(run: Run, baseline: Baseline | None) -> list[list[str]]:
    """A row for every step of either wheel; none if the input has no steps."""
    rows = []
    for wheel in WHEELS:
        try:
            steps, _ = step_metrics(run, wheel, baseline)
        except TruingError:
            continue
        for step in steps:
            change = f"{step.previous:.3g} → {step.input:.3g}".replace("-", "−")
            quantities = (step.gain, step.time_constant, step.dead_time, step.overshoot, step.ripple)
            steady = "–" if step.steady_mps is None else _short(step.steady_mps)
            shown = map(_quantity, quantities, _STEP_DIGITS)
            rows.append([wheel, f"{step.start_s:.2f}", change, steady, *shown])
    return rows


def csv_text(
    run: Run, baseline: Baseline | None, selected: Sequence[str], span: tuple[float, float] | None
) -> str:
    """The selected signals of the span as CSV, with units in the header."""
    drawn = [signal for signal in signals_of(run, baseline) if signal.name in selected]
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["t_s", *(f"{one.name} ({one.unit})" if one.unit else one.name for one in drawn)])
    for row, t in enumerate(run.t_s.tolist()):
        if span is None or span[0] <= t <= span[1]:
            writer.writerow([repr(t), *(repr(float(signal.values[row])) for signal in drawn)])
    return out.getvalue()


def _quantity(quantity: Quantity, digits: int) -> str:
    # Adding zero removes the sign of a negative zero.
    value = quantity.value
    return "–" if value is None else f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "−")


def _short(value: float) -> str:
    return "–" if not math.isfinite(value) else f"{value:.4g}".replace("-", "−")
