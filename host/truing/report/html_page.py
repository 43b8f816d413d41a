"""What the HTML pages have in common: their frame, their tables, the places of their figures."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from html import escape
from importlib import resources
from string import Template
from typing import Any

from truing import __version__
from truing.identify.tables import PlainTable
from truing.report.figures import Figure, slimmed


def html_page(
    *,
    title: str,
    kicker: str,
    lead: str,
    figures: Mapping[str, Figure],
    facts: str = "",
    findings: str = "",
    results: str = "",
    runs: str = "",
    written: str = "",
    footer: str = "",
) -> str:
    """A whole page, which opens anywhere, without a network.

    Parameters
    ----------
    title : plain text; the other parts are HTML.
    figures : by the ids of their places (`plot_places`).
    written : what stands in the footer behind the program and its version, before a full stop.
    """
    template = Template(resources.files("truing").joinpath("report/page.html").read_text("utf-8"))
    return template.substitute(
        title=escape(title),
        kicker=kicker,
        lead=lead,
        facts=facts,
        findings=findings,
        results=results,
        runs=runs,
        footer=f"Written by truing {escape(__version__)}{written}.{footer and ' '}{footer}",
        plots=_plot_script(),
        figures=_script_json(slimmed(figures)),
    )


def plot_places(names: Iterable[str], style: str = "") -> str:
    """Places for figures of these names, one below the other."""
    styled = f' style="{style}"' if style else ""
    return "".join(
        f'<div class="plots single"><div class="plot" id="{name}"{styled}></div></div>' for name in names
    )


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


def _plot_script() -> str:
    """What draws the figures."""
    return resources.files("truing").joinpath("report/plots.js").read_text("utf-8")


def _script_json(value: Any) -> str:
    """JSON that may stand inside a script element, whatever names the user's files have."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False, ensure_ascii=True)
    return text.replace("<", "\\u003c")
