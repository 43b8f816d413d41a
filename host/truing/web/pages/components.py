"""Components with scripts of their own: floor, 3-D scene, plot, keys, drop zone, slider."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import nicegui.elements.scene  # noqa: F401  (importing it puts three.js into the pages' import map)
from nicegui.element import Element

from truing.web.models.error_model import Slider
from truing.web.pages.address import Address
from truing.web.pose import Pose
from truing.web.views.figures import Figure, empty_figure

# Absolute: NiceGUI resolves a relative name against the module's folder, and silently ignores a missing file.
STATIC = Path(__file__).parents[1] / "static"


class TopView(Element, component=STATIC / "top_view.js"):
    """The floor from above.

    Parameters
    ----------
    mode : `live` (the robot), `world` (editing), `model` (the model robot), `paths` (paths only).
    address : where zoom and pan are kept; None: nowhere.
    """

    def __init__(
        self, label: str, mode: str, *, fitted: bool = False, address: Address | None = None
    ) -> None:
        super().__init__()
        self._props["kept"] = address is not None
        self._props["view"] = None if address is None else address.numbers("v", 3)
        for name, value in {
            "label": label,
            "mode": mode,
            "tool": "pan",
            "follow": False,
            "sensors": True,
            "grid": "none",
            "odometry": False,
            "brush": 0.1,
            "scale": 100,
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
        """Move the model robot and draw its path."""
        self.run_method("setModel", pose.as_list(), path)

    def play(self, poses: Sequence[Sequence[float]], seconds: float) -> None:
        """Animate the model robot along poses."""
        self.run_method("play", list(poses), seconds)

    def fit(self) -> None:
        """Show everything."""
        self.run_method("fit")

    def zoom(self, factor: float) -> None:
        """Zoom by a factor; 0 restores the initial scale."""
        self.run_method("setZoom", factor)


class Scene3D(Element, component=STATIC / "scene_3d.js"):
    """The world in three dimensions; three.js is the one that comes with NiceGUI."""

    def __init__(self, label: str) -> None:
        super().__init__()
        self.set(label=label, camera="orbit", sensors=True)

    def set(self, **props: Any) -> None:
        """Change properties."""
        for name, value in props.items():
            self._props[name] = value
        self.update()


class Plot(Element, component=STATIC / "plot.js", default_classes="plot-box"):
    """Curves and maps over time: zoom, pan, cursor, playback, PNG and CSV; on every page.

    Emits `selected` with the ends (s) of a stretch drawn with the tool `select`, `picked` with the row and
    the ends (s) of a map's cell that was pressed, and `csv` where the page saves the exact values itself.

    Parameters
    ----------
    source : `figure` (see `show`) or `live` (the live signals).
    exact : the page answers `csv`; otherwise the curves are saved as they are drawn.
    address : where the zoom is kept; None: nowhere.
    """

    def __init__(
        self, label: str, *, source: str = "figure", exact: bool = False, address: Address | None = None
    ) -> None:
        super().__init__()
        self._props["zoomed"] = None if address is None else address.numbers("t", 2)
        self._props["kept"] = address is not None
        self._props["figure"] = empty_figure("loading …")
        self.set(label=label, source=source, exact=exact, title=label, tool="pan")

    def show(self, figure: Figure, title: str = "") -> None:
        """Draw a figure; its title stands in the picture that is saved."""
        self.set(figure=figure, title=title or self._props["label"])

    def set(self, **props: Any) -> None:
        """Change properties."""
        for name, value in props.items():
            self._props[name] = value
        self.update()


class LiveKeys(Element, component=STATIC / "live_keys.js"):
    """Invisible: while this is on the page, the driving keys move the robot."""


class ModelKeys(Element, component=STATIC / "model_keys.js"):
    """Invisible: the driving keys move the model robot; emits `cycle`, `speed` and `stop`."""


class DropZone(Element, component=STATIC / "drop_zone.js"):
    """A target for dropped or chosen files; emits `dropped` with the result for each."""

    def __init__(self, text: str, accept: str, address: str, max_bytes: int) -> None:
        super().__init__()
        shown = {"text": text, "accept": accept, "address": address, "limit": max_bytes}
        for name, value in shown.items():
            self._props[name] = value


class Countdown(Element, component=STATIC / "countdown.js"):
    """A button that counts down; emits `begin`, then `go` or `cancelled`."""

    def __init__(self, text: str, seconds: int) -> None:
        super().__init__()
        self._props["text"], self._props["seconds"] = text, seconds


class ParameterSlider(Element, component=STATIC / "slider.js"):
    """A parameter with slider, number field and interval; emits `adjust` with the new value."""

    def __init__(self, slider: Slider, value: float) -> None:
        super().__init__()
        for name, content in {
            "title": slider.title,
            "unit": slider.unit,
            "value": value,
            "low": min(slider.low, value),
            "high": max(slider.high, value),
            "interval": slider.interval,
        }.items():
            self._props[name] = content


class NumberField(Element, component=STATIC / "number_field.js"):
    """A plain number field; emits `typed` with the text."""

    def __init__(self, label: str, value: str) -> None:
        super().__init__()
        self._props["label"], self._props["value"] = label, value
