"""Draws a run as a PNG: wheel speeds, efforts, and the path of the robot."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from truing.extras import require
from truing.recording.writer import replace_file
from truing.report.run_view import COLOURS, NEUTRAL, REFERENCE, PathView, RunView

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DOTS_PER_INCH = 150
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#8a8a8a",
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.7,
    "xtick.color": "#4a4a4a",
    "ytick.color": "#4a4a4a",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
}
PATH_LABELS = {"odometry": "on-board odometry", "wheel travel": "computed from wheel travel"}
# The right wheel is drawn thinner and on top, so that equal curves still show both.
LINE_WIDTHS = (2.6, 1.2)
# Heading marks along the path.
HEADINGS = 12


def save_png(view: RunView, path: str | Path) -> Path:
    """Draw a run and write it at `path`."""
    path = Path(path)
    replace_file(path, render_png(view))
    return path


def render_png(view: RunView) -> bytes:
    """Draw a run; the picture's bytes depend on nothing but the view."""
    require("plots")
    # matplotlib costs a quarter of a second to import; commands that draw nothing do not pay it.
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        wide = view.path is not None
        figure = Figure(figsize=(12.0 if wide else 8.4, 6.2), layout="constrained")
        canvas = FigureCanvasAgg(figure)
        widths = [8, 5] if wide else [1]
        grid = figure.add_gridspec(2, len(widths), height_ratios=[5, 2], width_ratios=widths)
        speeds = figure.add_subplot(grid[0, 0])
        efforts = figure.add_subplot(grid[1, 0], sharex=speeds)
        _draw_speeds(speeds, view)
        _draw_efforts(efforts, view)
        if view.path is not None:
            _draw_path(figure.add_subplot(grid[:, 1]), view.path)
        figure.suptitle(_heading(view), x=0.01, ha="left", fontsize=13, fontweight="bold")
        figure.supxlabel(_footer(view), x=0.01, ha="left", fontsize=8, color="#6a6a6a")
        out = io.BytesIO()
        canvas.print_png(out, metadata={"Software": "truing"}, pil_kwargs=None)  # type: ignore[no-untyped-call]
        return out.getvalue()


def _heading(view: RunView) -> str:
    return view.title if view.title == view.name else f"{view.title}  ({view.name})"


def _footer(view: RunView) -> str:
    parts = [] if view.path is not None else [view.path_reason]
    metadata = view.metadata
    if metadata is not None:
        version, board = metadata.firmware.get("version"), metadata.firmware.get("board")
        parts += [f"firmware {version}"] if version else []
        parts += [f"board {board}"] if board else []
        parts += [f"seed {metadata.seed}"] if metadata.seed is not None else []
    return "   ".join(parts)


def _draw_speeds(axes: Axes, view: RunView) -> None:
    axes.axhline(0.0, color="#b0b0b0", linewidth=0.8)
    # Measured first, then command, then model: the legend pairs the wheels in columns.
    for (wheel, curves), width in zip(view.wheels, LINE_WIDTHS, strict=True):
        label = f"{wheel}, measured"
        axes.plot(view.middle_s, curves.speed, color=COLOURS[wheel], linewidth=width, zorder=3, label=label)
    for wheel, curves in view.wheels:
        if curves.commanded is None or (view.same_command and wheel == "right"):
            continue
        colour, who = (NEUTRAL, "both") if view.same_command else (COLOURS[wheel], wheel)
        axes.step(
            view.t_s, curves.commanded, where="pre", color=colour, linewidth=1.1, linestyle="--", alpha=0.85,
            label=f"{who}, {view.commanded_label}",
        )  # fmt: skip
    for wheel, curves in view.wheels:
        if curves.simulated is not None:
            axes.plot(
                view.middle_s, curves.simulated, color=COLOURS[wheel], linewidth=1.2, linestyle=(0, (1, 1.3)),
                label=f"{wheel}, model (free run)",
            )  # fmt: skip
    axes.set_title("Wheel speed")
    axes.set_ylabel("speed at the rim, m/s")
    axes.tick_params(labelbottom=False)
    axes.margins(x=0.01, y=0.08)
    count = len(axes.get_legend_handles_labels()[1])
    columns = (count + 1) // 2
    place: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}
    axes.legend(ncols=columns, columnspacing=1.4, **place)


