"""Figures of the pages: panels of curves over time for the plot, and reports' figures in dark colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from truing.arrays import FloatArray

Figure: TypeAlias = dict[str, Any]

BACKGROUND, TEXT, DIM, LINE = "#0e1116", "#dbe3ec", "#94a1b2", "#2a333f"
COLOURS = ("#ffb454", "#5ccfe6", "#7ee787", "#d2a8ff", "#ff7b7b", "#e6edf5", "#ffcb6b", "#79a8ff")
# More points than screen columns only slow the page down.
MAX_POINTS = 4000
# Of the figures that plotly draws.
CONFIG = {"displaylogo": False, "displayModeBar": False, "responsive": True, "doubleClick": "reset"}


@dataclass(frozen=True, slots=True)
class Line:
    """One curve.

    Attributes
    ----------
    t, values : shape (n,); non-finite values are drawn as gaps.
    dash : `solid`, `dash` or `dot`.
    """

    name: str
    t: FloatArray
    values: FloatArray
    colour: str
    dash: str = "solid"
    width: float = 1.5


@dataclass(frozen=True, slots=True)
class Panel:
    """Curves of one unit over the time axis that all panels share."""

    unit: str
    lines: Sequence[Line]


def empty_figure(text: str) -> Figure:
    """A figure without curves, with a text that explains why; lines end with a line break."""
    return {"panels": [], "marks": [], "revision": "", "empty": text}


def panels(
    parts: Sequence[Panel], *, marks: Sequence[tuple[float, float, str, float]] = (), revision: str = ""
) -> Figure:
    """Stacked panels over one time axis, as the plot draws them (`static/plot.js`).

    Parameters
    ----------
    marks : shaded stretches: start and end (s), colour, opacity.
    revision : while it is unchanged, a new figure keeps the zoom of the old one.
    """
    return {
        "panels": [{"unit": part.unit, "lines": [_line(line) for line in part.lines]} for part in parts],
        "marks": [
            {"from": first, "to": last, "colour": colour, "opacity": opacity}
            for first, last, colour, opacity in marks
        ],
        "revision": revision,
        "empty": "",
    }


def _line(line: Line) -> dict[str, Any]:
    t, values = decimated(line.t, line.values)
    return {
        "name": line.name,
        "t": t,
        "values": values,
        "colour": line.colour,
        "dash": line.dash,
        "width": line.width,
    }


def decimated(t: FloatArray, values: FloatArray) -> tuple[list[float], list[float | None]]:
    """A curve decimated for display: minimum and maximum of each interval of rows."""
    if len(t) > MAX_POINTS:
        interval = -(-2 * len(t) // MAX_POINTS)
        count = len(t) // interval
        block = np.where(np.isfinite(values), values, 0.0)[: count * interval].reshape(count, interval)
        base = np.arange(count) * interval
        rows = np.concatenate((base + block.argmin(axis=1), base + block.argmax(axis=1), [len(t) - 1]))
        rows = np.unique(rows)
        t, values = t[rows], values[rows]
    times: list[float] = np.round(t, 4).tolist()
    return times, [float(f"{v:.6g}") if np.isfinite(v) else None for v in values.tolist()]


# From the background colour to a warm white with increasing mismatch.
_HEAT = [[0.0, "#141920"], [0.12, "#2b2a33"], [0.35, "#8a4b2a"], [0.65, "#f08a3c"], [1.0, "#fff1d6"]]


def dark_theme(figure: Figure) -> Figure:
    """A figure of a report (plotly's format) in the view's colours."""
    layout = dict(figure["layout"])
    layout["font"] = layout.get("font", {}) | {"color": TEXT}
    layout.pop("height", None)
    layout |= {"paper_bgcolor": BACKGROUND, "plot_bgcolor": BACKGROUND, "autosize": True}
    for name, axis in layout.items():
        if name.startswith(("xaxis", "yaxis")):
            layout[name] = axis | {"gridcolor": "#1d242e", "linecolor": LINE, "zerolinecolor": "#3a4656"}
    data = []
    for trace in figure["data"]:
        changed = dict(trace)
        if trace["type"] == "heatmap":
            changed["colorscale"] = _HEAT
        elif "marker" in trace:
            changed["marker"] = trace["marker"] | {"color": "#e6edf5"}
        data.append(changed)
    return {"data": data, "layout": layout, "config": CONFIG}
