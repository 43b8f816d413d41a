"""The report of a fleet: a page for all, and one for each robot, which open anywhere."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from html import escape
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.present.text import HEADINGS, effect_title
from truing.fleet import wording
from truing.fleet.analysis import Analysis
from truing.fleet.drift import Change
from truing.fleet.part import plain
from truing.fleet.series import TITLES, Series, day_text
from truing.fleet.sisters import RobotNumber
from truing.fleet.storage import Place
from truing.fleet.tables import Tables
from truing.identify.tables import PlainTable
from truing.report.figures import AXIS, FONT, LEGEND, Figure, axis_title, figure_heading
from truing.report.html_page import html_page, html_table, plot_places
from truing.report.run_view import COLOURS, REFERENCE

FOLDER = "report"
DAYS_OF_A_WEEK = 7.0
WRITERS = 8
MAX_ERRORS = 50


def write_report(out: Place, tables: Tables, analysis: Analysis, say: Callable[[str], None]) -> None:
    """Write `report/index.html`, and `report/robots/NAME.html` for each robot."""
    sets: list[dict[str, Any]] = tables.sets.to_pylist()
    by_robot: dict[str, list[dict[str, Any]]] = {}
    for row in sets:
        by_robot.setdefault(row["robot"], []).append(row)
    pages = _Pages(analysis)

    def write(robot: str) -> None:
        (out / f"{FOLDER}/{_page_of(robot)}").write(pages.robot(robot, by_robot[robot]).encode("utf-8"))

    with ThreadPoolExecutor(WRITERS) as pool:
        list(pool.map(write, by_robot))
    index = out / f"{FOLDER}/index.html"
    index.write(index_page(analysis, sets).encode("utf-8"))
    say(f"written: {index.url}")


def index_page(analysis: Analysis, sets: Sequence[Mapping[str, Any]]) -> str:
    """The page for the whole fleet."""
    robots = sorted({row["robot"] for row in sets})
    bad = [row for row in sets if row["error"]]
    lead = "<br>".join(
        escape(line) for line in wording.summary_lines(analysis, len(sets), len(robots), len(bad))
    )
    days = sorted(row["recorded"] for row in sets)
    facts = {
        "Robots": str(len(robots)),
        "Recording sets": str(len(sets)),
        "Without numbers or verdict": str(len(bad)),
        "From": days[0].date().isoformat() if days else "–",
        "To": days[-1].date().isoformat() if days else "–",
    }
    parts = [
        "<h2>Wear and other changes</h2>",
        _table(wording.change_table(analysis.drifting, analysis.rate)),
        _table(wording.trend_table(analysis.trends)),
        "<h2>Robots beside their sisters</h2>",
        _table(wording.difference_table(analysis.differing, analysis.rate)),
        "<h2>Missing effects</h2>",
        *_effect_tables(analysis),
        "<h2>Every robot</h2>",
        html_table(_robot_table(analysis, sets, robots)),
    ]
    if bad:
        errors = PlainTable("Sets with an error", ["Set", "Robot", "Error"], [False, False, False])
        errors.rows = [[str(row["set"]), str(row["robot"]), str(row["error"])] for row in bad[:MAX_ERRORS]]
        if len(bad) > MAX_ERRORS:
            errors.remarks.append(f"{len(bad) - MAX_ERRORS} more are in sets.parquet.")
        parts.append(f"<h2>Errors</h2>{html_table(errors)}")
    return html_page(
        title=f"A fleet of {len(robots)} robots",
        kicker="truing · fleet",
        lead=lead,
        facts=_facts(facts),
        results=_linked("".join(parts), {robot: _page_of(robot) for robot in robots}),
        figures={},
    )


class _Pages:
    """The robots' pages, which share the sisters' numbers."""

    def __init__(self, analysis: Analysis) -> None:
        self.analysis = analysis
        self.series = _grouped(analysis.series, lambda one: one.robot)
        self.numbers = _grouped(analysis.numbers, lambda one: one.robot)
        self.changes = _grouped(analysis.changes, lambda one: one.series.robot)

    def robot(self, robot: str, sets: Sequence[Mapping[str, Any]]) -> str:
        """The page of one robot."""
        changes = [one for one in self.changes.get(robot, []) if one.is_found]
        numbers: list[RobotNumber] = self.numbers.get(robot, [])
        differing = [one for one in numbers if one.differs]
        lines = [f"{wording.change_text(one)}." for one in changes]
        lines += [f"{wording.difference_text(one)}." for one in differing]
        lines = lines or ["Nothing changes with time, and nothing sets it apart from its sisters."]
        figures = self._figures(robot, numbers)
        effects = sorted(self.analysis.robots.get(robot, set()))
        parts = [html_table(wording.own_table(numbers))] if numbers else []
        parts.append("<h2>Over time</h2>" + plot_places(figures, "min-height:320px") if figures else "")
        if effects:
            names = ", ".join(escape(effect_title(name)) for name in effects)
            parts.append(f'<h2>Missing effects</h2><div class="said"><p>{names}</p></div>')
        parts.append("<h2>Its recordings</h2>" + html_table(_set_table(sets)))
        return html_page(
            title=robot,
            kicker='truing · <a href="../index.html">fleet</a>',
            lead="<br>".join(map(escape, lines)),
            results="".join(parts),
            figures=figures,
        )

    def _figures(self, robot: str, numbers: Sequence[RobotNumber]) -> dict[str, Figure]:
        centres = {(one.parameter, one.wheel): one.centre for one in numbers}
        found = {
            (one.series.parameter, one.series.wheel): one
            for one in self.changes.get(robot, [])
            if one.is_found
        }
        own: list[Series] = self.series.get(robot, [])
        begin = min((float(one.t_days[0]) for one in own), default=0.0)
        out: dict[str, Figure] = {}
        for parameter in dict.fromkeys(one.parameter for one in own):
            both = [one for one in own if one.parameter == parameter]
            out[f"over-{parameter}"] = _figure(both, begin, centres, found)
        return out


def _figure(
    both: Sequence[Series],
    begin: float,
    centres: Mapping[tuple[str, str], float],
    found: Mapping[tuple[str, str], Change],
) -> Figure:
    """One parameter of both wheels over the weeks: values with intervals, sisters' median, found changes."""
    data: list[dict[str, Any]] = []
    for one in both:
        key = one.parameter, one.wheel
        colour = COLOURS["left" if one.wheel == "left" else "right"]
        weeks = (one.t_days - begin) / DAYS_OF_A_WEEK
        gap = np.full(len(one), np.nan)
        low, high = one.value - 1.96 * one.sigma, one.value + 1.96 * one.sigma
        ends = np.column_stack((low, high, gap)).ravel()
        data.append(_trace(np.repeat(weeks, 3), ends, f"{one.wheel}, 95 %", {"color": colour, "width": 1.0}))
        marks = _trace(weeks, one.value, f"{one.wheel}, each set", {"color": colour})
        data.append(marks | {"mode": "markers", "marker": {"color": colour, "size": 5}, "showlegend": False})
        span = weeks[[0, -1]]
        if np.isfinite(centres.get(key, np.nan)):
            line = {"color": REFERENCE, "width": 1.2, "dash": "dash" if one.wheel == "left" else "dot"}
            data.append(_trace(span, np.full(2, centres[key]), f"sisters, {one.wheel}", line))
        if key in found:
            fine = np.linspace(one.t_days[0], one.t_days[-1], 200)
            line = {"color": colour, "width": 2.5}
            data.append(
                _trace((fine - begin) / DAYS_OF_A_WEEK, found[key].curve(fine), f"{one.wheel}, change", line)
            )
    first = both[0]
    title = TITLES.get(first.parameter, first.parameter)
    layout = {
        "font": FONT,
        "height": 320,
        "margin": {"l": 64, "r": 12, "t": 34, "b": 84},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "hovermode": "closest",
        "showlegend": True,
        "legend": LEGEND,
        "xaxis": AXIS | {"title": axis_title(f"weeks since {day_text(begin)}"), "zeroline": False},
        "yaxis": AXIS | {"title": axis_title(f"{title}, {first.unit}"), "zeroline": False},
        "annotations": [figure_heading(title.capitalize(), 1.0)],
    }
    return {"data": data, "layout": layout}


