"""A run's interactive plots as plotly figures: plain dictionaries, ready for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truing.arrays import FloatArray
from truing.report.plot import LINE_WIDTHS, PATH_LABELS, path_window
from truing.report.run_view import COLOURS, NEUTRAL, REFERENCE, PathView, RunView

# More points than a screen has columns only make the page heavy.
MAX_POINTS = 4000
# Points of all lines of a page together, about 14 bytes each, and what every line may keep.
PAGE_POINTS = 60_000
MIN_POINTS = 100
# What survives in the page: no sensor here has more.
SIGNIFICANT_DIGITS = 6

FONT = {
    "family": 'system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif',
    "size": 12.5,
    "color": "#1c2430",
}
AXIS = {
    "gridcolor": "#e6e9ec",
    "zerolinecolor": "#b4bac2",
    "linecolor": "#8a929c",
    "ticks": "outside",
    "ticklen": 4,
}
# At the figure's own bottom edge, whatever its height on a screen or on paper.
LEGEND = {
    "orientation": "h",
    "x": 0,
    "yref": "container",
    "y": 0.0,
    "yanchor": "bottom",
    "font": {"size": 12},
}

Figure = dict[str, Any]


def run_figures(view: RunView) -> dict[str, Figure]:
    """The figures of a run by kind: `speeds` (with efforts below), and `path` where there is one."""
    figures = {"speeds": _speeds(view)}
    if view.path is not None:
        figures["path"] = _path(view.path)
    return figures


def _speeds(view: RunView) -> Figure:
    traces: list[dict[str, Any]] = []
    for (wheel, curves), width in zip(view.wheels, LINE_WIDTHS, strict=True):
        line = {"color": COLOURS[wheel], "width": width}
        traces.append(_line(view.middle_s, curves.speed, f"{wheel}, measured", line, "m/s"))
    for wheel, curves in view.wheels:
        if curves.commanded is None or (view.same_command and wheel == "right"):
            continue
        colour, who = (NEUTRAL, "both") if view.same_command else (COLOURS[wheel], wheel)
        line = {"color": colour, "width": 1.3, "dash": "dash", "shape": "vh"}
        traces.append(_line(view.t_s, curves.commanded, f"{who}, {view.commanded_label}", line, "m/s"))
    for wheel, curves in view.wheels:
        if curves.simulated is not None:
            line = {"color": COLOURS[wheel], "width": 1.5, "dash": "dot"}
            traces.append(_line(view.middle_s, curves.simulated, f"{wheel}, model (free run)", line, "m/s"))
    for (wheel, curves), width in zip(view.wheels, LINE_WIDTHS, strict=True):
        line = {"color": COLOURS[wheel], "width": width, "shape": "vh"}
        trace = _line(view.t_s, curves.effort, f"{wheel}, effort", line, "%")
        traces.append(trace | {"yaxis": "y2", "showlegend": False})
    return {"data": traces, "layout": speeds_layout("Wheel speed", "Applied effort", "effort, %")}


def speeds_layout(upper: str, lower: str, lower_axis: str) -> dict[str, Any]:
    """Two plots over one time axis: speeds, and below them what `lower` names."""
    return {
        "font": FONT,
        "height": 500,
        "margin": {"l": 58, "r": 12, "t": 34, "b": 112},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "hovermode": "x unified",
        "legend": LEGEND,
        "xaxis": AXIS | {"title": axis_title("time, s"), "anchor": "y2", "zeroline": False},
        "yaxis": AXIS | {"title": axis_title("speed at the rim, m/s"), "domain": [0.36, 1.0]},
        "yaxis2": AXIS | {"title": axis_title(lower_axis), "domain": [0.0, 0.26]},
        "annotations": [figure_heading(upper, 1.0), figure_heading(lower, 0.26)],
    }


def _path(path: PathView) -> Figure:
    traces: list[dict[str, Any]] = []
    if path.reference is not None:
        line = {"color": REFERENCE, "width": 1.6, "dash": "dash"}
        traces.append(_track(*path.reference, "outside reference", line))
    traces.append(_track(path.x_m, path.y_m, PATH_LABELS[path.source], {"color": NEUTRAL, "width": 2.2}))
    for row, name, symbol in ((0, "start", "circle-open"), (-1, "end", "square")):
        traces.append(
            {
                "type": "scatter",
                "mode": "markers+text",
                "x": [_rounded(float(path.x_m[row]))],
                "y": [_rounded(float(path.y_m[row]))],
                "text": [name],
                "textposition": "top center",
                "name": name,
                "showlegend": False,
                "marker": {"color": NEUTRAL, "size": 9, "symbol": symbol, "line": {"width": 2}},
                "hovertemplate": "%{x:.3f} m, %{y:.3f} m<extra>" + name + "</extra>",
            }
        )
    low_x, high_x, low_y, high_y = path_window(path)
    layout = {
        "font": FONT,
        "height": 500,
        "margin": {"l": 58, "r": 12, "t": 34, "b": 112},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "hovermode": "closest",
        "legend": LEGEND,
        "showlegend": True,
        "xaxis": AXIS
        | {
            "title": axis_title("x, forward at the start, m"),
            "range": [low_x, high_x],
            "constrain": "domain",
        },
        "yaxis": AXIS
        | {
            "title": axis_title("y, to the left at the start, m"),
            "range": [low_y, high_y],
            "scaleanchor": "x",
            "scaleratio": 1,
            "constrain": "domain",
            "constraintoward": "top",
        },
        "annotations": [figure_heading("Path on the floor", 1.0)],
    }
    return {"data": traces, "layout": layout}


def axis_title(text: str) -> dict[str, Any]:
    """An axis title."""
    return {"text": text, "standoff": 8, "font": {"size": 12.5}}


def figure_heading(text: str, top: float) -> dict[str, Any]:
    """A heading at the top left of a plot whose upper edge is at `top` of the figure."""
    return {
        "text": f"<b>{text}</b>",
        "xref": "paper",
        "yref": "paper",
        "x": 0,
        "y": top,
        "xanchor": "left",
        "yanchor": "bottom",
        "yshift": 4,
        "showarrow": False,
        "font": {"size": 13},
    }


def _line(
    times: FloatArray, values: FloatArray, name: str, line: dict[str, Any], unit: str
) -> dict[str, Any]:
    kept = thin(values)
    return {
        "type": "scatter",
        "mode": "lines",
        "x": _numbers(times[kept]),
        "y": _numbers(values[kept]),
        "name": name,
        "line": line,
        "hovertemplate": f"%{{y:.3f}} {unit}",
    }


def _track(x: FloatArray, y: FloatArray, name: str, line: dict[str, Any]) -> dict[str, Any]:
    kept = np.linspace(0, len(x) - 1, min(len(x), MAX_POINTS)).astype(int)
    return {
        "type": "scatter",
        "mode": "lines",
        "x": _numbers(x[kept]),
        "y": _numbers(y[kept]),
        "name": name,
        "line": line,
        "hovertemplate": "%{x:.3f} m, %{y:.3f} m",
    }


def thin(values: FloatArray, most: int = MAX_POINTS) -> NDArray[np.intp]:
    """Rows to draw, at most about `most`: lowest and highest of each bucket, so that no peak is lost.

    Parameters
    ----------
    values : shape (n,); NaN, which breaks a line, is kept.
    """
    n = len(values)
    if n <= most:
        return np.arange(n)
    size = -(-2 * n // most)
    buckets = n // size
    body = np.nan_to_num(values[: buckets * size]).reshape(buckets, size)
    base = size * np.arange(buckets)
    gaps = np.flatnonzero(np.isnan(values))
    ends = np.array([0, n - 1])
    rows = np.concatenate((base + body.argmin(axis=1), base + body.argmax(axis=1), gaps, ends))
    return np.unique(rows)


def slimmed(figures: Mapping[str, Figure], most: int = PAGE_POINTS) -> dict[str, Figure]:
    """The figures of a page with at most about `most` points in all; lines lose points, never peaks.

    Short lines keep all of theirs; the long ones share what is left.
    """
    counts = sorted(
        len(trace["x"]) for figure in figures.values() for trace in figure["data"] if _is_curve(trace)
    )
    left, cap = most, 0
    for number, count in enumerate(counts):
        cap = max(left // (len(counts) - number), MIN_POINTS)
        if count > cap:
            break
        left -= count
    else:
        return dict(figures)
    return {
        name: figure | {"data": [_shortened(trace, cap) for trace in figure["data"]]}
        for name, figure in figures.items()
    }


def _is_curve(trace: dict[str, Any]) -> bool:
    return trace["type"] == "scatter" and trace.get("mode") == "lines" and "fill" not in trace


def _shortened(trace: dict[str, Any], most: int) -> dict[str, Any]:
    if not _is_curve(trace) or len(trace["x"]) <= most:
        return trace
    values = np.array([np.nan if value is None else value for value in trace["y"]], dtype=np.float64)
    kept = thin(values, most)
    return trace | {name: [trace[name][k] for k in kept] for name in ("x", "y")}


def figure_numbers(times: FloatArray, values: FloatArray) -> tuple[list[float | None], list[float | None]]:
    """A curve's points as the page holds them: thinned, rounded, a gap as null."""
    kept = thin(values)
    return _numbers(times[kept]), _numbers(values[kept])


def _numbers(values: FloatArray) -> list[float | None]:
    return [None if value != value else _rounded(value) for value in values.tolist()]


def _rounded(value: float) -> float:
    return float(f"{value:.{SIGNIFICANT_DIGITS}g}")
