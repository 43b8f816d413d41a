"""A run from disk beside its simulations: picture, speeds and table, drawn anew on every change."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

from nicegui import background_tasks, context

from truing.errors import TruingError
from truing.web.elements import Chart, PlainTable, TopView, button, heading, tag
from truing.web.error_model import ModelChoice
from truing.web.figures import nothing
from truing.web.pages.run_choice import NO_RUNS, RunChoice
from truing.web.session import ViewSession

_BUSY = "simulating …"


class RunStage:
    """The picture of the run that is chosen, and the choice.

    Parameters
    ----------
    model : what the third column is made with, asked at each drawing.
    on_drawn : told what came of it.
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
        self._wanted = False
        self._busy = False
        self._client = context.client

    @property
    def run(self) -> Path | None:
        """The run that is chosen."""
        return self.runs.run

    # ---- elements

    def picture(self, label: str) -> None:
        """Floor above, speeds below."""
        with tag("section", classes="stage", aria_label=label):
            self.top = TopView("The paths of the run and its simulations", "paths", fitted=True)
            with tag("div", classes="overlay"):
                button("Fit", self.top.fit)
                self.legend = tag("div", classes="legend boxed")
            self.chart = Chart("Speeds of both wheels against time, and residuals", height_px=300)

    def choice(self) -> None:
        """Which run."""
        self.runs = RunChoice(self.session, self._chosen)
        self.told = tag("p", classes="told dim", role="status", style="margin:4px 0 0")
        self.find()

    def beside(self) -> None:
        """Other runs of the set, drawn beside it."""
        self.more_box = tag("details", classes="more-runs")
        self.show_more()

    def table(self) -> None:
        """The stopping points."""
        heading("Stopping points")
        self.points = PlainTable("Stopping points")

    # ---- choosing

    def find(self, chosen: Path | None = None) -> None:
        """Look for runs on disk; choose one, or the newest."""
        self.runs.find(chosen)

    def _chosen(self) -> None:
        home = self.runs.home
        others = set() if home is None else set(home.runs) - {self.run}
        self.more = [path for path in self.more if path in others]
        self.show_more()
        self.draw()

    def show_more(self) -> None:
        """The other runs of the set, to tick."""
        box = getattr(self, "more_box", None)
        if box is None:
            return
        box.clear()
        home = self.runs.home
        others = [path for path in home.runs if path != self.run] if home is not None else []
        with box:
            tag("summary", f"Real paths of other runs of this set ({len(others)})")
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
        """Draw another run beside, or no more."""
        if wanted and path not in self.more:
            self.more = [*self.more, path][-4:]
        elif not wanted and path in self.more:
            self.more.remove(path)
        self.draw()

    # ---- drawing

    def draw(self) -> None:
        """Draw soon; many wishes while one is being drawn become one."""
        self._wanted = True
        if not self._busy:
            self._busy = True
            background_tasks.create(self._draw())

    async def _draw(self) -> None:
        try:
            while self._wanted:
                self._wanted = False
                if self.run is None:
                    self.chart.update_figure(nothing(NO_RUNS))
                    return
                start = self.session.comparison_start
                request = {
                    "kind": "compare",
                    "run": str(self.run),
                    "more": [str(path) for path in self.more],
                    "model": self.model().to_json(),
                    "start": start.as_list(),
                }
                self._say(_BUSY)
                try:
                    found = await self.session.simulation.ask(request)
                except TruingError as error:
                    self._say(str(error))
                    continue
                with self._client:
                    self._show(found)
                await asyncio.sleep(0)
        finally:
            self._busy = False

    def _show(self, found: dict[str, Any]) -> None:
        self._say(" ".join(f"{note}." for note in found["notes"]))
        self.top.set(paths=found["paths"])
        self.chart.update_figure(
            found["figure"] if found["figure"]["data"] else nothing("this run has no speeds")
        )
        self.legend.clear()
        with self.legend:
            for path in found["paths"]:
                tag("span", path["title"], f"dash-{path['css']}", style=f"--c:{path['colour']}")
        if hasattr(self, "points"):
            self.points.fill(found["head"], found["rows"])
        self.on_drawn(found)

    def _say(self, text: str) -> None:
        if text == self.told._text:
            return
        self.told._text = text
        self.told.update()
