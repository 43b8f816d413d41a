"""A picture of what an import makes of a table: every column of a run over time, as HTML or PNG."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truing.errors import OutputError
from truing.recording.run import Run
from truing.recording.writer import replace_file
from truing.report.figures import AXIS, FONT, Figure, axis_title, figure_heading, figure_numbers
from truing.report.html_page import html_page, plot_places
from truing.report.png import save_picture
from truing.report.run_view import COLOURS, NEUTRAL

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

HEIGHT_PX = 210


def save_preview(run: Run, labels: Mapping[str, str], path: Path) -> Path:
    """Write the page or the picture at `path`.

    Parameters
    ----------
    labels : the columns to draw, with their names in the file of the run.
    """
    if path.suffix.lower() == ".png":
        return save_picture(path, (9.0, 0.5 + 1.3 * len(labels)), lambda picture: _draw(picture, run, labels))
    if path.suffix.lower() not in (".html", ".htm"):
        raise OutputError(path, "a preview is .html or .png")
    figures = {f"column-{k}": _figure(run, name, label) for k, (name, label) in enumerate(labels.items())}
    page = html_page(
        title=run.name,
        kicker="truing · preview of an import",
        lead=escape(
            f"{len(run)} rows, {run.duration_s:.4g} s at {run.rate_hz:.4g} Hz, as a run would have them."
        ),
        runs=plot_places(figures, f"min-height:{HEIGHT_PX}px"),
        figures=figures,
    )
    replace_file(path, page.encode("utf-8"))
    return path


def _colour(label: str) -> str:
    sides = label.split("_")
    return COLOURS["left"] if "left" in sides else COLOURS["right"] if "right" in sides else NEUTRAL


def _figure(run: Run, name: str, label: str) -> Figure:
    x, y = figure_numbers(run.t_s, run.columns[name])
    line = {"color": _colour(label), "width": 1.6}
    trace: dict[str, Any] = {"type": "scatter", "mode": "lines", "x": x, "y": y, "name": label, "line": line}
    layout = {
        "font": FONT,
        "height": HEIGHT_PX,
        "margin": {"l": 66, "r": 12, "t": 28, "b": 40},
        "showlegend": False,
        "xaxis": AXIS | {"title": axis_title("time, s"), "zeroline": False},
        "yaxis": AXIS,
        "annotations": [figure_heading(escape(label), 1.0)],
    }
    return {"data": [trace], "layout": layout}


def _draw(picture: Picture, run: Run, labels: Mapping[str, str]) -> None:
    axes = picture.subplots(len(labels), 1, sharex=True, squeeze=False)[:, 0]
    for place, (name, label) in zip(axes, labels.items(), strict=True):
        place.plot(run.t_s, run.columns[name], color=_colour(label), linewidth=1.0)
        place.set_ylabel(label, fontsize=8)
    axes[-1].set_xlabel("time, s")
