"""Control first: what a page changes for everybody, it changes only while it drives."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui import context, ui

from truing.web.pages.elements import button, dialog_box, notify, set_text, tag
from truing.web.session import ViewSession


class ControlGate:
    """Carries actions out for the page in control; asks any other page to take control first.

    Every page may look and press STOP. What changes the robot or the world for all pages goes through here.
    """

    def __init__(self, session: ViewSession) -> None:
        self._session = session
        self._name = context.client.id
        self._action: Callable[[], Any] = lambda: None
        self._otherwise: Callable[[], Any] = lambda: None
        with ui.dialog() as self._dialog, dialog_box():
            tag("h2", "Control")
            self._text = tag("p", role="status")
            with tag("div", classes="row-tight"):
                button("Take control", self._take, strong=True, autofocus="autofocus")
                button("Cancel", self._dialog.close)
        self._dialog.props('aria-label="Control"').on("hide", self._hidden)

    def run(self, what: str, action: Callable[[], Any], otherwise: Callable[[], Any] = lambda: None) -> None:
        """Carry out an action now, or after the user has taken control.

        Parameters
        ----------
        what : the action as the end of a sentence: "clear the faults".
        otherwise : called where it is not carried out, to show again what is in force.
        """
        driver = self._session.lock.session
        if driver == self._name:
            action()
        elif driver is not None:
            notify(f"another page drives: it has to release control before this page can {what}", good=False)
            otherwise()
        else:
            self._action, self._otherwise = action, otherwise
            set_text(self._text, f"Only the page in control can {what}. No page is in control now.")
            self._dialog.open()

    def _take(self) -> None:
        action, self._otherwise = self._action, lambda: None
        self._dialog.close()
        if self._session.claim(self._name):
            action()
        else:
            notify("another page has taken control meanwhile: wait until it releases it", good=False)

    def _hidden(self) -> None:
        """Closed, by a button or by the Escape key."""
        otherwise, self._otherwise = self._otherwise, lambda: None
        otherwise()
