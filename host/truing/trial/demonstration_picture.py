"""The demonstration as one picture: where the simulation was wrong, and what the correction is worth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from truing.diagnose.present.text import effect_title, joined
from truing.report.png import save_picture
from truing.report.run_view import NEUTRAL

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from truing.trial.demonstration import Curves, Demonstration

SIZE_IN = (12.0, 6.6)
MEASURED, GIVEN, MODEL, PLACE = "#1c2430", "#d1495b", "#1f7a8c", "#f6d98f"
# The recorded run is shown from so long before the strongest span to so long after it.
AROUND_S = (4.0, 2.0)


def save_demonstration(demonstration: Demonstration, path: Path) -> Path:
    """Draw the located span, an unseen run before and after, and the errors on all unseen runs."""

    def draw(figure: Figure) -> None:
        grid = figure.add_gridspec(2, 2, width_ratios=[2.6, 1])
        unseen = figure.add_subplot(grid[1, 0])
        if demonstration.recorded is not None:
            recorded = figure.add_subplot(grid[0, 0])
            _draw_curves(recorded, demonstration.recorded, "Recorded run")
            _draw_places(recorded, demonstration)
        _draw_curves(unseen, demonstration.unseen, "Unseen run")
        unseen.set_xlim(unseen.dataLim.x0, unseen.dataLim.x1)
        unseen.set_xlabel("time, s")
        handles, labels = unseen.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower left", ncols=3)
        _draw_errors(figure.add_subplot(grid[:, 1]), demonstration)
        figure.suptitle(_heading(demonstration), x=0.01, ha="left", fontsize=13, fontweight="bold")

    return save_picture(path, SIZE_IN, draw)


def _heading(demonstration: Demonstration) -> str:
    named = joined([effect_title(effect.name) for effect in demonstration.diagnosis.effects]) or "nothing"
    concealed = joined([effect_title(name) for name, _ in demonstration.concealed])
    return f"Concealed: {concealed}.   Named before the seal was opened: {named}."


def _draw_places(axes: Axes, demonstration: Demonstration) -> None:
    """Shade the spans in which the diagnosis found the mismatch of this run and wheel."""
    place = demonstration.place
    assert place is not None
    for span in demonstration.diagnosis.mismatch:
        if (span.run, span.signal) == (place.run, place.signal):
            strength = 0.75 if span is place else 0.3
            axes.axvspan(span.t_start_s, span.t_end_s, color=PLACE, alpha=strength, linewidth=0.0)
    axes.annotate(
        f"located: {place.regime}",
        (0.5 * (place.t_start_s + place.t_end_s), 0.97),
        xycoords=("data", "axes fraction"),
        ha="center",
        va="top",
        fontsize=9,
        color=NEUTRAL,
    )
    axes.set_xlim(max(0.0, place.t_start_s - AROUND_S[0]), place.t_end_s + AROUND_S[1])


def _draw_curves(axes: Axes, curves: Curves, kind: str) -> None:
    # A row's speed is a mean over the interval that ends there, and is drawn at the interval's middle.
    middle_s = curves.t_s[1:] - 0.5 * np.diff(curves.t_s)
    before, after = (1e3 * error for error in curves.errors)
    axes.axhline(0.0, color="#b0b0b0", linewidth=0.8)
    axes.plot(middle_s, curves.measured[1:], color=MEASURED, linewidth=2.4, alpha=0.55, label="measured")
    axes.plot(middle_s, curves.given[1:], color=GIVEN, linewidth=1.3, label="simulated before (as given)")
    axes.plot(
        middle_s,
        curves.model[1:],
        color=MODEL,
        linewidth=1.3,
        linestyle=(0, (3, 1.2)),
        label="simulated after (with what was found)",
    )
    axes.set_title(f"{kind} {curves.run}, {curves.wheel} wheel: {before:.1f} mm/s before, {after:.1f} after")
    axes.set_ylabel("speed at the rim, m/s")
    axes.margins(y=0.12)


def _draw_errors(axes: Axes, demonstration: Demonstration) -> None:
    bars = (
        ("as\ngiven", demonstration.given_mps, GIVEN),
        ("numbers\nrefitted", demonstration.refitted_mps, "#e0a3ac"),
        ("with what\nwas found", demonstration.model_mps, MODEL),
        ("noise", demonstration.noise_mps, "#b9c0c8"),
    )
    values = [1e3 * value for _, value, _ in bars]
    axes.bar([name for name, _, _ in bars], values, color=[colour for *_, colour in bars], width=0.7)
    for position, value in enumerate(values):
        axes.text(position, value, f"{value:.1f}", ha="center", va="bottom", fontsize=9)
    axes.set_title(f"Error on {len(demonstration.unseen_runs)} unseen runs")
    axes.set_ylabel("RMS of free-run simulation, mm/s")
    axes.grid(visible=False, axis="x")
