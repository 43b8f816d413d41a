"""The figures of a diagnosis report as plotly figures: plain dictionaries, ready for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.data.traces import RunTraces
from truing.diagnose.learned.result import LearnedTerm
from truing.diagnose.present.cells import Bins, TimeCells
from truing.diagnose.result import Diagnosis, EffectParameter, NamedEffect
from truing.model.correction import UNITS
from truing.plan import Plan
from truing.recording.run import WHEELS, Wheel
from truing.report.figures import AXIS, FONT, LEGEND, Figure, axis_title, figure_heading, figure_numbers
from truing.report.run_view import COLOURS, NEUTRAL

# RMS residual over noise that is drawn darkest.
DARKEST_TIMES = 8.0
SCALE = [[0.0, "#ffffff"], [0.12, "#fdf3e3"], [0.35, "#f6b26b"], [0.65, "#d9572b"], [1.0, "#6b1022"]]
MODEL = "#117733"
BASE = "#8a929c"
BAR_PX, HEADER_PX = 24, 96
MAX_RANKED = 14


def heat_map(cells: Sequence[TimeCells], after: Sequence[TimeCells] = ()) -> Figure:
    """Runs down, time across, one map for each wheel; a dot marks what stands out."""
    rows = [("with refitted parameters", cells)] + ([("with the named effects", after)] if after else [])
    data: list[dict[str, Any]] = []
    notes = []
    tall = HEADER_PX + len(rows) * (50 + 20 * len(cells[0].runs))
    layout: dict[str, Any] = _layout(tall, legend=False)
    between = 70.0 / (tall - HEADER_PX)
    height = (1.0 - between * (len(rows) - 1)) / len(rows)
    number = 0
    for row, (title, maps) in enumerate(rows):
        top = 1.0 - row * (height + between)
        for column, cell in enumerate(maps):
            number += 1
            suffix = "" if number == 1 else str(number)
            left = 0.0 if column == 0 else 0.54
            layout[f"xaxis{suffix}"] = AXIS | {
                "domain": [left, left + 0.46],
                "anchor": f"y{suffix}",
                "title": axis_title("time in the run, s" if row == len(rows) - 1 else ""),
                "showgrid": False,
                "zeroline": False,
            }
            layout[f"yaxis{suffix}"] = AXIS | {
                "domain": [top - height, top],
                "anchor": f"x{suffix}",
                "autorange": "reversed",
                "showgrid": False,
                "type": "category",
                "showticklabels": column == 0,
            }
            notes.append(figure_heading(f"{cell.wheel} wheel, {title}", top) | {"x": left})
            data += _map(cell, suffix, shows_scale=number == 1)
    layout["annotations"] = notes
    layout["margin"]["l"] = 20 + 7 * min(max(len(name) for name in cells[0].runs), 26)
    return {"data": data, "layout": layout}


def _map(cell: TimeCells, suffix: str, *, shows_scale: bool) -> list[dict[str, Any]]:
    centres = 0.5 * (cell.edges_s[1:] + cell.edges_s[:-1])
    names = [_short(name) for name in cell.runs]
    values = [_floats(row) for row in cell.times_noise]
    axes = {"xaxis": f"x{suffix}", "yaxis": f"y{suffix}"}
    field = {
        "type": "heatmap",
        "x": [round(float(x), 3) for x in centres],
        "y": names,
        "z": values,
        "zmin": 0.0,
        "zmax": DARKEST_TIMES,
        "colorscale": SCALE,
        "showscale": shows_scale,
        "colorbar": {
            "title": {"text": "RMS residual<br>over noise", "font": {"size": 11}},
            "thickness": 12,
            "len": 0.6,
        },
        "hoverongaps": False,
        "hovertemplate": "%{y}, %{x:.1f} s: %{z:.1f} times the noise<extra></extra>",
    }
    rows, columns = np.nonzero(cell.stands_out)
    marks = {
        "type": "scatter",
        "mode": "markers",
        "x": [round(float(centres[k]), 3) for k in columns],
        "y": [names[k] for k in rows],
        "marker": {"size": 4, "color": "#1c2430"},
        "hoverinfo": "skip",
        "showlegend": False,
    }
    return [field | axes, marks | axes]


def against(quantity: str, before: Sequence[Bins], after: Sequence[Bins] = ()) -> Figure:
    """Mean residual against one quantity, both wheels, with the 95 % band under no model error."""
    data: list[dict[str, Any]] = []
    for bins in before:
        seen = np.isfinite(bins.mean)
        x, y = bins.centres[seen], 1e3 * bins.mean[seen]
        band = 1.96e3 * bins.error[seen]
        colour = COLOURS[bins.wheel]
        data.append(
            {
                "type": "scatter",
                "x": _floats(np.concatenate((x, x[::-1]))),
                "y": _floats(np.concatenate((band, -band[::-1]))),
                "fill": "toself",
                "fillcolor": _faint(colour),
                "line": {"width": 0},
                "hoverinfo": "skip",
                "showlegend": False,
                "mode": "lines",
            }
        )
        data.append(_points(x, y, bins.stands_out[seen], colour, f"{bins.wheel}, refitted"))
    for bins in after:
        seen = np.isfinite(bins.mean)
        line = {"color": COLOURS[bins.wheel], "width": 1.3, "dash": "dot"}
        data.append(
            {
                "type": "scatter",
                "mode": "lines",
                "x": _floats(bins.centres[seen]),
                "y": _floats(1e3 * bins.mean[seen]),
                "line": line,
                "name": f"{bins.wheel}, with effects",
                "hovertemplate": "%{y:.1f} mm/s",
            }
        )
    unit = f", {before[0].unit}" if before[0].unit else ""
    layout = _layout(310) | {
        "xaxis": AXIS | {"title": axis_title(f"{quantity}{unit}"), "zeroline": False},
        "yaxis": AXIS | {"title": axis_title("mean residual, mm/s")},
        "annotations": [figure_heading(f"Against {quantity}", 1.0)],
        "showlegend": False,
    }
    layout["margin"] = {"l": 54, "r": 10, "t": 32, "b": 44}
    return {"data": data, "layout": layout}


def learned_term(learned: LearnedTerm) -> Figure:
    """Both wheels' lookups of a learned term against its variable, with their 95 % bands."""
    term = learned.term
    percent = {"force": "effort, %", "friction": "effort against the motion, %"}.get(
        term.place, f"{term.place}, %"
    )
    grid = np.array(term.grid)
    data: list[dict[str, Any]] = []
    bands = (term.left_band, term.right_band)
    for wheel, values, band in zip(WHEELS, term.values(), bands, strict=True):
        colour = COLOURS[wheel]
        if band:
            high, low = values + np.array(band), values - np.array(band)
            outline = {"x": _floats(np.concatenate((grid, grid[::-1])))}
            outline["y"] = _floats(100.0 * np.concatenate((high, low[::-1])))
            data.append(
                outline
                | {"type": "scatter", "mode": "lines", "fill": "toself", "fillcolor": _faint(colour)}
                | {"line": {"width": 0}, "hoverinfo": "skip", "showlegend": False}
            )
        data.append(
            {"type": "scatter", "mode": "lines+markers", "x": _floats(grid), "y": _floats(100.0 * values)}
            | {"name": f"{wheel}, learned", "line": {"color": colour, "width": 1.8}, "marker": {"size": 4}}
            | {"hovertemplate": "%{y:.2f} %"}
        )
    unit = UNITS[term.variable]
    text = learned.depends_on if unit == "1" else f"{learned.depends_on}, {unit}"
    layout = _layout(340) | {
        "xaxis": AXIS | {"title": axis_title(escape(text)), "zeroline": False},
        "yaxis": AXIS | {"title": axis_title(percent)},
        "annotations": [figure_heading("Learned shape, with its 95 % band", 1.0)],
    }
    return {"data": data, "layout": layout}


