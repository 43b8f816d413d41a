"""Writes what `truing fit` found into a folder: one interactive page, and every table as CSV and PNG."""

from __future__ import annotations

import json
import re
from html import escape
from pathlib import Path
from typing import Any

from truing.identify.model_ladder import SetModels
from truing.identify.model_tables import model_tables
from truing.identify.simulate import Simulation, simulate
from truing.identify.summary import fitted_lines
from truing.progress import Progress
from truing.recording.run import RecordingSet, Run, Wheel
from truing.recording.writer import replace_file
from truing.report.figures import Figure, figure_numbers, speeds_layout
from truing.report.html_page import html_page, html_table, plot_places
from truing.report.png import save_table
from truing.report.run_view import COLOURS


def save_fit(recordings: RecordingSet, models: SetModels, folder: Path, progress: Progress) -> list[Path]:
    """Write report.html, fit.json and tables/; returns the files, the report first."""
    figures = {}
    for number, run in enumerate(recordings, start=1):
        figures[f"fit-{number}"] = _figure(run, _simulations(run, recordings, models))
        progress(0.5 * number / len(recordings))
    texts = {
        "report.html": _page(recordings, models, figures),
        "fit.json": json.dumps(models.to_json(), indent=2, allow_nan=False) + "\n",
    }
    for name, text in texts.items():
        replace_file(folder / name, text.encode("utf-8"))
    written = [folder / name for name in texts]
    tables = model_tables(models)
    for done, table in enumerate(tables, start=1):
        name = re.sub(r"[^a-z0-9]+", "_", table.title.lower()).strip("_")
        replace_file(folder / "tables" / f"{name}.csv", table.to_csv().encode("utf-8"))
        written += [folder / "tables" / f"{name}.csv", save_table(table, folder / "tables" / f"{name}.png")]
        progress(0.5 + 0.5 * done / len(tables))
    return written


def _simulations(run: Run, recordings: RecordingSet, models: SetModels) -> dict[Wheel, Simulation]:
    return {
        wheel.wheel: simulate(wheel.chosen.physics, run, wheel.wheel, recordings.robot)
        for wheel in models.wheels
    }


def _trace(simulation: Simulation, values: Any, name: str, **style: Any) -> dict[str, Any]:
    x, y = figure_numbers(simulation.t_s, values)
    hover = {"hovertemplate": "%{y:.4f} m/s"}
    return {"type": "scatter", "mode": "lines", "x": x, "y": y, "name": name} | hover | style


def _figure(run: Run, simulations: dict[Wheel, Simulation]) -> Figure:
    """Measured and simulated speed above, what the model leaves over below."""
    traces = []
    for wheel, simulation in simulations.items():
        colour, error = COLOURS[wheel], simulation.speed_mps - simulation.measured_mps
        solid = {"color": colour, "width": 2}
        dotted = {"color": colour, "width": 1.5, "dash": "dot"}
        traces += [
            _trace(simulation, simulation.measured_mps, f"{wheel}, measured", line=solid),
            _trace(simulation, simulation.speed_mps, f"{wheel}, model (free run)", line=dotted),
            _trace(
                simulation, error, f"{wheel}, model less measured", yaxis="y2", showlegend=False,
                line={"color": colour, "width": 1},
            ),
        ]  # fmt: skip
    layout = speeds_layout(escape(run.name), "Model less measured", "error, m/s")
    return {"data": traces, "layout": layout}


def _page(recordings: RecordingSet, models: SetModels, figures: dict[str, Figure]) -> str:
    return html_page(
        title=models.name,
        kicker="truing · models of a two-wheel robot",
        lead="<br>".join(map(escape, fitted_lines(models, recordings.name)))
        + "<br>"
        + escape(
            f"{len(recordings)} runs. Every model is fitted to all of them and judged by free-run "
            "simulation, which sees the efforts and never the measured speeds; left-out runs were not "
            "used in their fit."
        ),
        results="<h2>Models</h2>" + "".join(html_table(table) for table in model_tables(models)),
        runs=f"<h2>The chosen models against the runs</h2>{plot_places(figures)}",
        figures=figures,
    )
