"""Experiments of several steps: tuning the feedforward, and checking the wiring."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui import background_tasks, context, ui

from truing.errors import TruingError, with_next
from truing.web.pages.components import Countdown
from truing.web.pages.elements import (
    PlainTable,
    button,
    dialog_box,
    heading,
    notify,
    set_text,
    tag,
)
from truing.web.session import ViewSession

_ABOUT = {
    "tune": "Three drives: these steps of speed, steps of effort to learn from, and the steps of speed "
    "again. The parameters ff_k... are changed only where the wheels then follow more closely",
    "check": "Each wheel is turned once by hand; then each motor turns its wheel with 5 % effort, a little "
    "more until it moves. Finds swapped and reversed motors and encoders, dead encoders, wrong counts per "
    "revolution",
}


class ProcedurePanel:
    """Progress and result of a tuning or a check; shown while one of them is chosen."""

    def __init__(self, session: ViewSession) -> None:
        self._session = session
        self._client = context.client
        self._group = ""
        self._seen: tuple[Any, ...] = ()
        self._box = tag("div")
        with self._box:
            heading("Progress")
            self._text = tag("p", classes="note", role="status", style="margin:0")
            with tag("div", classes="row-tight"):
                self._turned = button("Turned", session.wiring.turned, strong=True)
                self._fix = button("Set what is reversed", self._fix_wiring)
            self._table = PlainTable("Feedforward before and after")
        with ui.dialog() as self._dialog:
            self._dialog_box = dialog_box()
        self._dialog.props('aria-label="Before the wheels turn"').on("hide", self._dialog_box.clear)

    def about(self, group: str) -> str:
        """What is done, for a person who stands beside the robot."""
        return _ABOUT.get(group, "")

    def show(self, group: str) -> None:
        """Show the progress of this kind of experiment."""
        self._group = group
        self._box.set_visibility(group in _ABOUT)
        self._seen = ()
        self.update()

    def update(self) -> None:
        """Show what has changed."""
        state = self._session.tuning.state if self._group == "tune" else self._session.wiring.state
        if self._group not in _ABOUT or self._seen == (state,):
            return
        self._seen = (state,)
        wiring, tuning = self._session.wiring.state, self._session.tuning.state
        checks = self._group == "check"
        text = "\n".join([*wiring.said, wiring.asks]) if checks else tuning.text
        set_text(self._text, text)
        self._turned.set_visibility(checks and bool(wiring.asks))
        findings = wiring.result.findings if checks and wiring.result is not None else ()
        self._fix.set_visibility(any(one.parameter for one in findings))
        pairs = {} if checks else tuning.parameters
        rows = [[name, f"{before:.4g}", f"{after:.4g}"] for name, (before, after) in pairs.items()]
        self._table.clear()
        if rows:
            self._table.fill(["parameter", "before", "learned"], rows)

    def ask_for_check(self) -> None:
        """Say what will turn, and count down."""
        if self._session.wiring.is_running:
            notify("the check is under way: wait until it ends, or press space", good=False)
            return
        with self._dialog_box:
            tag("h2", "Before the wheels turn")
            virtual = self._session.virtual is not None
            hands = "the wheels are turned by a simulated hand" if virtual else "you turn each wheel once"
            tag("p", f"The wheels will turn, and have to be off the ground; first {hands}.")
            with tag("div", classes="row-tight"):
                start = Countdown("Start in 3 s", 3)
                start.on("go", self._check, []).on("begin", self._take_control, [])
                button("Cancel", self._dialog.close)
        self._dialog.open()

    def _take_control(self) -> None:
        if not self._session.claim(self._client.id):
            notify("another page drives this robot: wait until it releases control", good=False)
            self._dialog.close()

    def _check(self) -> None:
        self._dialog.close()
        if self._session.lock.holds(self._client.id):
            background_tasks.create(self._session.wiring.run())

    def _fix_wiring(self) -> None:
        background_tasks.create(self._quietly(self._session.wiring.fix))

    async def _quietly(self, work: Callable[[], Any]) -> None:
        try:
            await work()
        except TruingError as error:
            with self._client:
                notify(with_next(error), good=False)