def _draw_efforts(axes: Axes, view: RunView) -> None:
    axes.axhline(0.0, color="#b0b0b0", linewidth=0.8)
    for (wheel, curves), width in zip(view.wheels, LINE_WIDTHS, strict=True):
        axes.step(view.t_s, curves.effort, where="pre", color=COLOURS[wheel], linewidth=width, label=wheel)
    axes.set_title("Applied effort")
    axes.set_ylabel("effort, % of supply")
    axes.set_xlabel("time, s")
    axes.margins(x=0.01, y=0.12)


def _draw_path(axes: Axes, path: PathView) -> None:
    if path.reference is not None:
        axes.plot(*path.reference, color=REFERENCE, linewidth=1.4, linestyle="--", label="outside reference")
    axes.plot(path.x_m, path.y_m, color=NEUTRAL, linewidth=1.7, label=PATH_LABELS[path.source])
    marks = _heading_rows(path)
    if marks:
        axes.quiver(
            path.x_m[marks], path.y_m[marks], np.cos(path.theta_rad[marks]), np.sin(path.theta_rad[marks]),
            color=NEUTRAL, angles="xy", scale=26, width=0.006, headwidth=4.5, alpha=0.6, pivot="mid",
        )  # fmt: skip
    ends = ((0, "o", "white", "start"), (-1, "s", NEUTRAL, "end"))
    for row, marker, fill, name in ends:
        x, y = float(path.x_m[row]), float(path.y_m[row])
        axes.plot(x, y, marker, color=fill, markeredgecolor=NEUTRAL, markersize=6.5, zorder=4)
        axes.annotate(name, (x, y), xytext=(0, 9), textcoords="offset points", ha="center", fontsize=8.5)
    axes.set_title(f"Path on the floor ({PATH_LABELS[path.source]})")
    axes.set_xlabel("x, forward at the start, m")
    axes.set_ylabel("y, to the left at the start, m")
    low_x, high_x, low_y, high_y = path_window(path)
    axes.set_xlim(low_x, high_x)
    axes.set_ylim(low_y, high_y)
    axes.set_aspect("equal", adjustable="box")
    axes.set_anchor("N")
    if path.reference is not None:
        axes.legend(loc="best")


def path_window(path: PathView) -> tuple[float, float, float, float]:
    """Low and high x, low and high y (m): the path with room around it, and never a slit.

    A straight run is a metre long and a millimetre wide; drawn to scale it needs air at its sides.
    """
    xs, ys = [path.x_m], [path.y_m]
    if path.reference is not None:
        xs.append(path.reference[0])
        ys.append(path.reference[1])
    x, y = np.concatenate(xs), np.concatenate(ys)
    size = max(float(np.ptp(x)), float(np.ptp(y)), 0.1)
    half_x = max(0.58 * float(np.ptp(x)), 0.28 * size)
    half_y = max(0.58 * float(np.ptp(y)), 0.28 * size)
    middle_x, middle_y = 0.5 * float(x.min() + x.max()), 0.5 * float(y.min() + y.max())
    return middle_x - half_x, middle_x + half_x, middle_y - half_y, middle_y + half_y


def _heading_rows(path: PathView) -> list[int]:
    """Rows at even distances along the path, for its heading marks; none when it never moves."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(path.x_m), np.diff(path.y_m)))))
    if along[-1] == 0.0:
        return []
    places = np.linspace(0.0, along[-1], HEADINGS + 2)[1:-1]
    return [int(row) for row in np.unique(np.minimum(np.searchsorted(along, places), along.size - 1))]
