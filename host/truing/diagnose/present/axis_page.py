"""The page of a single axis: its words instead of wheels' in the text, and one side in the figures."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from truing.diagnose.present.cells import Located
from truing.recording.axis import Axis
from truing.report.figures import Figure

_TEXT = re.compile(r"(?<=>)[^<>]+(?=<)")
_SIDE = re.compile(r"^(?:left|right)(?: wheel)?, ")


def said(html: str, axis: Axis | None) -> str:
    """HTML whose text speaks of the axis; tags stay as they are."""
    if axis is None:
        return html
    # A parameter that a wheel's name stands for is the effect's only one.
    return _TEXT.sub(lambda found: "value" if found.group() == "left" else axis.text(found.group()), html)


def of_left(located: Located, axis: Axis | None) -> Located:
    """The cells and bins of the side that stands for the axis."""
    if axis is None:
        return located
    return replace(
        located,
        cells=tuple(cell for cell in located.cells if cell.wheel == "left"),
        bins=tuple(bins for bins in located.bins if bins.wheel == "left"),
    )


def figures_of(figures: Mapping[str, Figure], axis: Axis | None) -> dict[str, Figure]:
    """Figures without the curves of the other side, their names and titles those of the axis."""
    if axis is None:
        return dict(figures)
    return {name: _figure(figure, axis) for name, figure in figures.items()}


def _figure(figure: Figure, axis: Axis) -> Figure:
    traces = [_named(trace, axis) for trace in figure["data"] if not _is_right(trace)]
    layout = dict(figure["layout"])
    for key, part in layout.items():
        if key[1:5] == "axis" and "title" in part:
            layout[key] = part | {"title": part["title"] | {"text": axis.text(part["title"]["text"])}}
    notes = layout.get("annotations", [])
    layout["annotations"] = [note | {"text": _plain(note["text"], axis)} for note in notes]
    return {"data": traces, "layout": layout}


def _is_right(trace: dict[str, Any]) -> bool:
    name = str(trace.get("name", ""))
    return name == "right" or name.startswith("right,")


def _named(trace: dict[str, Any], axis: Axis) -> dict[str, Any]:
    if "name" not in trace:
        return trace
    name = "effort" if trace["name"] == "left" else _plain(str(trace["name"]), axis)
    return trace | {"name": name}


def _plain(text: str, axis: Axis) -> str:
    bare = text.removeprefix("<b>").removesuffix("</b>")
    return axis.text(_SIDE.sub("", bare))
