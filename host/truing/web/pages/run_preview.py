"""Before anything moves: the path on the map, the room it needs, and a countdown that any key stops."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from nicegui import context, ui

from truing.errors import TruingError, with_next
from truing.web.models.run_forecast import RunForecast, forecast
from truing.web.pages.components import Countdown, TopView
from truing.web.pages.elements import button, dialog_box, notify, tag
from truing.web.pose import Pose
from truing.web.session import ViewSession
from truing.web.worker.state import RunRequest

COUNTDOWN_S = 3
# A start that comes later than this after the countdown's end was held up on its way: nobody expects it now.
_LATE_S = 2.0
_COLOUR = "#7ee787"


@dataclass(frozen=True, slots=True)
class _Begun:
    """A countdown: when it began, and how many stops there had been."""

    at_s: float
    stops: int


class RunPreview:
    """Shows what a run will do, and starts it after a countdown."""

    def __init__(self, session: ViewSession) -> None:
        self._session = session
        self._client = context.client
        self._request: RunRequest | None = None
        self._start: Callable[[], Any] = lambda: None
        self._begun: _Begun | None = None
        with ui.dialog() as self._dialog:
            self._box = dialog_box()
        self._box.classes("run-preview")
        self._dialog.props('aria-label="Before the robot moves"').on("hide", self._hidden)

    def show(self, request: RunRequest, start: Callable[[], Any] | None = None) -> None:
        """Show what a run will do; the user starts it from there.

        Parameters
        ----------
        start : called in place of driving the request; the page then has control.
        """
        session = self._session
        self._start = start or (lambda: session.run(self._client.id, request))
        pose = session.corrected_pose() or Pose()
        with session.sensing.world_lock:
            found = forecast(request.plan, session.worker.parameters, pose, session.world)
        self._request, self._begun = request, None
        self._box.clear()
        with self._box:
            self._content(request, found)
        self._dialog.open()

    def _content(self, request: RunRequest, found: RunForecast) -> None:
        tag("h2", "Before the robot moves")
        tag("p", request.plan.title, style="margin:0")
        with tag("div", classes="preview-map"):
            top = TopView("The path that the plan commands, from where the robot stands", "live", fitted=True)
            path = {"points": found.path.round(3).tolist(), "colour": _COLOUR, "name": "", "title": "planned"}
            top.set(paths=[path], sensors=False)
        with tag("dl", classes="facts preview-facts"):
            for name, value in found.facts():
                tag("dt", name)
                tag("dd", value, "num")
        tag(
            "p",
            f"estimate from {found.need.source}; room with margins, the robot's own size comes on top",
            "dim note",
        )
        if found.obstacle is not None:
            x, y = found.obstacle
            tag(
                "p", f"An obstacle of the world is in the way at {x:.2f}, {y:.2f} m.", "warning", role="alert"
            )
        if request.plan.unattended:
            tag("p", "This plan goes on when this page or the link is lost.", "warning")
        with tag("div", classes="row-tight"):
            start = Countdown(f"Start in {COUNTDOWN_S} s", COUNTDOWN_S)
            start.on("begin", self._begin, []).on("go", self._go, []).on("cancelled", self._cancel, [])
            button("Cancel", self._dialog.close)

    def _begin(self) -> None:
        if self._session.claim(self._client.id):
            self._begun = _Begun(time.monotonic(), self._session.stops)
        else:
            notify("another page drives this robot: wait until it releases control", good=False)

    def _cancel(self) -> None:
        self._begun = None

    def _go(self) -> None:
        begun, request, self._begun = self._begun, self._request, None
        if begun is None or request is None:
            return
        if self._session.stops != begun.stops:
            notify("stopped meanwhile, nothing has moved: preview and start again", good=False)
        elif time.monotonic() - begun.at_s > COUNTDOWN_S + _LATE_S:
            notify("the start came too late from this page: nothing has moved; start again", good=False)
        else:
            try:
                self._start()
            except TruingError as error:
                notify(with_next(error), good=False)
        self._dialog.close()

    def _hidden(self) -> None:
        self._request = self._begun = None
        self._box.clear()
