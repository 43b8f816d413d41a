"""One self-contained HTML page about a recording set: what was run, numbers, interactive plots."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

from truing.identify.data_checks import summarise
from truing.identify.identification import Identification
from truing.identify.summary import identified_lines
from truing.identify.tables import fits_csv, result_tables, steps_csv, unstepped
from truing.recording.run import RecordingSet, Run, RunMetadata
from truing.recording.writer import replace_file
from truing.report.figures import run_figures
from truing.report.html_page import html_page, html_table, plot_places
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
    return html_page(
        title=title,
        kicker="truing · identification of a two-wheel robot",
        lead="<br>".join(map(escape, (_lead(recordings), *identified_lines(result, recordings.name)))),
        facts=_facts(_set_facts(recordings, result)),
        findings=_findings(result),
        results=_overlay_section(laid_over) + _results(result),
        runs="".join(
            _run_section(run, view, number)
            for number, (run, view) in enumerate(zip(recordings, views, strict=True), start=1)
        ),
        footer="Speeds are means over each sampling interval, drawn at its middle.",
        figures=figures,
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
    places = plot_places(overlay.name for overlay in laid_over)
    lead = (
        "Runs of one kind over each other: speeds over what the largest level asks for, dashed the inputs "
        "over the largest."
    )
    return f'<h2>Runs laid over each other</h2><p class="lead">{escape(lead)}</p>{places}'


def _download(name: str, text: str) -> str:
    data = base64.b64encode(text.encode("utf-8")).decode("ascii")
    return f'<a download="{name}" href="data:text/csv;base64,{data}">{name}</a>'


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
