"""World: edit the obstacles, save and load maps, configure the sensors, build the global map."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial

from nicegui import events, ui

from truing.errors import TruingError, with_next
from truing.web.pages.address import Address
from truing.web.pages.components import LiveKeys, TopView
from truing.web.pages.control import ControlGate
from truing.web.pages.elements import Choice, Select, Toggle, button, notify, number, panel, tag, text_field
from truing.web.pages.live import drive_panel
from truing.web.path.sequence_file import checked_name
from truing.web.pose import Pose
from truing.web.session import ViewSession
from truing.web.world.map_file import read_world, write_map, write_world
from truing.web.world.world_map import FrozenWorld, WorldMap

_TOOLS = {
    "pan": "Move",
    "paint": "Paint",
    "erase": "Erase",
    "wall": "Wall",
    "room": "Room",
    "place": "Place robot",
}
_GRIDS = {"none": "Off", "odometry": "Odometry", "corrected": "Corrected pose"}
_WALL_M = 0.05
_MAX_POINTS = 1500


class WorldPage:
    """State of one page."""

    def __init__(self, session: ViewSession, address: Address) -> None:
        self.session = session
        self.address = address
        self.brush_m = 0.1
        self.name = address.text("name", "room")
        self.tool = address.one_of("tool", _TOOLS, "pan")
        self.grid = address.one_of("grid", _GRIDS, "none")
        self.gate = ControlGate(session)
        self._show_settings: list[Callable[[], object]] = []

    def build(self) -> None:
        """Make the elements."""
        with tag("div", classes="view"):
            with tag("section", classes="stage", aria_label="Floor"):
                label = "The world from above: obstacles, walls and the robot"
                self.top = TopView(label, "world", fitted=True, address=self.address)
                self.top.set(tool=self.tool, grid=self.grid)
                self.top.on("stroke", self.stroke)
                self.top.on("place", self.place)
                with tag("div", classes="overlay"):
                    Choice("Tool", _TOOLS, self.tool, self.choose_tool)
                    button("Undo", self.undo, data_undo="")
                    button("Redo", self.redo, data_redo="")
                    button("Fit", self.top.fit)
            with tag("section", classes="side", aria_label="World and sensors"):
                with panel("Map"):
                    with tag("div", classes="row-tight"):
                        number("Brush, m", self.brush_m, self.set_brush, low=0.05, high=1.0, step=0.05)
                        self.name_field = text_field("Name", self.name, self.set_name, width_px=110)
                    with tag("div", classes="row-tight", style="margin-top:8px"):
                        button("Save", self.save, strong=True)
                        button("Load", lambda: self.gate.run("replace the world", self.load))
                        button("Clear", lambda: self.gate.run("clear the world", self.clear))
                    self.maps = Select("Open a saved map", {}, "", self.open_map)
                    self.list_maps()
                with panel("Sensors"):
                    self._sensors()
                with panel("Global map"):
                    Choice("Global map", _GRIDS, self.grid, self.show_grid)
                    with tag("div", classes="row-tight", style="margin-top:8px"):
                        Toggle("Odometry pose", False, lambda on: self.top.set(odometry=on))
                        button("Reset maps", self.reset_maps)
                        button("Save map", self.save_grid)
                    tag(
                        "p",
                        "Both maps are built from the same scans: one by odometry, which blurs as odometry "
                        "drifts, the other by the virtual robot's true pose.",
                        "dim",
                        style="font-size:12px;margin:6px 0 0",
                    )
                drive_panel()
        LiveKeys()

    def _sensors(self) -> None:
        sensing = self.session.sensing
        settings = sensing.settings
        with tag("div", classes="row-tight"):
            sonar = Toggle("Sonar", settings.sonar_on, lambda on: self.configure(sonar_on=on))
            laser = Toggle("Laser", settings.laser_on, lambda on: self.configure(laser_on=on))
        self._show_settings += [
            lambda: sonar.show(sensing.settings.sonar_on),
            lambda: laser.show(sensing.settings.laser_on),
        ]
        with tag("div", classes="row-tight", style="margin-top:8px"):
            for label, name, low, high, step in (
                ("Sonars", "sonar_count", 1, 64, 1),
                ("Cone, °", "sonar_cone_deg", 1, 90, 1),
                ("Sonar range, m", "sonar_range_m", 0.5, 20, 0.5),
                ("Laser FOV, °", "laser_fov_deg", 10, 360, 10),
                ("Laser range, m", "laser_range_m", 0.5, 40, 0.5),
                ("Rate, Hz", "rate_hz", 1, 40, 1),
                ("Range error, m", "noise_m", 0, 0.5, 0.005),
                ("Seed", "seed", 0, 1e6, 1),
            ):
                value = getattr(settings, name)
                kind = type(value)

                def change(new: float, name: str = name, kind: type = kind) -> None:
                    self.configure(**{name: kind(new)})

                field = number(label, value, change, low=low, high=high, step=step)
                self._show_settings.append(partial(self._show_setting, field, name))

    # ---- actions

    def configure(self, **changes: bool | float) -> None:
        """Change settings of the sensors; a page that may not shows those in force."""
        sensing = self.session.sensing
        if all(getattr(sensing.settings, name) == value for name, value in changes.items()):
            return
        self.gate.run("set the sensors", lambda: sensing.configure(**changes), self.show_settings)

    def _show_setting(self, field: ui.number, name: str) -> None:
        field.set_value(getattr(self.session.sensing.settings, name))

    def show_settings(self) -> None:
        """Show the settings of the sensors in force."""
        for show in self._show_settings:
            show()

    def reset_maps(self) -> None:
        """Begin both global maps anew."""
        self.gate.run("reset the maps", self.session.sensing.clear_maps)

    def set_brush(self, value: float) -> None:
        """Set the width of the brush."""
        self.brush_m = value
        self.top.set(brush=value)

    def stroke(self, event: events.GenericEventArguments) -> None:
        """Apply a stroke of the mouse."""
        tool = event.args.get("tool")
        points = [(float(x), float(y)) for x, y in event.args.get("points", [])[:_MAX_POINTS]]
        self.gate.run("change the world", lambda: self._paint(tool, points))

    def _paint(self, tool: str, points: list[tuple[float, float]]) -> None:
        world = self.session.world
        with self.session.sensing.world_lock:
            self.session.world_history.leave(world.frozen())
            if tool in ("paint", "erase"):
                world.paint_stroke(points, self.brush_m, tool == "paint")
            elif tool == "wall" and len(points) == 2:
                world.paint_stroke(points, _WALL_M, True)
            elif tool == "room" and len(points) == 2:
                world.paint_room(points[0], points[1], _WALL_M)

    def place(self, event: events.GenericEventArguments) -> None:
        """Set the robot's pose in the world; a real robot is not moved."""
        pose = Pose(event.args["x"], event.args["y"], event.args["theta"])
        self.gate.run("place the robot", lambda: self.session.place(pose))

    def clear(self) -> None:
        """Remove all obstacles."""
        with self.session.sensing.world_lock:
            self.session.world_history.leave(self.session.world.frozen())
            self.session.world.clear()

    def save(self) -> None:
        """Save the world."""
        try:
            path = self.session.map_folder / f"{checked_name(self.name)}.yaml"
            with self.session.sensing.world_lock:
                write_world(path, self.session.world)
        except TruingError as error:
            notify(with_next(error), good=False)
        else:
            notify(f"saved: {path} and .png")
            self.list_maps()

    def list_maps(self) -> None:
        """List the saved maps."""
        files = sorted(self.session.map_folder.glob("*.yaml"), key=lambda path: -path.stat().st_mtime)
        found = {path.stem: path.stem for path in files}
        self.maps.fill({"": "choose one" if found else "none yet"} | found, "")

    def open_map(self, name: str) -> None:
        """Replace the world by a saved map; Undo brings back the one before."""
        if name:
            self.name_field.value = name
            self.gate.run("replace the world", self.load, self.list_maps)

    def choose_tool(self, tool: str) -> None:
        """Select what the mouse does."""
        self.tool = tool
        self.top.set(tool=tool)
        self.address.write(tool=tool)

    def set_name(self, name: str) -> None:
        """Name the map."""
        self.name = name
        self.address.write(name=name)

    def undo(self) -> None:
        """Undo the last change of the world, of whichever page."""
        self.gate.run("change the world", partial(self._go_to, self.session.world_history.undo))

    def redo(self) -> None:
        """Redo what was undone."""
        self.gate.run("change the world", partial(self._go_to, self.session.world_history.redo))

    def _go_to(self, step: Callable[[FrozenWorld], FrozenWorld | None]) -> None:
        world = self.session.world
        with self.session.sensing.world_lock:
            found = step(world.frozen())
            if found is not None:
                world.replace(found.world())

    def load(self) -> None:
        """Load the map of this name."""
        try:
            self.use(read_world(self.session.map_folder / f"{checked_name(self.name)}.yaml"), self.name)
        except TruingError as error:
            notify(with_next(error), good=False)

    def use(self, world: WorldMap, name: str) -> None:
        """Replace the world by a map."""
        with self.session.sensing.world_lock:
            self.session.world_history.leave(self.session.world.frozen())
            self.session.world.replace(world)
        self.session.sensing.clear_maps()
        self.top.fit()
        notify(f"{name}: {world.size_m[0]:.1f} m by {world.size_m[1]:.1f} m at {world.resolution_m:g} m")

    def show_grid(self, grid: str) -> None:
        """Select the global map that is displayed."""
        self.grid = grid
        self.top.set(grid=grid)
        self.address.write(grid=grid)

    async def save_grid(self) -> None:
        """Save the displayed global map in the format of map_server."""
        sensing = self.session.sensing
        grid = sensing.odometry_map if self.grid == "odometry" else sensing.corrected_map
        kind = "odometry" if self.grid == "odometry" else "corrected"
        try:
            path = self.session.map_folder / f"{checked_name(self.name)}-{kind}.yaml"
            await asyncio.to_thread(write_map, path, grid.pixels(), grid.resolution_m, grid.origin_m)
        except TruingError as error:
            notify(with_next(error), good=False)
        else:
            notify(f"saved: {path} and .png")