def _points(x: FloatArray, y: FloatArray, marked: Any, colour: str, name: str) -> dict[str, Any]:
    return {
        "type": "scatter",
        "mode": "lines+markers",
        "x": _floats(x),
        "y": _floats(y),
        "name": name,
        "line": {"color": colour, "width": 1.8},
        "marker": {
            "size": [9 if mark else 4 for mark in marked],
            "color": [colour if mark else "#ffffff" for mark in marked],
            "line": {"color": colour, "width": 1.4},
        },
        "hovertemplate": "%{y:.1f} mm/s",
    }


@dataclass(frozen=True, slots=True)
class Recorded:
    """A wheel's speed as recorded, shape (n,), m/s."""

    wheel: Wheel
    t_s: FloatArray
    speed_mps: FloatArray


def run_traces(trace: RunTraces, *, named: bool, left_out: Recorded | None = None) -> Figure:
    """Measured and simulated speeds of one run above, their residuals below.

    Parameters
    ----------
    left_out : the wheel that the diagnosis left out; it is drawn as recorded, by itself.
    """
    data: list[dict[str, Any]] = []
    middle = trace.t_s - 0.5 * trace.interval_s
    for column, wheel in enumerate(WHEELS):
        if left_out is not None and left_out.wheel == wheel:
            line = {"color": COLOURS[wheel], "width": 1.2, "dash": "dot"}
            name = f"{wheel}, recorded (not trusted)"
            data.append(_curve(left_out.t_s, left_out.speed_mps, name, line))
            continue
        group = {"legendgroup": wheel}
        measured = np.where(trace.valid[:, column], trace.measured[:, column], np.nan)
        colour = COLOURS[wheel]
        data.append(_curve(middle, measured, f"{wheel}, measured", {"color": colour, "width": 2.2}) | group)
        line = {"color": colour, "width": 1.3, "dash": "dash"}
        data.append(_curve(middle, trace.refit[:, column], f"{wheel}, refitted", line) | group)
        below = {"yaxis": "y2", "showlegend": False} | group
        left = measured - trace.refit[:, column]
        data.append(_curve(middle, left, f"{wheel}, refitted", line | {"dash": "solid"}) | below)
        if named:
            line = {"color": colour, "width": 1.6, "dash": "dot"}
            name = f"{wheel}, with effects"
            data.append(_curve(middle, trace.model[:, column], name, line) | group)
            data.append(_curve(middle, measured - trace.model[:, column], name, line) | below)
    layout = _layout(480) | {
        "hovermode": "x unified",
        "xaxis": AXIS | {"title": axis_title("time, s"), "anchor": "y2", "zeroline": False},
        "yaxis": AXIS | {"title": axis_title("speed at the rim, m/s"), "domain": [0.42, 1.0]},
        "yaxis2": AXIS | {"title": axis_title("residual, m/s"), "domain": [0.0, 0.32]},
        "annotations": [
            figure_heading(escape(trace.run), 1.0),
            figure_heading("Measured less simulated", 0.32),
        ],
    }
    layout["margin"] = {"l": 58, "r": 12, "t": 34, "b": 104}
    return {"data": data, "layout": layout}


