"""Analysis: signals of a run with statistics and step metrics; diagnosis of its set; next experiment."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import background_tasks, context, events, ui

from truing.errors import TruingError
from truing.plan import load_plan
from truing.web.pages.components import Chart
from truing.web.pages.elements import (
    Choice,
    PlainTable,
    Toggle,
    button,
    heading,
    notify,
    number,
    set_text,
    tag,
)
from truing.web.pages.live import task_panel
from truing.web.pages.run_choice import NO_RUNS, RunChoice
from truing.web.pages.run_preview import RunPreview
from truing.web.session import ViewSession
from truing.web.views.analysis import STATISTICS_HEAD, STEPS_HEAD, USUAL
from truing.web.views.figures import empty_figure
from truing.web.worker.state import RunRequest

_VIEWS = {"signals": "Signals", "mismatch": "Mismatch"}
_DRAGS = {"zoom": "Zoom", "select": "Select"}
_STAGES = {
    "none": "",
    "running": "diagnosing",
    "done": "done",
    "failed": "failed",
    "cancelled": "cancelled",
}


def build(session: ViewSession) -> None:
    """The page."""
    _AnalysisPage(session).build()


class _AnalysisPage:
    """Signals of one run, and the diagnosis of its set."""

    def __init__(self, session: ViewSession) -> None:
        self.session = session
        self.client = context.client
        self.preview = RunPreview(session)
        self.selected = list(USUAL)
        self.known: list[str] = []
        self.view = "signals"
        self.signals: dict[str, Any] | None = None
        self.heat: dict[str, Any] | None = None
        self.span: tuple[float, float] | None = None
        self.linked = True
        self.select = False
        self.shown_stage = ("", 0.0)
        self._busy = False
        self._again = False
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
                    Choice("View", _VIEWS, "signals", self.show_view)
                    Choice("Drag mode", _DRAGS, "zoom", self.set_drag)
                    Toggle("Link axes", True, self.set_linked)
                    button("Full run", self.show_full_run, label="Show the full run and clear the selection")
                    button("PNG", self.png, label="Save the figure as PNG")
                    button("CSV", self.csv, label="Save the selected signals as CSV")
                self.chart = Chart("Signals against time")
                self.chart.classes("grows")
                self.chart.on("plotly_selected", self.dragged, ["range"])
            with tag("section", classes="side", aria_label="Run, statistics and diagnosis"):
                with tag("div"):
                    heading("Run")
                    self.runs = RunChoice(session=self.session, on_change=self.chose)
                    self.status = tag("p", classes="note dim", role="status", style="margin:4px 0 0")
                with tag("details", classes="more-runs", open="open"):
                    tag("summary", "Signals")
                    self.ticks = tag("div", classes="ticks")
                self._selection()
                self._diagnosis()
                with tag("div"):
                    heading("Steps")
                    with tag("div", classes="many"):
                        self.steps = PlainTable("Metrics of every step")
                task_panel()
        self.runs.find()
        self.update_progress()
        ui.timer(0.4, self.update_progress)

    def _selection(self) -> None:
        with tag("div"):
            heading("Statistics of the selection")
            with tag("div", classes="row-tight"):
                self.first = number(
                    "from, s", 0.0, lambda v: self.set_span(first=v), low=0, high=1e6, step=0.5
                )
                self.last = number("to, s", 0.0, lambda v: self.set_span(last=v), low=0, high=1e6, step=0.5)
            with tag("div", style="margin-top:6px"):
                self.statistics = PlainTable("Statistics of the selection")

    def _diagnosis(self) -> None:
        with tag("div"):
            heading("Diagnosis")
            with tag("div", classes="row-tight"):
                self.start = button("Diagnose this set", self.diagnose, strong=True)
                self.cancel = button("Cancel", self.session.diagnosis.cancel, label="Cancel the diagnosis")
            self.bar = tag(
                "progress", max="1", value="0", aria_label="Progress of the diagnosis", classes="progress"
            )
            self.stage = tag("p", classes="note dim", role="status", style="margin:4px 0 0")
            self.verdict = tag("div", classes="diagnosis", aria_live="polite")

    # ---- the run

    def chose(self) -> None:
        """Show another run."""
        self.span = None
        self.show_diagnosis()
        self.draw()

    def set_drag(self, what: str) -> None:
        """Set whether dragging zooms or selects."""
        self.select = what == "select"
        self.draw()

    def set_linked(self, on: bool) -> None:
        """Link the time axes of the panels, or not."""
        self.linked = on
        self.draw()

    def select_signal(self, name: str, on: bool) -> None:
        """Draw a signal, or remove it."""
        self.selected = [one for one in self.selected if one != name] + ([name] if on else [])
        self.draw()

    def dragged(self, event: events.GenericEventArguments) -> None:
        """A span was selected with the mouse in any panel."""
        found = event.args.get("range") if isinstance(event.args, dict) else None
        for name, ends in (found or {}).items():
            if name.startswith("x") and len(ends) == 2:
                self.span = (round(float(min(ends)), 3), round(float(max(ends)), 3))
                self.show_span()
                self.draw()
                return

    def set_span(self, *, first: float | None = None, last: float | None = None) -> None:
        """Set the ends of the selection by keyboard."""
        if self._filling:
            return
        ends = self.span or (float(self.first.value), float(self.last.value))
        span = (ends[0] if first is None else first, ends[1] if last is None else last)
        if span != self.span:
            self.span = span
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
        self.span = None
        self.show_span()
        self.chart.run_plot_method("relayout", {"xaxis.autorange": True, "yaxis.autorange": True})
        self.draw()

    def png(self) -> None:
        """Save the figure in the browser."""
        run = self.runs.run
        self.chart.png("signals" if run is None else run.stem if self.view == "signals" else self.runs.name)

    async def csv(self) -> None:
        """Download the selected signals."""
        if self.runs.run is None:
            return
        try:
            found = await self.session.simulation.ask(self._request("csv"))
        except TruingError as error:
            notify(str(error), good=False)
            return
        ui.download.content(found["text"], f"{self.runs.run.stem}.csv", "text/csv")

    def _request(self, kind: str) -> dict[str, Any]:
        span = self.span if self.span is not None and self.span[1] > self.span[0] else None
        return {
            "kind": kind,
            "run": str(self.runs.run),
            "signals": self.selected,
            "span": span,
            "linked": self.linked,
            "select": self.select,
            "marks": [
                one["span"] for one in self.stretches if self.runs.run and one["run"] == self.runs.run.stem
            ],
        }

    def draw(self) -> None:
        """Request a redraw; requests during a redraw are merged into one."""
        self._again = True
        if not self._busy:
            self._busy = True
            background_tasks.create(self._draw())

    async def _draw(self) -> None:
        try:
            while self._again:
                self._again = False
                run = self.runs.run
                if run is None:
                    self._clear("")
                    return
                if run != self._shown:
                    self._clear("")
                try:
                    found = await self.session.simulation.ask(self._request("analyse"))
                except TruingError as error:
                    if run == self.runs.run:
                        self._clear(str(error))
                    continue
                if run == self.runs.run:
                    self._shown = run
                    with self.client:
                        self._show(found)
        finally:
            self._busy = False

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
        names = [signal["name"] for signal in found["signals"]]
        if names != self.known:
            self.known = names
            self._show_ticks(found["signals"])

    def _show_ticks(self, signals: list[dict[str, str]]) -> None:
        self.ticks.clear()
        with self.ticks:
            for signal in signals:
                name = signal["name"]
                with tag("label", classes="tick"):
                    mark = tag("input", type="checkbox", aria_label=name)
                    if name in self.selected:
                        mark._props["checked"] = True
                    mark.on(
                        "change",
                        lambda event, name=name: self.select_signal(name, event.args is True),
                        js_handler="(e) => emit(e.target.checked)",
                    )
                    tag("span", name)

    # ---- the diagnosis

    def show_view(self, view: str) -> None:
        """Show the signals or the heat map."""
        self.view = view
        self._show_figure()

    def _show_figure(self) -> None:
        """Update the figure; one element for both views, since a hidden plot cannot be resized."""
        figure = self.signals if self.view == "signals" else self.heat
        if figure is None or not figure["data"]:
            figure = empty_figure(self._why_empty())
        self.chart.update_figure(figure)

    def _why_empty(self) -> str:
        if self.runs.run is None:
            return NO_RUNS
        if self.view == "mismatch":
            return "this set has not been diagnosed yet: start a diagnosis on the right"
        if self.unreadable:
            return f"{self.runs.run.stem} cannot be shown"
        return "loading …" if self.signals is None else "select signals on the right"

    def diagnose(self) -> None:
        """Start a diagnosis of the set."""
        home = self.runs.home
        if home is None:
            return
        try:
            self.session.diagnosis.start(home.path, home.name)
        except TruingError as error:
            notify(str(error), good=False)
        self.update_progress()

    def update_progress(self) -> None:
        """Update progress, and show the verdict when it is ready."""
        state = self.session.diagnosis.state
        shown = (state.stage, round(state.progress, 3))
        if shown == self.shown_stage:
            return
        ended = state.stage == "done" and self.shown_stage[0] != "done"
        self.shown_stage = shown
        running = state.stage == "running"
        self.bar._props["value"] = f"{state.progress:.3f}"
        self.bar.update()
        self.bar.set_visibility(running)
        self.cancel.set_visibility(running)
        text = _STAGES[state.stage]
        if running and state.runs is not None:
            text = f"diagnosing {state.runs.name}: {100.0 * state.progress:.0f} %"
        set_text(self.stage, f"{text} {state.problem}".strip())
        if ended:
            self.show_diagnosis()

    def show_diagnosis(self) -> None:
        """Show the diagnosis of the selected set."""
        self.verdict.clear()
        name = self.runs.name
        result = self.session.diagnosis.result_of(name)
        page = result.parent / "pages" / result.name
        try:
            content = json.loads(page.read_bytes()) if name else None
        except (OSError, ValueError):
            content = None
        self.heat = (content or {}).get("heat")
        self.stretches = (content or {}).get("stretches", [])
        self._show_figure()
        with self.verdict:
            if content is None:
                tag("p", "This set has not been diagnosed yet.", "dim note")
                return
            tag("p", content.get("finding") or content["heading"], "verdict")
            with tag("div", classes="row-tight"):
                if content["has_next"]:
                    button("Run the next experiment", self.run_next, strong=True)
                tag("a", "Adjust in Error models", "plain-link", href="/models")
                address = f"/diagnoses/{result.with_suffix('.html').name}"
                tag("a", "Report", "plain-link", href=address, target="_blank", rel="noopener")
            if self.stretches:
                tag("p", "Where it shows (red in the chart):", "note dim")
            for stretch in self.stretches:
                button(stretch["text"], partial(self.show_stretch, stretch)).classes("evidence")
            for title, lines in content["sections"]:
                with tag("details", **({"open": "open"} if title == "Verdict" else {})):
                    tag("summary", title)
                    for line in lines:
                        tag("p", line, "note")

    def show_stretch(self, stretch: dict[str, Any]) -> None:
        """Show a stretch of a run that the finding is about."""
        if not self.runs.show(stretch["run"]):
            notify(f"{stretch['run']} is no longer in this set", good=False)
            return
        self.span = (float(stretch["span"][0]), float(stretch["span"][1]))
        self.show_span()
        self.draw()

    def run_next(self) -> None:
        """Show the plan that distinguishes the explanations, and run it; its run is added to the set."""
        home = self.runs.home
        if home is None:
            return
        plan = self.session.diagnosis.result_of(home.name).with_suffix(".next.toml")
        try:
            request = RunRequest(load_plan(str(plan)), self._folder_for(home.path), "next")
            self.preview.show(request)
        except TruingError as error:
            notify(str(error), good=False)

    def _folder_for(self, path: Path) -> Path:
        own = self.session.run_folder.parent.resolve()
        if not path.is_relative_to(own) and not path.is_relative_to(
            self.session.model_folder.parent.resolve()
        ):
            raise TruingError(
                f"{path.name}: these runs are from another robot; nothing is added to them",
                "diagnose a set that was recorded with this board",
            )
        return path
