"""Time-series figures for the pages: dark plotly figures as plain dictionaries."""

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
MAX_POINTS = 2000
_GAP = 0.06
_AXIS = {
    "gridcolor": "#1d242e",
    "zerolinecolor": "#3a4656",
    "linecolor": LINE,
    "tickfont": {"size": 11, "color": DIM},
    "automargin": False,
}
CONFIG = {
    "displaylogo": False,
    "displayModeBar": False,
    "responsive": True,
    "doubleClick": "reset",
    "scrollZoom": False,
}


@dataclass(frozen=True, slots=True)
class Line:
    """One curve.

    Attributes
    ----------
    t, values : shape (n,); non-finite values are drawn as gaps.
    dash : plotly's name: `solid`, `dash`, `dot`.
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
    """A figure without data, with a text that explains why."""
    figure = panels([])
    figure["layout"] |= {
        "xaxis": {"visible": False},
        "yaxis": {"visible": False},
        "annotations": [
            {
                "text": text, "showarrow": False, "font": {"size": 14, "color": DIM},
                "xref": "paper", "yref": "paper", "x": 0.5, "y": 0.5,
            }
        ],
    }  # fmt: skip
    return figure


def panels(
    parts: Sequence[Panel], *, linked: bool = True, select: bool = False, revision: str = ""
) -> Figure:
    """Stacked panels.

    Parameters
    ----------
    linked : zooming one in time zooms them all.
    select : dragging selects a time span; otherwise it zooms.
    revision : while it is unchanged, a new figure keeps the zoom of the old one.
    """
    count = max(1, len(parts))
    height = (1.0 - _GAP * (count - 1)) / count
    layout: Figure = {
        "font": {"family": 'system-ui, "DejaVu Sans", sans-serif', "size": 12, "color": TEXT},
        "paper_bgcolor": BACKGROUND,
        "plot_bgcolor": BACKGROUND,
        "margin": {"l": 58, "r": 12, "t": 30, "b": 34},
        "showlegend": True,
        "legend": {
            "orientation": "h", "x": 0, "y": 1.0, "yanchor": "bottom", "bgcolor": "rgba(0,0,0,0)",
            "font": {"size": 11},
        },
        "hovermode": "x unified",
        "hoverlabel": {"bgcolor": "#1b222c", "font": {"size": 11}},
        "dragmode": "select" if select else "zoom",
        "selectdirection": "h",
        "uirevision": revision or None,
        "autosize": True,
    }  # fmt: skip
    data: list[Figure] = []
    for row, panel in enumerate(parts):
        suffix = "" if row == 0 else str(row + 1)
        top = 1.0 - row * (height + _GAP)
        last = row == count - 1
        x_axis = _AXIS | {"anchor": f"y{suffix}", "showticklabels": last or not linked}
        if linked and row:
            x_axis["matches"] = "x"
        if last:
            x_axis["title"] = {"text": "time, s", "font": {"size": 11, "color": DIM}, "standoff": 4}
        layout[f"xaxis{suffix}"] = x_axis
        layout[f"yaxis{suffix}"] = _AXIS | {
            "domain": [max(0.0, top - height), top],
            "anchor": f"x{suffix}",
            "title": {"text": panel.unit, "font": {"size": 11, "color": DIM}, "standoff": 4},
            "fixedrange": False,
        }
        for line in panel.lines:
            t, values = decimated(line.t, line.values)
            data.append(
                {
                    "type": "scatter",
                    "mode": "lines",
                    "name": line.name,
                    "x": t,
                    "y": values,
                    "line": {"color": line.colour, "dash": line.dash, "width": line.width},
                    "xaxis": f"x{suffix}",
                    "yaxis": f"y{suffix}",
                    "hovertemplate": "%{y:.4g}",
                }
            )
    return {"data": data, "layout": layout, "config": CONFIG}


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
    """A figure of a report in the view's colours."""
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