def _trace(x: FloatArray, y: FloatArray, name: str, line: dict[str, Any]) -> dict[str, Any]:
    numbers = [None if value != value else float(f"{value:.6g}") for value in y.tolist()]
    return {
        "type": "scatter",
        "mode": "lines",
        "x": [round(value, 3) for value in x.tolist()],
        "y": numbers,
        "name": name,
        "line": line,
        "hovertemplate": "%{y:.4f}",
    }


def _robot_table(analysis: Analysis, sets: Sequence[Mapping[str, Any]], robots: Sequence[str]) -> PlainTable:
    counts = _grouped(sets, lambda row: str(row["robot"]))
    changed = {one.series.robot for one in analysis.drifting}
    differing = {one.robot for one in analysis.differing}
    table = PlainTable(
        "",
        ["Robot", "Sets", "Last", "Changes", "Differs", "Effects"],
        [False, True, False, False, False, False],
    )
    for robot in robots:
        last = max(row["recorded"] for row in counts[robot]).date().isoformat()
        effects = ", ".join(effect_title(name) for name in sorted(analysis.robots.get(robot, set())))
        yes = ["yes" if robot in group else "" for group in (changed, differing)]
        table.rows.append([robot, str(len(counts[robot])), last, *yes, effects])
    return table


def _set_table(sets: Sequence[Mapping[str, Any]]) -> PlainTable:
    table = PlainTable(
        "",
        ["Recorded", "Set", "Runs", "Verdict", "Error refitted", "Noise floor"],
        [False, False, True, False, True, True],
    )
    for row in sets:
        verdict = row["error"] or HEADINGS.get(row["verdict"], "") or row["status"].replace("_", " ")
        sizes = [
            "–" if row[name] is None else f"{row[name]:.3g} {row['rmse_unit']}"
            for name in ("refit_rmse", "noise_floor")
        ]
        recorded = row["recorded"].strftime("%Y-%m-%d %H:%M")
        table.rows.append(
            [recorded, row["set"], "–" if row["runs"] is None else str(row["runs"]), verdict, *sizes]
        )
    return table


