"""Figures of the pages: panels of curves over time, as the plot draws them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from truing.arrays import FloatArray

Figure: TypeAlias = dict[str, Any]

COLOURS = ("#ffb454", "#5ccfe6", "#7ee787", "#d2a8ff", "#ff7b7b", "#e6edf5", "#ffcb6b", "#79a8ff")
# More points than screen columns only slow the page down.
MAX_POINTS = 4000


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
