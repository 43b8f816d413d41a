"""A run from disk and its simulations: paths, speeds and table, redrawn on every change."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

from nicegui import background_tasks, context

from truing.errors import TruingError
from truing.web.models.error_model import ModelChoice
from truing.web.pages.components import Chart, TopView
from truing.web.pages.elements import PlainTable, button, heading, tag
from truing.web.pages.run_choice import NO_RUNS, RunChoice
from truing.web.session import ViewSession
from truing.web.views.figures import empty_figure

_BUSY = "simulating …"


class RunStage:
    """The views of the selected run, and its selection.

    Parameters
    ----------
    model : returns the error model of the third column, called at each redraw.
    on_drawn : called with the content after each redraw.
    """

    def __init__(
        self,
        session: ViewSession,
        model: Callable[[], ModelChoice],
        on_drawn: Callable[[dict[str, Any]], None] | None = None,
    ) -> None:
        self.session = session
        self.model = model
        self.on_drawn = on_drawn or (lambda _: None)
        self.more: list[Path] = []
        self._requested = False
        self._busy = False
        self._shown: Path | None = None
        self._client = context.client

    @property
    def run(self) -> Path | None:
        """The selected run."""
        return self.runs.run

    # ---- elements

    def picture(self, label: str) -> None:
        """Path view above, speeds below."""
        with tag("section", classes="stage", aria_label=label):
            self.top = TopView("The paths of the run and its simulations", "paths", fitted=True)
            with tag("div", classes="overlay"):
                button("Fit", self.top.fit)
                self.legend = tag("div", classes="legend boxed")
            self.chart = Chart("Speeds of both wheels against time, and residuals", height_px=300)

    def choice(self) -> None:
        """The lists of sets and runs."""
        self.runs = RunChoice(self.session, self._chosen)
        self.status = tag("p", classes="note dim", role="status", style="margin:4px 0 0")
        self.find()

    def other_runs(self) -> None:
        """Selection of other runs of the set to draw as well."""
        self.more_box = tag("details", classes="more-runs")
        self.show_more()

    def table(self) -> None:
        """The stopping points."""
        heading("Stopping points")
        self.points = PlainTable("Stopping points")

    # ---- choosing

    def find(self, chosen: Path | None = None) -> None:
        """Search the disk for runs; select `chosen`, or the newest."""
        self.runs.find(chosen)

    def _chosen(self) -> None:
        home = self.runs.home
        others = set() if home is None else set(home.runs) - {self.run}
        self.more = [path for path in self.more if path in others]
        self.show_more()
        self.draw()

    def show_more(self) -> None:
        """Check boxes of the other runs of the set."""
        box = getattr(self, "more_box", None)
        if box is None:
            return
        box.clear()
        home = self.runs.home
        others = [path for path in home.runs if path != self.run] if home is not None else []
        with box:
            tag("summary", f"Measured paths of other runs of this set ({len(others)})")
            for path in others:
                with tag("label", classes="tick"):
                    mark = tag("input", type="checkbox", aria_label=f"also draw {path.stem}")
                    if path in self.more:
                        mark._props["checked"] = True
                    mark.on(
                        "change",
                        lambda event, path=path: self.add(path, event.args is True),
                        js_handler="(e) => emit(e.target.checked)",
                    )
                    tag("span", path.stem)

    def add(self, path: Path, wanted: bool) -> None:
        """Draw another run as well, or remove it."""
        if wanted and path not in self.more:
            self.more = [*self.more, path][-4:]
        elif not wanted and path in self.more:
            self.more.remove(path)
        self.draw()

    # ---- drawing

    def draw(self) -> None:
        """Request a redraw; requests during a redraw are merged into one."""
        self._requested = True
        if not self._busy:
            self._busy = True
            background_tasks.create(self._draw())

    async def _draw(self) -> None:
        try:
            while self._requested:
                self._requested = False
                run = self.run
                if run is None:
                    self._clear(NO_RUNS)
                    return
                if run != self._shown:
                    self._clear(f"{run.stem}: {_BUSY}")
                start = self.session.comparison_start
                request = {
                    "kind": "compare",
                    "run": str(run),
                    "more": [str(path) for path in self.more],
                    "model": self.model().to_json(),
                    "start": start.as_list(),
                }
                self._set_status(_BUSY)
                try:
                    found = await self.session.simulation.ask(request)
                except TruingError as error:
                    if run == self.run:
                        self._clear(f"{run.stem} cannot be shown", str(error))
                    continue
                if run == self.run:
                    self._shown = run
                    with self._client:
                        self._show(found)
                await asyncio.sleep(0)
        finally:
            self._busy = False

    def _clear(self, why: str, status: str = "") -> None:
        """Show nothing of another run; say why nothing is shown."""
        self._shown = None
        with self._client:
            self._show({"paths": [], "figure": None, "head": [], "rows": [], "notes": [], "rms": {}}, why)
        self._set_status(status)

    def _show(self, found: dict[str, Any], why_empty: str = "this run has no speeds") -> None:
        self._set_status(" ".join(f"{note}." for note in found["notes"]))
        self.top.set(paths=found["paths"])
        figure = found["figure"]
        self.chart.update_figure(figure if figure and figure["data"] else empty_figure(why_empty))
        self.legend.clear()
        with self.legend:
            for path in found["paths"]:
                tag("span", path["title"], f"dash-{path['css']}", style=f"--c:{path['colour']}")
        if hasattr(self, "points"):
            self.points.fill(found["head"], found["rows"])
        self.on_drawn(found)

    def _set_status(self, text: str) -> None:
        if text == self.status._text:
            return
        self.status._text = text
        self.status.update()
