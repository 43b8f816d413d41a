"""3-D: world and robot in three dimensions with orbit, follow or top camera; manual driving."""

from __future__ import annotations

from truing.web.pages.address import Address
from truing.web.pages.components import LiveKeys, Scene3D
from truing.web.pages.elements import Choice, Toggle, tag
from truing.web.pages.live import drive_panel, pose_facts, task_panel

_CAMERAS = {"orbit": "Orbit", "follow": "Follow", "top": "Top"}


def build(address: Address) -> None:
    """The page."""

    def choose(camera: str) -> None:
        scene.set(camera=camera)
        address.write(camera=camera)

    with tag("div", classes="view"):
        with tag("section", classes="stage", aria_label="World in three dimensions"):
            scene = Scene3D("The world and the robot in three dimensions")
            with tag("div", classes="overlay"):
                camera = address.one_of("camera", _CAMERAS, "orbit")
                scene.set(camera=camera)
                Choice("Camera", _CAMERAS, camera, choose)
                Toggle("Laser", True, lambda on: scene.set(sensors=on))
        with tag("section", classes="side", aria_label="Drive"):
            drive_panel()
            pose_facts()
            task_panel()
            tag(
                "p",
                "Drag to rotate, scroll to zoom. With the view focused: J, L rotate, I, K tilt, "
                "comma and full stop zoom.",
                "hints",
            )
    LiveKeys()