def _table(table: PlainTable) -> str:
    if not table.rows:
        return f'<div class="said"><p>{escape(table.title)}: none.</p></div>'
    return html_table(table)


def _effect_tables(analysis: Analysis) -> list[str]:
    if not analysis.robots:
        return ['<div class="said"><p>No set has been diagnosed.</p></div>']
    found = [one for one in analysis.pairs if one.is_found]
    tables = (wording.effect_table(analysis.robots), wording.pair_table(found, analysis.rate))
    return [_table(table) for table in tables]


def _facts(values: Mapping[str, str]) -> str:
    items = [
        f'<div><dt>{name}</dt><dd class="big">{escape(text)}</dd></div>' for name, text in values.items()
    ]
    return f'<dl class="facts">{"".join(items)}</dl>'


def _linked(html: str, pages: Mapping[str, str]) -> str:
    """The robots' names in the tables lead to their pages."""
    targets = {escape(robot): page for robot, page in pages.items()}

    def link(cell: re.Match[str]) -> str:
        page = targets.get(cell[1])
        return cell[0] if page is None else f'<td><a href="{escape(page)}">{cell[1]}</a></td>'

    return re.sub(r"<td>([^<]+)</td>", link, html)


def _page_of(robot: str) -> str:
    return f"robots/{plain(robot)}.html"


def _grouped(items: Iterable[Any], key: Callable[[Any], str]) -> dict[str, list[Any]]:
    out: dict[str, list[Any]] = {}
    for item in items:
        out.setdefault(key(item), []).append(item)
    return out
