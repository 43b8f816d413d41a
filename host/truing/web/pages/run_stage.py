"""A run from disk and its simulations: paths, speeds and table, redrawn on every change."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import context, ui

from truing.errors import TruingError, with_next
from truing.web.models.error_model import ModelChoice
from truing.web.pages.address import Address
from truing.web.pages.components import Plot, TopView
from truing.web.pages.elements import PlainTable, button, heading, notify, tag, tick
from truing.web.pages.redraw import Redraw
from truing.web.pages.run_choice import NO_RUNS, RunChoice
from truing.web.session import ViewSession
from truing.web.views.figures import empty_figure

_BUSY = "simulating …"


class RunStage:
    """The views of the selected run, and its selection.

    Parameters
    ----------
    address : where the choice of run, zoom and pan are kept.
    model : returns the error model of the third column, called at each redraw.
    on_drawn : called with the content after each redraw.
    """

    def __init__(
        self,
        session: ViewSession,
        address: Address,
        model: Callable[[], ModelChoice],
        on_drawn: Callable[[dict[str, Any]], None] | None = None,
    ) -> None:
        self.session = session
        self.address = address
        self.model = model
        self.on_drawn = on_drawn or (lambda _: None)
        self.more: list[Path] = []
        self._more_names = address.text("more").split(",")
        self.draw = Redraw(self._draw)
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
            self.top = TopView(
                "The paths of the run and its simulations", "paths", fitted=True, address=self.address
            )
            with tag("div", classes="overlay"):
                button("Fit", self.top.fit)
                self.legend = tag("div", classes="legend boxed")
            label = "Speeds of both wheels against time, and residuals"
            self.plot = Plot(label, exact=True, address=self.address)
            self.plot.on("csv", self._csv, [])

    def choice(self) -> None:
        """The lists of sets and runs."""
        self.runs = RunChoice(self.session, self.address, self._chosen, self.show_more)
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
        others = [] if home is None else [path for path in home.runs if path != self.run]
        named, self._more_names = self._more_names, []
        self.more = [path for path in others if path in self.more or path.stem in named][-4:]
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
                tick(f"also draw {path.stem}", path.stem, path in self.more, partial(self.add, path))

    def add(self, path: Path, wanted: bool) -> None:
        """Draw another run as well, or remove it."""
        if wanted and path not in self.more:
            self.more = [*self.more, path][-4:]
        elif not wanted and path in self.more:
            self.more.remove(path)
        self.address.write(more=",".join(path.stem for path in self.more))
        self.draw()

    # ---- drawing

    async def _draw(self) -> None:
        run = self.run
        if run is None:
            self._clear(NO_RUNS)
            return
        if run != self._shown:
            self._clear(f"{run.stem}: {_BUSY}")
        self._set_status(_BUSY)
        try:
            found = await self.session.simulation.ask(self._request(run))
        except TruingError as error:
            if run == self.run and not self.plot.is_deleted:
                self._clear(f"{run.stem} cannot be shown", with_next(error))
            return
        if run == self.run and not self.plot.is_deleted:
            self._shown = run
            with self._client:
                self._show(found)

    def _request(self, run: Path) -> dict[str, Any]:
        return {
            "kind": "compare",
            "run": str(run),
            "more": [str(path) for path in self.more],
            "model": self.model().to_json(),
            "start": self.session.comparison_start.as_list(),
        }

    async def _csv(self) -> None:
        """Download speeds and residuals at the run's own rate."""
        run = self.run
        if run is None:
            return
        try:
            found = await self.session.simulation.ask(self._request(run) | {"csv": True})
        except TruingError as error:
            notify(with_next(error), good=False)
            return
        ui.download.content(found["text"], f"{run.stem}-compared.csv", "text/csv")

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
        has_curves = figure and any(panel["lines"] for panel in figure["panels"])
        title = "" if self.run is None else f"{self.runs.name}, {self.run.stem}: speeds and residuals"
        self.plot.show(figure if has_curves else empty_figure(why_empty), title)
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
