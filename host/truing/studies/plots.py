"""Pictures of the papers' studies: PNG by matplotlib."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from truing.arrays import FloatArray
from truing.report.png import save_picture
from truing.report.run_view import COLOURS, NEUTRAL, REFERENCE
from truing.studies.bakirci_gains import GainStudy, GainTable, Rung, predict
from truing.studies.bakirci_models import ModelStudy
from truing.studies.mom_odometry import PRINTED_MODEL, REAL, MomStudy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PIVOT, STRAIGHT, THIRD = COLOURS["right"], COLOURS["left"], REFERENCE


def save_gains(study: GainStudy, path: Path) -> Path:
    """Printed gains over effort with the curves of three rungs, and the errors of every rung."""

    def draw(figure: Figure) -> None:
        gains, errors = figure.subplots(1, 2, width_ratios=[7, 6])
        _draw_gains(gains, study)
        _draw_errors(errors, study)
        figure.suptitle(
            "What the paper's linear model leaves out of its own gains",
            x=0.01, ha="left", fontsize=13, fontweight="bold",
        )  # fmt: skip

    return save_picture(path, (12.0, 5.2), draw)


def rung_curve(rung: Rung, theta: FloatArray, *, pivots: bool) -> tuple[FloatArray, FloatArray]:
    """Effort (%) and steady gain of a rung from rest, shape (n,) each."""
    effort = np.linspace(0.10, 0.65, 111)
    static = np.array(theta)
    if "remainder" in rung.parameters:
        static[rung.parameters.index("remainder")] = 0.0
    flat = np.zeros_like(effort)
    there = np.full(effort.shape, pivots)
    table = GainTable(("",) * len(effort), there, effort, flat, flat, flat)
    return 100.0 * effort, predict(rung, static, table)


def _draw_gains(axes: Axes, study: GainStudy) -> None:
    table = study.table
    shown = (study.ladder[0], study.ladder[1], study.best)
    styles: tuple[Any, ...] = (":", (0, (5, 2)), "-")
    for fit, style in zip(shown, styles, strict=True):
        name = fit.rung.name.removeprefix("+ ")
        name = name if fit is shown[0] else f"up to {name}"
        axes.plot(
            *rung_curve(fit.rung, fit.theta, pivots=False),
            color=STRAIGHT, linestyle=style, linewidth=1.4, label=name,
        )  # fmt: skip
    axes.plot(*rung_curve(study.best.rung, study.best.theta, pivots=True), color=PIVOT, linewidth=1.4)
    up = ~table.pivots & (table.effort > table.previous)
    down = ~table.pivots & ~up
    for rows, marker, colour, name in (
        (up, "^", STRAIGHT, "both wheels, coming up"),
        (down, "v", STRAIGHT, "both wheels, coming down"),
        (table.pivots, "o", PIVOT, "left wheel alone"),
    ):
        axes.plot(
            100.0 * table.effort[rows], table.gain[rows], marker, color=colour, markersize=7,
            markeredgecolor="white", zorder=4, label=name,
        )  # fmt: skip
    for label, row in study.fifteen.items():
        axes.annotate(
            f"{table.gain[row]:.3f}  {label.split(',')[0]}",
            (15.0, table.gain[row]), xytext=(9, -3), textcoords="offset points", fontsize=8.5,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85}, zorder=5,
        )  # fmt: skip
    axes.set_title("Printed gains and steady-state models")
    axes.set_xlabel("effort, % of supply")
    axes.set_ylabel("gain, mm/s per %")
    axes.set_xlim(10.0, 65.0)
    axes.set_ylim(8.5, 15.5)
    axes.legend(loc="lower right")


def _draw_errors(axes: Axes, study: GainStudy) -> None:
    fits = (*study.ladder, *study.alternatives)
    places = np.arange(len(fits))[::-1]
    columns = (
        ([100.0 * fit.mean for fit in fits], "o", STRAIGHT, "mean, fitted"),
        ([100.0 * fit.worst for fit in fits], "s", PIVOT, "worst, fitted"),
        ([100.0 * fit.left_out_mean for fit in fits], "D", THIRD, "mean, test left out"),
    )
    for values, marker, colour, name in columns:
        axes.plot(values, places, marker, color=colour, markersize=7, markeredgecolor="white", label=name)
    axes.axvline(100.0 * study.static_floor[0], color=NEUTRAL, linewidth=1.0, linestyle="--")
    axes.annotate(
        "floor of any model\nwithout memory, mean", (100.0 * study.static_floor[0], places[0] + 0.42),
        xytext=(5, 0), textcoords="offset points", fontsize=8, color=NEUTRAL, va="center",
    )  # fmt: skip
    axes.set_xscale("log")
    axes.set_xticks([1, 2, 5, 10, 20, 50], ["1", "2", "5", "10", "20", "50"])
    axes.minorticks_off()
    axes.set_yticks(places, [fit.rung.name for fit in fits])
    axes.set_ylim(-0.7, len(fits) - 0.2)
    axes.axhline(len(study.alternatives) - 0.5, color="#b0b0b0", linewidth=0.8)
    axes.set_title("Relative error of the gain")
    axes.set_xlabel("error, % (logarithmic)")
    axes.legend(loc="lower right", frameon=True, facecolor="white", edgecolor="none")


def save_models(study: ModelStudy, path: Path) -> Path:
    """Left wheel of XVII and XVI: measured, and what models of other runs simulate."""
    panels = (
        ("XVII by models of XI (effort)", [("XI", "XVII", "effort")]),
        ("XVI by models of XV (velocity)", [("XV", "XVI", "velocity")]),
        (
            "XVII by models of XV: the unit of the input",
            [("XV", "XVII", "per cent as mm/s"), ("XV", "XVII", "effort × gain of XI")],
        ),
    )
    colours = {"ARX": COLOURS["right"], "state space": REFERENCE, "grey box": COLOURS["left"]}

    def draw(figure: Figure) -> None:
        rows = figure.subplots(len(panels), 1)
        for axes, (title, wanted) in zip(rows, panels, strict=True):
            measured = False
            for exercise in study.exercises:
                key = (exercise.fitted_to, exercise.judged_on, exercise.input)
                if key not in wanted or (len(wanted) > 1 and exercise.model != "ARX"):
                    continue
                times, speed, simulated = exercise.curves[0]
                if not measured:
                    axes.plot(times, speed, color=NEUTRAL, linewidth=2.6, alpha=0.55, label="measured, left")
                    measured = True
                name = exercise.model if len(wanted) == 1 else f"{exercise.model}, {exercise.input}"
                dashed = exercise.input == "per cent as mm/s"
                axes.plot(
                    times, simulated, color=colours[exercise.model], linewidth=1.3,
                    linestyle="--" if dashed else "-", label=f"{name}: {exercise.percent[0]:.1f} %",
                )  # fmt: skip
            axes.set_title(title)
            axes.set_ylabel("speed, m/s")
            axes.margins(x=0.01)
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        rows[-1].set_xlabel("time, s")
        figure.suptitle(
            "Models on runs they never saw (free run)", x=0.01, ha="left", fontsize=13, fontweight="bold"
        )

    return save_picture(path, (11.0, 8.4), draw)


def save_mom(study: MomStudy, path: Path) -> Path:
    """The line of Table 2 under every error model."""
    styles: tuple[tuple[str, Any], ...] = (
        (NEUTRAL, "-"),
        (COLOURS["left"], "-"),
        (COLOURS["left"], ":"),
        (COLOURS["right"], "-"),
        (REFERENCE, "-"),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for line, (colour, style) in zip(study.replays, styles, strict=True):
            scale, drift = line.model.scale, line.model.straight
            label = f"{line.name}\n({scale:+.4f}, {drift:+.4f} rad/m)"
            axes.plot(
                line.path[:, 0], line.path[:, 1], color=colour, linestyle=style, linewidth=1.8, label=label
            )
            x, y, theta = line.path[-1].tolist()
            axes.annotate(
                "", (x + 0.14 * math.cos(theta), y + 0.14 * math.sin(theta)), (x, y),
                arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.5},
            )  # fmt: skip
        for pose, marker, name, side in (
            (REAL, "*", "real robot, printed", 10),
            (PRINTED_MODEL, "X", "simulated with model, printed", -16),
        ):
            axes.plot(
                pose.x_m, pose.y_m, marker, color="black", markersize=11, markeredgecolor="white", zorder=5
            )
            axes.annotate(
                name, (pose.x_m, pose.y_m), xytext=(6, side), textcoords="offset points", fontsize=8.5
            )
        axes.plot(0.5, 0.5, "o", color="white", markeredgecolor=NEUTRAL, markersize=7, zorder=5)
        axes.annotate(
            "start", (0.5, 0.5), xytext=(0, -16), textcoords="offset points", ha="center", fontsize=8.5
        )
        axes.set_aspect("equal", adjustable="box")
        axes.set_xlim(0.3, 3.75)
        axes.set_ylim(0.3, 2.75)
        axes.set_xlabel("x, m")
        axes.set_ylabel("y, m")
        axes.set_title("MOM Simulator View, Table 2: one straight line under each error model")
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), labelspacing=0.9)

    return save_picture(path, (11.0, 5.0), draw)
