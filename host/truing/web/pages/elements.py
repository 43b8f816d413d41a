"""Plain HTML elements of the pages: headings, buttons, lists, tables, number fields, live texts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from nicegui import events, ui
from nicegui.element import Element


class Select:
    """The browser's drop-down list.

    Parameters
    ----------
    options : value and text of each.
    """

    def __init__(
        self, label: str, options: dict[str, str], value: str, on_change: Callable[[str], Any]
    ) -> None:
        self.value = value
        self._on_change = on_change
        with tag("label", classes="pick"):
            tag("span", label)
            self._select = tag("select", aria_label=label)
        self._select.on("change", self._changed, js_handler="(e) => emit(e.target.value)")
        self.fill(options, value)

    @property
    def is_deleted(self) -> bool:
        """Whether its page was left. What is put into a page then is never shown, and never freed."""
        return self._select.is_deleted

    def fill(self, options: dict[str, str], value: str) -> None:
        """Replace the options."""
        self.value = value if value in options else next(iter(options), "")
        self._select.clear()
        with self._select:
            self._options = {name: tag("option", text, value=name) for name, text in options.items()}
        self._mark()

    def _mark(self) -> None:
        for name, option in self._options.items():
            option._props["selected"] = name == self.value
            option.update()

    def _changed(self, event: events.GenericEventArguments) -> None:
        if isinstance(event.args, str) and event.args in self._options:
            self.value = event.args
            # The list may have been refilled in the meantime.
            self._mark()
            self._on_change(event.args)


def dialog_box() -> Element:
    """The frame inside a dialog."""
    return tag("div", classes="dialog-box")


def heading(text: str) -> None:
    """A small heading of a panel."""
    tag("h2", text)


@contextmanager
def panel(title: str) -> Iterator[None]:
    """A part of the page's side, under its heading."""
    with tag("div"):
        heading(title)
        yield


def tag(name: str, text: str = "", classes: str = "", **attributes: str) -> Element:
    """A plain HTML element; underscores in attribute names become dashes."""
    element = ui.element(name)
    if text:
        element._text = text
    if classes:
        element.classes(classes)
    for key, value in attributes.items():
        element._props[key.rstrip("_").replace("_", "-")] = value
    return element


def live_text(name: str, classes: str = "num", element: str = "span", first: str = "–") -> Element:
    """A text that is updated by every frame."""
    return tag(element, first, classes, data_live=name)


def set_text(element: ui.element, text: str) -> None:
    """Replace the text of an element."""
    element._text = text
    element.update()


def button(
    text: str,
    on_click: Callable[[], Any] | None = None,
    *,
    strong: bool = False,
    label: str = "",
    **attributes: str,
) -> Element:
    """A button in the style of the view."""
    element = tag("button", text, "plain strong" if strong else "plain", type="button", **attributes)
    if label:
        element._props["aria-label"] = label
    if on_click is not None:
        element.on("click", on_click, [])
    return element


def action_link(text: str, to: str, *, strong: bool = False) -> Element:
    """A link to a page that looks like a button."""
    return tag("a", text, "plain strong" if strong else "plain", href=to)


class Choice:
    """A row of buttons, one of them pressed.

    Parameters
    ----------
    options : value and text of each.
    """

    def __init__(
        self, label: str, options: dict[str, str], value: str, on_change: Callable[[str], Any]
    ) -> None:
        self.value = value
        self._on_change = on_change
        self._buttons: dict[str, Element] = {}
        with tag("div", classes="row-tight", role="group", aria_label=label):
            for name, text in options.items():
                self._buttons[name] = button(text, partial(self.choose, name))
        self._show()

    def choose(self, value: str) -> None:
        """Select a value."""
        self.value = value
        self._show()
        self._on_change(value)

    def _show(self) -> None:
        for name, element in self._buttons.items():
            element._props["aria-pressed"] = "true" if name == self.value else "false"
            element.update()


class Toggle:
    """A button with two states."""

    def __init__(self, text: str, value: bool, on_change: Callable[[bool], Any]) -> None:
        self.value = value
        self._on_change = on_change
        self._button = button(text, self._press)
        self._show()

    def _press(self) -> None:
        self.show(not self.value)
        self._on_change(self.value)

    def show(self, value: bool) -> None:
        """Show a state that is in force already."""
        self.value = value
        self._show()

    def _show(self) -> None:
        self._button._props["aria-pressed"] = "true" if self.value else "false"
        self._button.update()


class PlainTable:
    """A table of text with replaceable rows."""

    def __init__(self, caption: str) -> None:
        self._caption = caption
        with tag("div", classes="scroll-x", tabindex="0", role="region", aria_label=caption):
            self._table = tag("table", classes="plain", aria_label=caption)

    def clear(self) -> None:
        """Show nothing."""
        self._table.clear()

    def fill(self, head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Show these rows."""
        self._table.clear()
        with self._table:
            with tag("thead"), tag("tr"):
                for text in head:
                    tag("th", text, scope="col")
            with tag("tbody"):
                for row in rows:
                    with tag("tr"):
                        for text in row:
                            tag("td", text)


def number(
    label: str, value: float, on_change: Callable[[float], Any], *, low: float, high: float, step: float
) -> ui.number:
    """A number field that reports only values within its limits."""

    def changed(event: events.ValueChangeEventArguments[Any]) -> None:
        if isinstance(event.value, int | float) and low <= event.value <= high:
            on_change(float(event.value))

    field = ui.number(label, value=value, min=low, max=high, step=step, on_change=changed)
    # Wide enough for its label, which would be cut.
    field.props("dense outlined dark").style(f"width: {max(106, 34 + 8 * len(label))}px")
    return field


def text_field(
    label: str, value: str, on_change: Callable[[str], Any], *, width_px: int = 130, more: str = ""
) -> ui.input:
    """A field for a text."""
    field = ui.input(label, value=value).props(f"dense outlined dark {more}").style(f"width:{width_px}px")
    return field.on_value_change(lambda event: on_change(str(event.value or "")))


def tick(name: str, text: str, checked: bool, on_change: Callable[[bool], Any]) -> None:
    """A check box and its text.

    Parameters
    ----------
    name : for a screen reader.
    """
    with tag("label", classes="tick"):
        mark = tag("input", type="checkbox", aria_label=name)
        if checked:
            mark._props["checked"] = True
        mark.on(
            "change",
            lambda event: on_change(event.args is True),
            js_handler="(e) => emit(e.target.checked)",
        )
        tag("span", text)


def notify(text: str, *, good: bool = True) -> None:
    """Show a notification over the side of the page, beside the chart; a press takes it away."""
    ui.notify(
        text,
        type="positive" if good else "negative",
        position="bottom-right",
        timeout=6000 if good else 12000,
        close_button="Close",
        multi_line=True,
        classes="beside",
    )