def pose_windows(diagnosis: Diagnosis, *, named: bool) -> Figure | None:
    """Pose residuals over short windows, all runs end to end: forward, sideways, heading."""
    parts = [(trace, trace.pose) for trace in diagnosis.traces if trace.pose is not None]
    if not parts:
        return None
    data: list[dict[str, Any]] = []
    times = np.concatenate([trace.start_s + pose.t_end_s - trace.t_s[0] for trace, pose in parts])
    layout = _layout(520)
    heights = ((0.72, 1.0), (0.36, 0.64), (0.0, 0.28))
    rows = zip(("forward, mm", "to the left, mm", "heading, mrad"), heights, strict=True)
    notes = []
    for k, (title, domain) in enumerate(rows):
        suffix = "" if k == 0 else str(k + 1)
        layout[f"yaxis{suffix}"] = AXIS | {"domain": list(domain)}
        notes.append(figure_heading(title, domain[1]))
        curves = [("refitted", BASE, [pose.refit for _, pose in parts])]
        if named:
            curves.append(("with the named effects", MODEL, [pose.model for _, pose in parts]))
        for name, colour, values in curves:
            data.append(
                {
                    "type": "scatter",
                    "mode": "markers",
                    "x": _floats(times),
                    "y": _floats(1e3 * np.concatenate(values)[:, k]),
                    "marker": {"color": colour, "size": 5},
                    "name": name,
                    "showlegend": k == 0,
                    "yaxis": f"y{suffix}",
                    "hovertemplate": "%{y:.1f}",
                }
            )
    layout["xaxis"] = AXIS | {"title": axis_title("time since the first run, s"), "anchor": "y3"}
    layout["annotations"] = notes
    return {"data": data, "layout": layout}


def ranking(diagnosis: Diagnosis) -> Figure | None:
    """Log-likelihood gain of each fitted effect or set of effects."""
    fitted = [entry for entry in diagnosis.ranking if entry.fitted and np.isfinite(entry.improvement)]
    fitted.sort(key=lambda entry: -entry.improvement)
    shown = fitted[:MAX_RANKED][::-1]
    if not shown:
        return None
    chosen = {effect.name for effect in diagnosis.effects}
    colours = [MODEL if chosen and set(entry.names) <= chosen else BASE for entry in shown]
    data = {
        "type": "bar",
        "orientation": "h",
        "x": [round(max(entry.improvement, 0.0), 2) for entry in shown],
        "y": [" + ".join(name.replace("_", " ") for name in entry.names) for entry in shown],
        "marker": {"color": colours},
        "hovertemplate": "%{x:.1f}<extra></extra>",
    }
    layout = _layout(HEADER_PX + BAR_PX * len(shown), legend=False) | {
        "xaxis": AXIS | {"title": axis_title("penalised gain of log-likelihood over the refitted baseline")},
        "yaxis": AXIS | {"automargin": True, "ticks": ""},
        "annotations": [figure_heading("All fits, the best first", 1.0)],
    }
    layout["margin"] = {"l": 190, "r": 16, "t": 34, "b": 48}
    return {"data": [data], "layout": layout}


