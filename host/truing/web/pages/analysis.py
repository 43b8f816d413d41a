"""Analysis: signals of a run with statistics and step metrics; diagnosis of its set; next experiment."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from nicegui import context, events, ui

from truing.errors import TruingError, with_next
from truing.web.pages.address import Address
from truing.web.pages.components import Plot
from truing.web.pages.diagnosis_card import DiagnosisCard
from truing.web.pages.elements import Choice, PlainTable, button, notify, number, panel, set_text, tag, tick
from truing.web.pages.live import task_panel
from truing.web.pages.redraw import Redraw
from truing.web.pages.run_choice import NO_RUNS, RunChoice
from truing.web.session import ViewSession
from truing.web.views.analysis import STATISTICS_HEAD, STEPS_HEAD, USUAL
from truing.web.views.figures import empty_figure

_VIEWS = {"signals": "Signals", "mismatch": "Mismatch"}
_DRAGS = {"pan": "Pan", "select": "Select"}


class AnalysisPage:
    """Signals of one run, and the diagnosis of its set."""

    def __init__(self, session: ViewSession, address: Address) -> None:
        self.session = session
        self.address = address
        self.client = context.client
        self.selected = [name for name in address.text("signals").split(",") if name] or list(USUAL)
        self.known: list[str] = []
        self.view = address.one_of("view", _VIEWS, "signals")
        self.signals: dict[str, Any] | None = None
        self.diagnosed_set: dict[str, Any] | None = None
        span = address.numbers("span", 2)
        self.span = None if span is None else (span[0], span[1])
        self.draw = Redraw(self._draw)
        self._filling = False
        self.stretches: list[dict[str, Any]] = []
        self._shown: Path | None = None
        self.unreadable = False

    # ---- elements

    def build(self) -> None:
        """Make the elements."""
        with tag("div", classes="view broad"):
            with tag("section", classes="stage", aria_label="Graphs"):
                with tag("div", classes="tools"):
                    self.views = Choice("View", _VIEWS, self.view, self.show_view)
                    Choice("Drag mode", _DRAGS, "pan", lambda tool: self.plot.set(tool=tool))
                    button("Full run", self.show_full_run, label="Show the full run and clear the selection")
                self.plot = Plot("Signals against time", exact=True, address=self.address)
                self.plot.classes("grows")
                self.plot.on("selected", self.dragged).on("csv", self.csv, []).on("picked", self.picked)
            with tag("section", classes="side", aria_label="Run, statistics and diagnosis"):
                with panel("Run"):
                    self.runs = RunChoice(self.session, self.address, self.chose)
                    self.status = tag("p", classes="note dim", role="status", style="margin:4px 0 0")
                with tag("details", classes="more-runs", open="open"):
                    tag("summary", "Signals")
                    self.ticks = tag("div", classes="ticks")
                self._selection()
                self.diagnosis = DiagnosisCard(self.session, self.diagnosed, self.show_stretch)
                with panel("Steps"), tag("div", classes="many"):
                    self.steps = PlainTable("Metrics of every step")
                task_panel()
        self.runs.find()

    def _selection(self) -> None:
        with panel("Statistics of the selection"):
            with tag("div", classes="row-tight"):
                self.first = number(
                    "from, s", 0.0, lambda v: self.set_span(first=v), low=0, high=1e6, step=0.5
                )
                self.last = number("to, s", 0.0, lambda v: self.set_span(last=v), low=0, high=1e6, step=0.5)
            with tag("div", style="margin-top:6px"):
                self.statistics = PlainTable("Statistics of the selection")

    # ---- the run

    def chose(self) -> None:
        """Show another run."""
        if self._shown is not None:
            self._keep_span(None)
        self.show_diagnosis()
        self.draw()

    def select_signal(self, name: str, on: bool) -> None:
        """Draw a signal, or remove it."""
        self.selected = [one for one in self.selected if one != name] + ([name] if on else [])
        self.address.write(signals=",".join(self.selected))
        self.draw()

    def dragged(self, event: events.GenericEventArguments) -> None:
        """A span was selected with the mouse in any panel."""
        first, last = (float(end) for end in event.args)
        self._keep_span((round(first, 3), round(last, 3)))
        self.show_span()
        self.draw()

    def _keep_span(self, span: tuple[float, float] | None) -> None:
        self.span = span
        self.address.write(span="" if span is None else f"{span[0]:g},{span[1]:g}")

    def set_span(self, *, first: float | None = None, last: float | None = None) -> None:
        """Set the ends of the selection by keyboard."""
        if self._filling:
            return
        ends = self.span or (float(self.first.value), float(self.last.value))
        span = (ends[0] if first is None else first, ends[1] if last is None else last)
        if span != self.span:
            self._keep_span(span)
            if span[1] > span[0]:
                self.draw()

    def show_span(self) -> None:
        """Show the selection in its fields."""
        self._fill(*(self.span or (0.0, 0.0)))

    def _fill(self, first: float, last: float) -> None:
        self._filling = True
        self.first.value, self.last.value = round(first, 3), round(last, 3)
        self._filling = False

    def show_full_run(self) -> None:
        """Clear the selection and show the full run."""
        self._keep_span(None)
        self.show_span()
        self.plot.run_method("fit")
        self.draw()

    async def csv(self) -> None:
        """Download the selected signals."""
        if self.runs.run is None:
            return
        try:
            found = await self.session.simulation.ask(self._request("csv"))
        except TruingError as error:
            notify(with_next(error), good=False)
            return
        ui.download.content(found["text"], f"{self.runs.run.stem}.csv", "text/csv")

    def _request(self, kind: str) -> dict[str, Any]:
        span = self.span if self.span is not None and self.span[1] > self.span[0] else None
        return {
            "kind": kind,
            "run": str(self.runs.run),
            "signals": self.selected,
            "span": span,
            "marks": [
                one["span"] for one in self.stretches if self.runs.run and one["run"] == self.runs.run.stem
            ],
        }

    async def _draw(self) -> None:
        run = self.runs.run
        if run is None:
            self._clear("")
            return
        if run != self._shown:
            self._clear("")
        try:
            found = await self.session.simulation.ask(self._request("analyse"))
        except TruingError as error:
            if run == self.runs.run and not self.plot.is_deleted:
                self._clear(with_next(error))
            return
        if run == self.runs.run and not self.plot.is_deleted:
            self._shown = run
            with self.client:
                self._show(found)

    def _clear(self, why: str) -> None:
        """Show nothing of another run; say why nothing is shown."""
        self._shown, self.signals, self.unreadable = None, None, bool(why)
        with self.client:
            set_text(self.status, why)
            self._show_figure()
            self.statistics.fill(STATISTICS_HEAD, [])
            self.steps.fill(STEPS_HEAD, [])

    def _show(self, found: dict[str, Any]) -> None:
        set_text(self.status, "")
        self.signals = found["figure"]
        self._show_figure()
        self.statistics.fill(STATISTICS_HEAD, found["statistics"])
        self.steps.fill(STEPS_HEAD, found["steps"] or [["no steps in this run", *["–"] * 8]])
        if self.span is None:
            self._fill(found["start_s"], found["end_s"])
        else:
            self.show_span()
        names = [signal["name"] for signal in found["signals"]]
        if names != self.known:
            self.known = names
            self._show_ticks(found["signals"])

    def _show_ticks(self, signals: list[dict[str, str]]) -> None:
        self.ticks.clear()
        with self.ticks:
            for signal in signals:
                name = signal["name"]
                tick(name, name, name in self.selected, partial(self.select_signal, name))

    # ---- figures

    def show_view(self, view: str) -> None:
        """Show the signals, or the map of the mismatch."""
        self.view = view
        self.address.write(step=True, view=view)
        self._show_figure()

    def _show_figure(self) -> None:
        is_map = self.view == "mismatch"
        run = self.runs.run
        figure = (self.diagnosed_set or {}).get("map") if is_map else self.signals
        title = self.runs.name if is_map or run is None else f"{self.runs.name}, {run.stem}"
        self.plot.set(exact=not is_map)
        shown = figure is not None and figure["panels"]
        self.plot.show(figure if figure is not None and shown else empty_figure(self._why_empty()), title)

    def _why_empty(self) -> str:
        if self.runs.run is None:
            return NO_RUNS
        if self.view == "mismatch" and self.diagnosed_set is None:
            return "this set has not been diagnosed yet: start a diagnosis on the right"
        if self.view == "mismatch":
            return "this diagnosis has no map of its mismatch: diagnose the set again"
        if self.unreadable:
            return f"{self.runs.run.stem} cannot be shown"
        return "loading …" if self.signals is None else "select signals on the right"

    def show_diagnosis(self) -> None:
        """Show the diagnosis of the selected set."""
        self.diagnosis.show(self.runs.home)

    def diagnosed(self, content: dict[str, Any] | None) -> None:
        """Take over what the diagnosis draws."""
        self.diagnosed_set = content
        self.stretches = (content or {}).get("stretches", [])
        self._show_figure()

    def picked(self, event: events.GenericEventArguments) -> None:
        """A cell of the map was pressed: show that run there."""
        run, span = event.args
        self.show_stretch({"run": str(run), "span": [float(end) for end in span]})

    def show_stretch(self, stretch: dict[str, Any]) -> None:
        """Show a stretch of a run that the finding is about."""
        if not self.runs.show(stretch["run"]):
            notify(f"{stretch['run']} is no longer in this set: press Diagnose this set again", good=False)
            return
        if self.view != "signals":
            self.views.choose("signals")
        self._keep_span((float(stretch["span"][0]), float(stretch["span"][1])))
        self.show_span()
        self.draw()
