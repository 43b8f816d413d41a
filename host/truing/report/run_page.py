"""One self-contained HTML page about a recording set: what was run, numbers, interactive plots."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from html import escape
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

from truing import __version__
from truing.identify.data_checks import summarise
from truing.identify.identification import Identification
from truing.identify.summary import identified_lines
from truing.identify.tables import PlainTable, fits_csv, result_tables, steps_csv, unstepped
from truing.recording.run import RecordingSet, Run, RunMetadata
from truing.recording.writer import replace_file
from truing.report.figures import Figure, run_figures, slimmed
from truing.report.overlays import Overlay, overlay_figure, overlays
from truing.report.run_view import RunView, view_run


def save_report(recordings: RecordingSet, result: Identification, path: str | Path) -> Path:
    """Write the page at `path`; it opens anywhere, without a network."""
    path = Path(path)
    replace_file(path, render_report(recordings, result).encode("utf-8"))
    return path


def render_report(recordings: RecordingSet, result: Identification) -> str:
    """The whole page; it depends on nothing but the recordings and the result."""
    views = [view_run(run, recordings.robot, result.whole_fits) for run in recordings]
    figures = {
        f"{kind}-{number}": figure
        for number, view in enumerate(views, start=1)
        for kind, figure in run_figures(view).items()
    }
    laid_over = overlays(recordings, result) if len(recordings) > 1 else []
    figures |= {overlay.name: overlay_figure(overlay) for overlay in laid_over}
    title = views[0].title if len(views) == 1 else recordings.name
    template = Template(resources.files("truing").joinpath("report/page.html").read_text("utf-8"))
    return template.substitute(
        title=escape(title),
        kicker="truing · identification of a two-wheel robot",
        lead="<br>".join(map(escape, (_lead(recordings), *identified_lines(result, recordings.name)))),
        facts=_facts(_set_facts(recordings, result)),
        findings=_findings(result),
        results=_overlay_section(laid_over) + _results(result),
        runs="".join(
            _run_section(run, view, number)
            for number, (run, view) in enumerate(zip(recordings, views, strict=True), start=1)
        ),
        footer=f"Written by truing {escape(__version__)}. "
        "Speeds are means over each sampling interval, drawn at its middle.",
        plots=plot_script(),
        figures=figures_json(figures),
    )


def _lead(recordings: RecordingSet) -> str:
    total = sum(run.duration_s for run in recordings)
    count = "One run" if len(recordings) == 1 else f"{len(recordings)} runs"
    return f"{count}, {total:.1f} s in all."


def _set_facts(recordings: RecordingSet, result: Identification) -> dict[str, str]:
    rates = sorted({round(run.rate_hz, 1) for run in recordings})
    sources = {"ticks": "encoder counts", "vel": "recorded speed", "pos": "recorded position"}
    facts = {
        "Log rate": ", ".join(f"{rate:g} Hz" for rate in rates),
        "Wheel speed from": ", ".join(sorted({sources[run.source] for run in result.runs})),
    }
    robot = recordings.robot
    if robot is not None:
        facts |= {
            name: f"{value:g}{unit}"
            for name, value, unit in (
                ("Wheel radius", robot.wheel_radius_m, " m"),
                ("Wheelbase", robot.wheelbase_m, " m"),
                ("Counts per revolution", robot.counts_per_rev, ""),
            )
            if value is not None
        }
    first = recordings.runs[0].metadata
    if first is not None:
        for name, label in (("version", "Firmware"), ("board", "Board")):
            if name in first.firmware:
                facts[label] = str(first.firmware[name])
        if first.seed is not None:
            facts["Seed"] = str(first.seed)
    return facts


def _facts(facts: Mapping[str, str]) -> str:
    if not facts:
        return ""
    items = [f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in facts.items()]
    return f'<dl class="facts">{"".join(items)}</dl>'


def _findings(result: Identification) -> str:
    lines = summarise(result.findings)
    if not lines:
        return ""
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f'<h2>What looks wrong with the data</h2><ul class="findings">{items}</ul>'


def _results(result: Identification) -> str:
    parts = ["<h2>Results</h2>"]
    parts += [html_table(table) for table in result_tables(result)]
    reasons = [f"<p>{escape(line)}</p>" for line in unstepped(result)]
    if reasons:
        parts.append(f'<div class="notes">{"".join(reasons)}</div>')
    downloads = (("steps.csv", steps_csv(result)), ("first_order.csv", fits_csv(result)))
    links = [_download(name, text) for name, text in downloads if text]
    parts.append(f'<p class="tools">{"".join(links)}</p>')
    return "".join(parts)


def _overlay_section(laid_over: list[Overlay]) -> str:
    if not laid_over:
        return ""
    places = "".join(
        f'<div class="plots single"><div class="plot" id="{overlay.name}"></div></div>'
        for overlay in laid_over
    )
    lead = (
        "Runs of one kind over each other: speeds over what the largest level asks for, dashed the inputs "
        "over the largest."
    )
    return f'<h2>Runs laid over each other</h2><p class="lead">{escape(lead)}</p>{places}'


def _download(name: str, text: str) -> str:
    data = base64.b64encode(text.encode("utf-8")).decode("ascii")
    return f'<a download="{name}" href="data:text/csv;base64,{data}">{name}</a>'


def html_table(table: PlainTable) -> str:
    """A table as HTML, its notes and remarks below it."""

    def cell(tag: str, text: str, numeric: bool) -> str:
        kind = ' class="number"' if numeric else ""
        return f"<{tag}{kind}>{_marked(text)}</{tag}>"

    head = "".join(cell("th", name, number) for name, number in zip(table.header, table.numeric, strict=True))
    body = []
    for row, begins_group in table.grouped():
        # A line above each new run or wheel lets the eye find its rows.
        first = ' class="first"' if begins_group else ""
        cells = "".join(cell("td", text, number) for text, number in zip(row, table.numeric, strict=True))
        body.append(f"<tr{first}>{cells}</tr>")
    notes = [f"<p><sup>{number}</sup> {escape(note)}</p>" for number, note in enumerate(table.notes, start=1)]
    notes += [f"<p>{escape(remark)}</p>" for remark in table.remarks]
    return (
        f'<div class="scroll"><table><caption>{escape(table.title)}</caption><thead><tr>{head}</tr></thead>'
        f'<tbody>{"".join(body)}</tbody></table></div><div class="notes">{"".join(notes)}</div>'
    )


def _marked(text: str) -> str:
    """A cell with its note marks raised and the wheels in their colours."""
    if text in ("left", "right"):
        return f'<span class="{text}">{text}</span>'
    return escape(text).replace("[", "<sup>").replace("]", "</sup>").replace("\n", "<br>")


def _run_section(run: Run, view: RunView, number: int) -> str:
    heading = "<h2>Runs</h2>" if number == 1 else ""
    path = f'<div class="plot" id="path-{number}"></div>' if view.path is not None else ""
    reason = f'<p class="lead">{escape(view.path_reason)}</p>' if view.path is None else ""
    named = f"{view.name}: {view.title}" if view.title != view.name else view.name
    layout = "plots" if view.path is not None else "plots single"
    return (
        f'{heading}<section class="run"><h3>{escape(named)}</h3><p class="lead">{escape(_run_line(run))}</p>'
        f'<div class="{layout}"><div class="plot" id="speeds-{number}"></div>{path}</div>'
        f"{reason}{_metadata(run.metadata)}</section>"
    )


def _run_line(run: Run) -> str:
    parts = [f"{run.duration_s:.2f} s", f"{len(run)} rows at {run.rate_hz:.4g} Hz"]
    if "battery_v" in run.columns:
        battery = run.columns["battery_v"]
        parts.append(f"supply {battery.min():.2f} to {battery.max():.2f} V")
    pose = run.pose()
    if pose is not None:
        x, y, theta = (float(values[-1]) for values in pose)
        parts.append(f"odometry ends at x {x:.3f} m, y {y:.3f} m, heading {theta:.3f} rad")
    if run.metadata is not None and run.metadata.pause_before_s is not None:
        parts.append(f"{run.metadata.pause_before_s:.1f} s after the run before")
    return ", ".join(parts)


def _metadata(metadata: RunMetadata | None) -> str:
    if metadata is None:
        return ""
    sections: list[tuple[str, Mapping[str, Any]]] = [
        ("Plan", metadata.plan),
        ("Parameters", metadata.parameters),
        ("Firmware", metadata.firmware),
        ("More", metadata.extra),
    ]
    parts = []
    for name, values in sections:
        if values:
            parts.append(f"<details><summary>{name}</summary>{_facts(_flat(values))}</details>")
    return "".join(parts)


def _flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    """Nested values as dotted names and text."""
    flat: dict[str, str] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{name}.")
        elif isinstance(value, list) and any(isinstance(item, Mapping) for item in value):
            for number, item in enumerate(value, start=1):
                text = ", ".join(f"{key} {_text(part)}" for key, part in item.items())
                flat[f"{prefix}{name} {number}"] = text
        else:
            flat[f"{prefix}{name}"] = _text(value)
    return flat


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def plot_script() -> str:
    """What draws the figures, so that a page needs no network."""
    return resources.files("truing").joinpath("report/plots.js").read_text("utf-8")


def figures_json(figures: Mapping[str, Figure]) -> str:
    """The figures of a page for its script, with no more points than the page may have in all."""
    return script_json(slimmed(figures))


def script_json(value: Any) -> str:
    """JSON that may stand inside a script element, whatever names the user's files have."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False, ensure_ascii=True)
    return text.replace("<", "\\u003c")