def splits(diagnosis: Diagnosis) -> Figure | None:
    """Errors on the runs left out, before and after, for each split."""
    if not diagnosis.splits:
        return None
    names = [f"split {k}" for k in range(1, len(diagnosis.splits) + 1)]
    hover = [escape(", ".join(split.judged)) for split in diagnosis.splits]
    bars = (
        ("refitted", BASE, [split.rmse_before for split in diagnosis.splits]),
        ("with the named effects", MODEL, [split.rmse_after for split in diagnosis.splits]),
    )
    data: list[dict[str, Any]] = [
        {
            "type": "bar",
            "name": name,
            "x": names,
            "y": _floats(1e3 * np.array(values)),
            "text": hover,
            "textposition": "none",
            "marker": {"color": colour},
            "hovertemplate": "%{y:.2f} mm/s on %{text}<extra></extra>",
        }
        for name, colour, values in bars[: 2 if diagnosis.effects else 1]
    ]
    floor = [split.noise_floor for split in diagnosis.splits]
    if np.isfinite(floor).all():
        line = {"color": NEUTRAL, "width": 1.4, "dash": "dot"}
        data.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": "noise floor",
                "x": names,
                "y": _floats(1e3 * np.array(floor)),
                "line": line,
            }
        )
    layout = _layout(300) | {
        "barmode": "group",
        "xaxis": AXIS | {"ticks": ""},
        "yaxis": AXIS | {"title": axis_title("error on runs left out, mm/s"), "rangemode": "tozero"},
        "annotations": [figure_heading("Errors on runs left out of the fit", 1.0)],
    }
    return {"data": data, "layout": layout}


def plan_figure(plan: Plan) -> Figure:
    """Efforts of a run plan over time."""
    edges = np.concatenate(([0.0], np.cumsum([segment.duration_s for segment in plan.segments])))
    data = []
    for wheel, values, width in (
        ("left", [segment.a for segment in plan.segments], 3.0),
        ("right", [segment.b for segment in plan.segments], 1.5),
    ):
        side: Wheel = "left" if wheel == "left" else "right"
        line = {"color": COLOURS[side], "width": width, "shape": "hv"}
        efforts = 100.0 * np.array([*values, values[-1]])
        data.append(
            {
                "type": "scatter",
                "mode": "lines",
                "x": _floats(edges),
                "y": _floats(efforts),
                "name": wheel,
                "line": line,
                "hovertemplate": "%{y:.0f} %",
            }
        )
    layout = _layout(270) | {
        "xaxis": AXIS | {"title": axis_title("time, s"), "zeroline": False},
        "yaxis": AXIS | {"title": axis_title("effort, %")},
        "annotations": [figure_heading("The next run", 1.0)],
    }
    layout["margin"] = {"l": 54, "r": 10, "t": 32, "b": 80}
    return {"data": data, "layout": layout}


def interval_svg(parameter: EffectParameter, effect: NamedEffect) -> str:
    """A value with its interval on a line with the others of its unit, as inline SVG."""
    ends = [end for item in effect.parameters.values() if item.unit == parameter.unit for end in item.ci95]
    ends = [end for end in (*ends, 0.0) if np.isfinite(end)]
    low, high = min(ends), max(ends)
    if not high > low or not all(np.isfinite(parameter.ci95)):
        return ""

    def x(value: float) -> float:
        return 6.0 + 108.0 * (min(max(value, low), high) - low) / (high - low)

    a, b = parameter.ci95
    return (
        '<svg class="interval" viewBox="0 0 120 16" width="120" height="16" role="img" aria-label="interval">'
        f'<line x1="6" y1="8" x2="114" y2="8" class="axis"/><line x1="{x(0.0):.1f}" y1="3" x2="{x(0.0):.1f}" '
        f'y2="13" class="axis"/><line x1="{x(a):.1f}" y1="8" x2="{x(b):.1f}" y2="8" class="span"/>'
        f'<circle cx="{x(parameter.value):.1f}" cy="8" r="4" class="dot"/></svg>'
    )


def _layout(height: int, *, legend: bool = True) -> dict[str, Any]:
    layout: dict[str, Any] = {
        "font": FONT,
        "height": height,
        "margin": {"l": 58, "r": 12, "t": 34, "b": 84 if legend else 52},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "hovermode": "closest",
        "showlegend": legend,
    }
    return layout | ({"legend": LEGEND} if legend else {})


def _curve(times: FloatArray, values: FloatArray, name: str, line: dict[str, Any]) -> dict[str, Any]:
    x, y = figure_numbers(times, values)
    return {
        "type": "scatter",
        "mode": "lines",
        "x": x,
        "y": y,
        "name": name,
        "line": line,
        "hovertemplate": "%{y:.3f} m/s",
    }


def _floats(values: FloatArray) -> list[float | None]:
    return [None if value != value else float(f"{value:.5g}") for value in np.asarray(values).tolist()]


def _faint(colour: str) -> str:
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},0.10)"


def _short(name: str) -> str:
    return escape(name if len(name) <= 26 else name[:25] + "…")
