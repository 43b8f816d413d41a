"""Content of a comparison: paths, a figure of speeds and residuals, the table of stopping points."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from truing.recording.run import WHEELS
from truing.web.models.comparison import Comparison, Curve
from truing.web.models.error_replay import thinned
from truing.web.views.figures import Line, Panel, panels

# Desired, simulated, simulated with the error model, real: distinguishable by brightness and dash as well.
STYLES = (("#94a1b2", "dash"), ("#5ccfe6", "solid"), ("#d2a8ff", "dot"), ("#ffb454", "solid"))
MORE_COLOURS = ("#7ee787", "#ffcb6b", "#79a8ff", "#ff7b7b")
_CANVAS_DASH = {"solid": [], "dash": [8, 5], "dot": [3, 4]}


def comparison_content(main: Comparison, more: Sequence[Comparison] = ()) -> dict[str, Any]:
    """Everything that a page shows, as plain lists and text."""
    paths = []
    for curve, name, (colour, dash) in zip(main.curves, main.titles, STYLES, strict=True):
        if curve is not None and curve.path is not None:
            paths.append(_path(curve, name, colour, dash))
    for other, colour in zip(more, MORE_COLOURS, strict=False):
        if other.real.path is not None:
            paths.append(_path(other.real, other.run.name, colour, "solid"))
    head = ["", *main.titles]
    rows = main.stopping_points()
    for other in more:
        head.append(other.run.name)
        for row, extra in zip(rows, other.stopping_points(), strict=True):
            row.append(extra[4])
    rows.append(["speed error, mm/s", "–", *(_rms_text(main, curve) for curve in main.curves[1:3]), "0.0"])
    rows[-1] += ["–"] * len(more)
    return {
        "run": main.run.name,
        "paths": paths,
        "figure": _figure(main),
        "head": head,
        "rows": rows,
        "notes": list(main.notes),
        "rms": {name: speed_error(main, index) for index, name in ((1, "simulated"), (2, "modelled"))},
    }


def speed_error(main: Comparison, index: int) -> float | None:
    """Root mean square of both wheels' residuals against a column, m/s; None where it has no speeds."""
    curve = main.curves[index]
    if curve is None:
        return None
    left, right = (main.residual(wheel, curve) for wheel in WHEELS)
    if left is None or right is None:
        return None
    both = np.concatenate((left, right))
    return float(np.sqrt(np.nanmean(both**2)))


def _rms_text(main: Comparison, curve: Any) -> str:
    index = next((k for k, one in enumerate(main.curves) if one is curve and curve is not None), None)
    error = None if index is None else speed_error(main, index)
    return "–" if error is None else f"{1e3 * error:.1f}"


def _path(curve: Curve, name: str, colour: str, dash: str) -> dict[str, Any]:
    assert curve.path is not None
    rows = thinned(np.column_stack((curve.path, curve.t_s)))
    return {
        "points": [row[:3] for row in rows],
        "t": [row[3] for row in rows],
        "title": name,
        "colour": colour,
        "dash": _CANVAS_DASH[dash],
        "css": dash,
    }


def comparison_csv(main: Comparison) -> str:
    """Speeds of all columns and residuals as CSV, at the times of the real one."""
    head, columns = ["t_s"], [main.real.t_s]
    for wheel in WHEELS:
        for curve, name in zip(main.curves, main.titles, strict=True):
            speed = None if curve is None else curve.speed(wheel)
            if curve is not None and speed is not None:
                head.append(f"{wheel}, {name} (m/s)")
                columns.append(np.interp(main.real.t_s, curve.t_s, speed))
        for curve, name in zip(main.curves[1:3], main.titles[1:3], strict=True):
            residual = None if curve is None else main.residual(wheel, curve)
            if residual is not None:
                head.append(f"{wheel}, {main.titles[3]} minus {name} (m/s)")
                columns.append(residual)
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(np.column_stack(columns).tolist())
    return out.getvalue()


def _figure(main: Comparison) -> dict[str, Any]:
    parts = []
    for wheel in WHEELS:
        lines = []
        for curve, name, (colour, dash) in zip(main.curves, main.titles, STYLES, strict=True):
            speed = None if curve is None else curve.speed(wheel)
            if curve is not None and speed is not None:
                lines.append(Line(name, curve.t_s, speed, colour, dash))
        parts.append(Panel(f"{wheel}, m/s", lines))
    residuals = []
    for index in (1, 2):
        for wheel, dash in (("left", "solid"), ("right", "dot")):
            curve = main.curves[index]
            values = None if curve is None else main.residual("left" if wheel == "left" else "right", curve)
            if values is not None:
                # Measured minus simulated; of a real robot or a virtual one.
                name = f"{wheel} residual" + (" (model)" if index == 2 else "")
                residuals.append(Line(name, main.real.t_s, values, STYLES[index][0], dash, 1.2))
    if residuals:
        parts.append(Panel("residual, m/s", residuals))
    return panels(parts, revision=main.run.name)
