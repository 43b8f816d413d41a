"""The view's own elements: floor, strip chart, and small pieces of HTML that frames fill."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import nicegui.elements.scene  # noqa: F401  (importing it puts three.js into the pages' import map)
from nicegui import events, ui
from nicegui.element import Element

from truing.web.error_model import Knob
from truing.web.figures import nothing
from truing.web.pose import Pose


class TopView(Element, component="static/top_view.js"):
    """The floor from above.

    Parameters
    ----------
    mode : `live` (the robot), `world` (editing), `model` (the model robot), `paths` (nothing but paths).
    """

    def __init__(self, label: str, mode: str, *, scale: int = 100, fitted: bool = False) -> None:
        super().__init__()
        for name, value in {
            "label": label,
            "mode": mode,
            "tool": "pan",
            "follow": False,
            "sensors": True,
            "grid": "none",
            "ghosts": False,
            "brush": 0.1,
            "scale": scale,
            "paths": [],
            "nodes": [],
            "pose": None,
            "fitted": fitted,
        }.items():
            self._props[name] = value

    def set(self, **props: Any) -> None:
        """Change properties."""
        for name, value in props.items():
            self._props[name] = value
        self.update()

    def value(self, name: str) -> Any:
        """A property's present value."""
        return self._props[name]

    def set_model(self, pose: Pose, path: Sequence[Sequence[float]] | None = None) -> None:
        """Move the model robot; a path is painted behind it."""
        self.run_method("setModel", pose.as_list(), path)

    def play(self, poses: Sequence[Sequence[float]], seconds: float) -> None:
        """Let the model robot drive through poses."""
        self.run_method("play", list(poses), seconds)

    def fit(self) -> None:
        """Show everything."""
        self.run_method("fit")

    def zoom(self, factor: float) -> None:
        """Nearer or farther; 0 goes back to the first scale."""
        self.run_method("setZoom", factor)


class Scene3D(Element, component="static/scene_3d.js"):
    """The world in three dimensions; three.js is the one that comes with NiceGUI."""

    def __init__(self, label: str) -> None:
        super().__init__()
        self.set(label=label, camera="orbit", sensors=True)

    def set(self, **props: Any) -> None:
        """Change properties."""
        for name, value in props.items():
            self._props[name] = value
        self.update()


class StripChart(Element, component="static/strip_chart.js", default_classes="strip"):
    """Both wheels over the last seconds."""


class LiveKeys(Element, component="static/live_keys.js"):
    """Nothing to see: the driving keys move the robot as long as this is on the page."""


class ModelKeys(Element, component="static/model_keys.js"):
    """Nothing to see: the driving keys move the model robot; emits `cycle`, `speed` and `stop`."""


class DropZone(Element, component="static/drop_zone.js"):
    """A place to drop files onto, or to choose them; emits `dropped` with what became of each."""

    def __init__(self, text: str, accept: str, address: str) -> None:
        super().__init__()
        for name, value in {"text": text, "accept": accept, "address": address}.items():
            self._props[name] = value


class KnobSlider(Element, component="static/knob.js"):
    """A number on a slider with its interval; emits `turn` with the new value."""

    def __init__(self, knob: Knob, value: float) -> None:
        super().__init__()
        for name, content in {
            "title": knob.title,
            "unit": knob.unit,
            "value": value,
            "low": min(knob.low, value),
            "high": max(knob.high, value),
            "interval": knob.interval,
        }.items():
            self._props[name] = content


class Chart(ui.plotly):
    """A figure that keeps its place while it has nothing to show."""

    def __init__(self, label: str, *, height_px: int | None = None) -> None:
        super().__init__(nothing("reading …"))
        self.classes("chart")
        self._props["role"] = "group"
        self._props["aria-label"] = label
        if height_px is not None:
            self.style(f"height: {height_px}px")

    def png(self, name: str) -> None:
        """Let the browser save a picture of what is shown."""
        shape = {"format": "png", "filename": name, "width": 1600, "height": 900, "scale": 1}
        self.run_plot_method("downloadImage", shape)


class Pick:
    """A list to choose one of, as the browser has it.

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

    def fill(self, options: dict[str, str], value: str) -> None:
        """Other options."""
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
            # The list may have been filled anew while the browser was choosing.
            self._mark()
            self._on_change(event.args)


def heading(text: str) -> None:
    """A small heading of a panel."""
    tag("h2", text)


def tag(name: str, text: str = "", classes: str = "", **attributes: str) -> Element:
    """A plain HTML element; underscores in attributes' names become dashes."""
    element = ui.element(name)
    if text:
        element._text = text
    if classes:
        element.classes(classes)
    for key, value in attributes.items():
        element._props[key.rstrip("_").replace("_", "-")] = value
    return element


def live_text(name: str, classes: str = "num", element: str = "span", first: str = "–") -> Element:
    """A text that every frame fills."""
    return tag(element, first, classes, data_live=name)


def button(
    text: str,
    on_click: Callable[[], Any] | None = None,
    *,
    strong: bool = False,
    label: str = "",
    **attributes: str,
) -> Element:
    """A button that looks like part of the instrument."""
    element = tag("button", text, "plain strong" if strong else "plain", type="button", **attributes)
    if label:
        element._props["aria-label"] = label
    if on_click is not None:
        element.on("click", on_click, [])
    return element


class Choice:
    """A row of buttons of which one is pressed.

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
        """Press another button."""
        self.value = value
        self._show()
        self._on_change(value)

    def _show(self) -> None:
        for name, element in self._buttons.items():
            element._props["aria-pressed"] = "true" if name == self.value else "false"
            element.update()


class Toggle:
    """A button that stays pressed."""

    def __init__(self, text: str, value: bool, on_change: Callable[[bool], Any]) -> None:
        self.value = value
        self._on_change = on_change
        self._button = button(text, self._press)
        self._show()

    def _press(self) -> None:
        self.value = not self.value
        self._show()
        self._on_change(self.value)

    def _show(self) -> None:
        self._button._props["aria-pressed"] = "true" if self.value else "false"
        self._button.update()


class PlainTable:
    """A table of text whose rows can be replaced."""

    def __init__(self, caption: str) -> None:
        self._caption = caption
        with tag("div", classes="scroll-x", tabindex="0", role="region", aria_label=caption):
            self._table = tag("table", classes="plain", aria_label=caption)

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
    """A small number field that gives only numbers within its limits."""

    def changed(event: events.ValueChangeEventArguments[Any]) -> None:
        if isinstance(event.value, int | float) and low <= event.value <= high:
            on_change(float(event.value))

    field = ui.number(label, value=value, min=low, max=high, step=step, on_change=changed)
    field.props("dense outlined dark").style("width: 106px")
    return field


def say(text: str, *, good: bool = True) -> None:
    """A note at the page's foot."""
    ui.notify(
        text, type="positive" if good else "negative", position="bottom", timeout=6000 if good else 12000
    )
