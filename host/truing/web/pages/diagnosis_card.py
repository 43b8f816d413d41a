"""The diagnosis of a set: start, progress, the finding with its evidence, and what to do next."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any
from urllib.parse import urlencode

from nicegui import ui

from truing.errors import TruingError, with_next
from truing.plan import load_plan
from truing.web.pages.elements import action_link, button, notify, panel, set_text, tag
from truing.web.pages.run_preview import RunPreview
from truing.web.runs.library import FoundSet
from truing.web.session import ViewSession
from truing.web.worker.state import RunRequest

_STAGES = {
    "none": "",
    "running": "diagnosing",
    "done": "done",
    "failed": "failed",
    "cancelled": "cancelled",
}


class DiagnosisCard:
    """Follows the diagnosis of the set that the page shows.

    Parameters
    ----------
    on_shown : called with the content of the diagnosis, or None, whenever it changes.
    on_stretch : called with a stretch of a run that the finding is about.
    """

    def __init__(
        self,
        session: ViewSession,
        on_shown: Callable[[dict[str, Any] | None], Any],
        on_stretch: Callable[[dict[str, Any]], Any],
    ) -> None:
        self._session = session
        self._on_shown = on_shown
        self._on_stretch = on_stretch
        self._preview = RunPreview(session)
        self.home: FoundSet | None = None
        self._stage = ("", 0.0)
        with panel("Diagnosis"):
            with tag("div", classes="row-tight"):
                button("Diagnose this set", self._start, strong=True)
                self._cancel = button("Cancel", session.diagnosis.cancel, label="Cancel the diagnosis")
            self._bar = tag(
                "progress", max="1", value="0", aria_label="Progress of the diagnosis", classes="progress"
            )
            self._status = tag("p", classes="note dim", role="status", style="margin:4px 0 0")
            self._verdict = tag("div", classes="diagnosis", aria_live="polite")
        self._update()
        ui.timer(0.4, self._update)

    def show(self, home: FoundSet | None) -> None:
        """Show the diagnosis of another set."""
        self.home = home
        self._verdict.clear()
        content = self._content()
        self._on_shown(content)
        with self._verdict:
            if content is None:
                tag("p", "This set has not been diagnosed yet.", "dim note")
            else:
                self._show(content)

    def _content(self) -> dict[str, Any] | None:
        if self.home is None:
            return None
        result = self._session.diagnosis.result_of(self.home.name)
        try:
            content: dict[str, Any] = json.loads((result.parent / "pages" / result.name).read_bytes())
        except (OSError, ValueError):
            return None
        return content

    def _show(self, content: dict[str, Any]) -> None:
        assert self.home is not None
        result = self._session.diagnosis.result_of(self.home.name)
        tag("p", content.get("finding") or content["heading"], "verdict")
        with tag("div", classes="row-tight"):
            if content["has_next"]:
                button("Run the next experiment", self._run_next, strong=True)
            self._next_links(strong=not content["has_next"])
            report = f"/diagnoses/{result.with_suffix('.html').name}"
            tag("a", "Report", "plain-link", href=report, target="_blank", rel="noopener")
        stretches = content.get("stretches", [])
        if stretches:
            tag("p", "Where it shows (red in the chart):", "note dim")
        for stretch in stretches:
            button(stretch["text"], partial(self._on_stretch, stretch)).classes("evidence")
        for title, lines in content["sections"]:
            with tag("details", **({"open": "open"} if title == "Verdict" else {})):
                tag("summary", title)
                for line in lines:
                    tag("p", line, "note")

    def _next_links(self, *, strong: bool) -> None:
        """The simulation with what was found, or more recordings where nothing was."""
        assert self.home is not None
        result = self._session.diagnosis.result_of(self.home.name)
        try:
            verdict = json.loads(result.read_bytes())
        except (OSError, ValueError):
            verdict = {}
        if verdict.get("effects") or verdict.get("numbers"):
            query = {"set": self.home.name, "run": self.home.runs[-1].stem, "model": "found"}
            query["diagnosis"] = result.stem
            text = "Compare with the diagnosed model"
            action_link(text, f"/models?{urlencode(query)}", strong=strong)
        else:
            action_link("Record more runs", "/experiments?group=diagnosis", strong=strong)

    def _start(self) -> None:
        if self.home is None:
            notify(
                "there are no runs here yet: drive a plan first, or drop recordings on Compare", good=False
            )
            return
        try:
            self._session.diagnosis.start(self.home.path, self.home.name)
        except TruingError as error:
            notify(with_next(error), good=False)
        self._update()

    def _update(self) -> None:
        """Show progress, and the verdict when it is ready."""
        state = self._session.diagnosis.state
        shown = (state.stage, round(state.progress, 3))
        if shown == self._stage:
            return
        ended = state.stage == "done" and self._stage[0] not in ("", "done")
        self._stage = shown
        running = state.stage == "running"
        self._bar._props["value"] = f"{state.progress:.3f}"
        self._bar.update()
        self._bar.set_visibility(running)
        self._cancel.set_visibility(running)
        text = _STAGES[state.stage]
        if running and state.runs is not None:
            text = f"diagnosing {state.runs.name}: {100.0 * state.progress:.0f} %"
        set_text(self._status, f"{text} {state.problem}".strip())
        if ended:
            self.show(self.home)

    def _run_next(self) -> None:
        """Show the plan that distinguishes the explanations, and run it; its run is added to the set."""
        if self.home is None:
            return
        plan = self._session.diagnosis.result_of(self.home.name).with_suffix(".next.toml")
        try:
            folder = self._session.own_set(self.home.path)
            self._preview.show(RunRequest(load_plan(str(plan)), folder, "next"))
        except TruingError as error:
            notify(with_next(error), good=False)
