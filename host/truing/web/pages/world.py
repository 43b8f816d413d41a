"""World: paint what the sensors see, save and load it as a map, watch the global map grow."""

from __future__ import annotations

import asyncio

from nicegui import events, ui

from truing.errors import TruingError
from truing.web.elements import Choice, LiveKeys, Toggle, TopView, button, heading, number, say, tag
from truing.web.map_file import read_world, write_map, write_world
from truing.web.pages.live import drive_panel
from truing.web.pose import Pose
from truing.web.sequence_file import checked_name
from truing.web.session import ViewSession
from truing.web.world_map import WorldMap

_TOOLS = {
    "pan": "Move",
    "paint": "Paint",
    "erase": "Erase",
    "wall": "Wall",
    "room": "Room",
    "place": "Place robot",
}
_WALL_M = 0.05
_MOST_POINTS = 1500


def build(session: ViewSession) -> None:
    """The page."""
    page = _WorldPage(session)
    page.build()


class _WorldPage:
    """What the page remembers between two clicks."""

    def __init__(self, session: ViewSession) -> None:
        self.session = session
        self.brush_m = 0.1
        self.name = "room"
        self.grid = "none"

    def build(self) -> None:
        """Make the elements."""
        with tag("div", classes="view"):
            with tag("section", classes="stage", aria_label="Floor"):
                self.top = TopView(
                    "The world from above: obstacles, walls and the robot", "world", fitted=True
                )
                self.top.on("stroke", self.stroke)
                self.top.on("place", self.place)
                with tag("div", classes="overlay"):
                    Choice("Tool", _TOOLS, "pan", lambda tool: self.top.set(tool=tool))
                    button("Fit", self.top.fit)
            with tag("section", classes="side", aria_label="World and sensors"):
                with tag("div"):
                    heading("Map")
                    with tag("div", classes="row-tight"):
                        number("Brush, m", self.brush_m, self.set_brush, low=0.05, high=1.0, step=0.05)
                        name = (
                            ui.input("Name", value=self.name)
                            .props("dense outlined dark")
                            .style("width:110px")
                        )
                        name.on_value_change(lambda event: setattr(self, "name", str(event.value)))
                    with tag("div", classes="row-tight", style="margin-top:8px"):
                        button("Save", self.save, strong=True)
                        button("Load", self.load)
                        button("Clear", self.clear)
                with tag("div"):
                    heading("Sensors")
                    self._sensors()
                with tag("div"):
                    heading("Global map")
                    Choice(
                        "Global map",
                        {"none": "Off", "odometry": "By odometry", "corrected": "By corrected pose"},
                        "none",
                        self.show_grid,
                    )
                    with tag("div", classes="row-tight", style="margin-top:8px"):
                        Toggle("Odometry's robot", False, lambda on: self.top.set(ghosts=on))
                        button("Begin anew", self.session.sensing.clear_maps)
                        button("Save map", self.save_grid)
                    tag(
                        "p",
                        "Both maps grow from the same scans. The one laid out by odometry smears where "
                        "odometry drifts; the other uses the virtual robot's true pose.",
                        "dim",
                        style="font-size:12px;margin:6px 0 0",
                    )
                drive_panel()
        LiveKeys()

    def _sensors(self) -> None:
        sensing = self.session.sensing
        settings = sensing.settings
        with tag("div", classes="row-tight"):
            Toggle("Sonar", settings.sonar_on, lambda on: sensing.set(sonar_on=on))
            Toggle("Laser", settings.laser_on, lambda on: sensing.set(laser_on=on))
        with tag("div", classes="row-tight", style="margin-top:8px"):
            for label, name, low, high, step in (
                ("Sonars", "sonar_count", 1, 64, 1),
                ("Cone, °", "sonar_cone_deg", 1, 90, 1),
                ("Sonar to, m", "sonar_range_m", 0.5, 20, 0.5),
                ("Laser, °", "laser_fov_deg", 10, 360, 10),
                ("Laser to, m", "laser_range_m", 0.5, 40, 0.5),
                ("Rate, Hz", "rate_hz", 1, 40, 1),
                ("Noise, m", "noise_m", 0, 0.5, 0.005),
                ("Seed", "seed", 0, 1e6, 1),
            ):
                value = getattr(settings, name)
                kind = type(value)

                def change(new: float, name: str = name, kind: type = kind) -> None:
                    sensing.set(**{name: kind(new)})

                number(label, value, change, low=low, high=high, step=step)

    # ---- what is done

    def set_brush(self, value: float) -> None:
        """Width of the brush."""
        self.brush_m = value
        self.top.set(brush=value)

    def stroke(self, event: events.GenericEventArguments) -> None:
        """Paint what the mouse drew."""
        tool = event.args.get("tool")
        points = [(float(x), float(y)) for x, y in event.args.get("points", [])[:_MOST_POINTS]]
        world = self.session.world
        with self.session.sensing.world_lock:
            if tool in ("paint", "erase"):
                world.paint_stroke(points, self.brush_m, tool == "paint")
            elif tool == "wall" and len(points) == 2:
                world.paint_stroke(points, _WALL_M, True)
            elif tool == "room" and len(points) == 2:
                world.paint_room(points[0], points[1], _WALL_M)

    def place(self, event: events.GenericEventArguments) -> None:
        """Put the robot somewhere else: on the screen; nobody lifts it on the floor."""
        self.session.place(Pose(event.args["x"], event.args["y"], event.args["theta"]))

    def clear(self) -> None:
        """An open floor."""
        with self.session.sensing.world_lock:
            self.session.world.clear()

    def save(self) -> None:
        """Write the world."""
        try:
            path = self.session.map_folder / f"{checked_name(self.name)}.yaml"
            with self.session.sensing.world_lock:
                write_world(path, self.session.world)
        except TruingError as error:
            say(str(error), good=False)
        else:
            say(f"saved: {path} and .png")

    def load(self) -> None:
        """Read a map of that name."""
        try:
            self.take(read_world(self.session.map_folder / f"{checked_name(self.name)}.yaml"), self.name)
        except TruingError as error:
            say(str(error), good=False)

    def take(self, world: WorldMap, name: str) -> None:
        """Make a map the world."""
        with self.session.sensing.world_lock:
            self.session.world.replace(world)
        self.session.sensing.clear_maps()
        self.top.fit()
        say(f"{name}: {world.size_m[0]:.1f} m by {world.size_m[1]:.1f} m at {world.resolution_m:g} m")

    def show_grid(self, grid: str) -> None:
        """Which global map lies under the picture."""
        self.grid = grid
        self.top.set(grid=grid)

    async def save_grid(self) -> None:
        """Write the global map that is shown, as map_server reads it."""
        sensing = self.session.sensing
        grid = sensing.by_odometry if self.grid == "odometry" else sensing.by_correction
        kind = "odometry" if self.grid == "odometry" else "corrected"
        try:
            path = self.session.map_folder / f"{checked_name(self.name)}-{kind}.yaml"
            await asyncio.to_thread(write_map, path, grid.pixels(), grid.resolution_m, grid.origin_m)
        except TruingError as error:
            say(str(error), good=False)
        else:
            say(f"saved: {path} and .png")
