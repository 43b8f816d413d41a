"""Runs of one kind laid over each other, normalised, as the paper's Figures 3 to 9 do.

A run's speeds are divided by what its largest level asks for: the command in velocity mode, the command times
the group's mean gain in effort mode. Its inputs are divided by the largest, so that a run whose gain is the
group's settles on its dashed lines, and what differs from run to run is what a linear model leaves out.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.identify.identification import Identification, RunIdentification
from truing.identify.step_metrics import StepMetrics
from truing.recording.run import RecordingSet, Wheel
from truing.report.figures import AXIS, FONT, LEGEND, Figure, axis_title, figure_heading, figure_numbers
from truing.report.png import save_picture

# Okabe and Ito's palette, apart for every kind of colour vision.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
KINDS = {"E": "effort", "V": "velocity"}
SIDES = {"B": "both wheels", "L": "left wheel", "R": "right wheel"}
# How long before the first step a curve begins, s.
LEAD_S = 0.5


@dataclass(frozen=True, slots=True)
class Curve:
    """One wheel in one run.

    Attributes
    ----------
    times_s : shape (n,), from the first step on.
    speed : shape (n,), normalised.
    levels : start and end (s) and normalised input of each level.
    """

    run: str
    wheel: Wheel
    times_s: FloatArray
    speed: FloatArray
    levels: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True, slots=True)
class Overlay:
    """All runs of one kind: the paper's label of it, and how speeds were normalised."""

    mode: str
    count: int
    curves: tuple[Curve, ...]
    gain: float | None

    @property
    def title(self) -> str:
        """What kind of runs these are."""
        levels = "one level" if self.count == 1 else f"{self.count} levels"
        return f"{KINDS[self.mode[0]].capitalize()}, {SIDES[self.mode[-1]]}, {levels} ({self.mode})"

    @property
    def name(self) -> str:
        """For files and page elements."""
        return f"overlay-{self.mode}-{self.count}"

    @property
    def ordinate(self) -> str:
        """What the speeds were divided by."""
        if self.gain is None:
            return "speed over largest commanded speed"
        return f"speed over largest effort × {10 * self.gain:.2f} mm/s per %"


def overlays(recordings: RecordingSet, result: Identification) -> list[Overlay]:
    """One overlay for each kind of stepped run in the set, in the paper's order of labels."""
    groups: dict[tuple[str, int], list[RunIdentification]] = {}
    for run in result.runs:
        if run.mode:
            groups.setdefault((run.mode, run.level_count), []).append(run)
    order = sorted(groups, key=lambda key: (key[0].endswith("B"), key[0], key[1]))
    return [_overlay(recordings, mode, count, groups[mode, count]) for mode, count in order]


def _driven(run: RunIdentification) -> list[tuple[Wheel, tuple[StepMetrics, ...]]]:
    return [(side.wheel, side.steps) for side in run.wheels if any(step.input for step in side.steps)]


def _overlay(recordings: RecordingSet, mode: str, count: int, runs: list[RunIdentification]) -> Overlay:
    gain = None
    if mode.startswith("E"):
        gains = [
            step.steady_mps / step.input
            for run in runs
            for _, steps in _driven(run)
            for step in steps
            if step.input and step.steady_mps is not None
        ]
        gain = float(np.mean(gains)) if gains else 1.0
    by_name = {run.name: run for run in recordings}
    curves = []
    for identified in runs:
        run = by_name[identified.name]
        for wheel, steps in _driven(identified):
            largest = max(abs(step.input) for step in steps)
            first = steps[0].start_s
            middle = run.t_s - 0.5 * np.diff(run.t_s, prepend=run.t_s[0]) - first
            shown = middle >= -LEAD_S
            speed = run.speed(wheel, recordings.robot).values / (largest * (gain or 1.0))
            levels = tuple(
                (step.start_s - first, step.start_s - first + step.duration_s, step.input / largest)
                for step in steps
            )
            curves.append(Curve(identified.name, wheel, middle[shown], speed[shown], levels))
    return Overlay(mode, count, tuple(curves), gain)


def save_overlay(overlay: Overlay, path: Path) -> Path:
    """Draw an overlay as a PNG."""
    runs = list(dict.fromkeys(curve.run for curve in overlay.curves))

    def draw(figure: Any) -> None:
        axes = figure.subplots()
        axes.axhline(0.0, color="#b0b0b0", linewidth=0.8)
        for curve in overlay.curves:
            colour = PALETTE[runs.index(curve.run) % len(PALETTE)]
            right = curve.wheel == "right"
            axes.plot(
                curve.times_s, curve.speed, color=colour, linewidth=1.1 if right else 1.9,
                linestyle=(0, (2, 1)) if right else "-", label=f"{curve.run}, {curve.wheel}",
            )  # fmt: skip
            if not right or overlay.mode.endswith("R"):
                for begin, end, level in curve.levels:
                    axes.plot(
                        (begin, end), (level, level), color=colour, linewidth=0.9, linestyle="--", alpha=0.7
                    )
        axes.set_title(f"{overlay.title}, normalised")
        axes.set_xlabel("time after the first step, s")
        axes.set_ylabel(overlay.ordinate)
        axes.margins(x=0.01)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))

    return save_picture(path, (10.0, 4.8), draw)


def overlay_figure(overlay: Overlay) -> Figure:
    """The same for the page."""
    runs = list(dict.fromkeys(curve.run for curve in overlay.curves))
    traces: list[dict[str, Any]] = []
    for curve in overlay.curves:
        colour = PALETTE[runs.index(curve.run) % len(PALETTE)]
        right = curve.wheel == "right"
        x, y = figure_numbers(curve.times_s, curve.speed)
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "x": x,
                "y": y,
                "name": f"{curve.run}, {curve.wheel}",
                "legendgroup": curve.run,
                "line": {
                    "color": colour,
                    "width": 1.4 if right else 2.2,
                    "dash": "dot" if right else "solid",
                },
                "hovertemplate": "%{y:.3f}",
            }
        )
        if not right or overlay.mode.endswith("R"):
            places: list[float | None] = []
            levels: list[float | None] = []
            for begin, end, level in curve.levels:
                places += [begin, end, None]
                levels += [level, level, None]
            line = {"color": colour, "width": 1.0, "dash": "dash"}
            traces.append(
                {
                    "type": "scatter",
                    "mode": "lines",
                    "x": places,
                    "y": levels,
                    "line": line,
                    "legendgroup": curve.run,
                    "showlegend": False,
                    "hoverinfo": "skip",
                    "opacity": 0.7,
                }
            )
    layout = {
        "font": FONT,
        "height": 470,
        "margin": {"l": 58, "r": 12, "t": 34, "b": 130},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "hovermode": "x unified",
        "legend": LEGEND,
        "xaxis": AXIS | {"title": axis_title("time after the first step, s"), "zeroline": False},
        "yaxis": AXIS | {"title": axis_title(overlay.ordinate)},
        "annotations": [figure_heading(f"{overlay.title}, normalised", 1.0)],
    }
    return {"data": traces, "layout": layout}
