"""Trajectory: drive a model robot with six keys or draw lines and arcs; upload and run the result."""

from __future__ import annotations

import math
from dataclasses import dataclass

from nicegui import events, ui

from truing.errors import TruingError, with_next
from truing.plan import Plan, load_plan
from truing.web.limits import CYCLE_S
from truing.web.models.error_model import KINDS, Kind, offered_kinds
from truing.web.models.error_replay import replay_cycles
from truing.web.models.known_robot import known_robot
from truing.web.pages.address import Address
from truing.web.pages.components import ModelKeys, TopView
from truing.web.pages.elements import (
    Choice,
    PlainTable,
    Select,
    button,
    notify,
    number,
    panel,
    set_text,
    tag,
    text_field,
)
from truing.web.pages.live import task_panel
from truing.web.pages.run_preview import RunPreview
from truing.web.path.history import History
from truing.web.path.path_text import cycles_of_text, cycles_text, nodes_of, nodes_text
from truing.web.path.segments import Node, cycles_of, segments_through
from truing.web.path.sequence_file import checked_name, cycles_of_plan, plan_of, save_sequence
from truing.web.path.trajectory import Cycle, KeyTrajectory, braked_to_rest, duration_s, path_points, poses
from truing.web.pose import Pose
from truing.web.runs.plans import plans_of
from truing.web.session import ViewSession
from truing.web.worker.state import RunRequest

_TOOLS = {"pan": "Keys", "line": "Lines", "arc": "Arcs"}
_MAX_NODES = 60
_SHOWN_INPUTS = 6
_MODEL_COLOUR = "#d2a8ff"
_DESIRED_COLOUR = "#94a1b2"
_MAX_CYCLES = 3000
# So many cycles of driving by keys are one step of Undo: a second.
_UNDONE_CYCLES = 10
_KINDS: dict[str, Kind] = {str(kind): kind for kind in KINDS}


@dataclass(frozen=True, slots=True)
class _Drawn:
    """A path: its start, and nodes or control inputs."""

    start: Pose
    nodes: tuple[Node, ...]
    cycles: tuple[Cycle, ...]


class TrajectoryPage:
    """A trajectory under construction; each page has its own."""

    def __init__(self, session: ViewSession, address: Address) -> None:
        self.session = session
        self.address = address
        self.by_keys = KeyTrajectory(session.worker.limits)
        self.nodes: list[Node] = []
        self.history: History[_Drawn] = History()
        self.start = Pose()
        self.name = "path"
        self.tool = address.one_of("tool", _TOOLS, "pan")
        self._driving = self._filling = False
        self._open_address()
        self._last_shown: tuple[Pose, tuple[Cycle, ...]] = (self.start, ())
        self.preview = RunPreview(session)

    # ---- elements

    def build(self) -> None:
        """Make the elements."""
        with tag("div", classes="view"):
            with tag("section", classes="stage", aria_label="Canvas"):
                label = "The model robot, its path, and the robot while it drives"
                self.top = TopView(label, "model", address=self.address)
                self.top.set(pose=self.start.as_list(), tool=self.tool, driven=True)
                self.top.on("node", self.add_node)
                self.top.on("moved", self.move_node, throttle=0.05)
                with tag("div", classes="overlay"):
                    Choice("Drawing tool", _TOOLS, self.tool, self.choose_tool)
                    button("Undo", self.undo, data_undo="")
                    button("Redo", self.redo, data_redo="")
                    button("Fit", self.top.fit)
                    button("100 px/m", lambda: self.top.zoom(0), label="Scale of 100 pixels per metre")
            with tag("section", classes="side", aria_label="Control inputs"):
                self._speed()
                self._start()
                with panel("Control inputs"):
                    self.summary = tag("p", classes="num", role="status", style="margin:0")
                    self.limits_text = tag("p", classes="limited", role="status", style="margin:0")
                    self.table = PlainTable("The last control inputs")
                self._replay()
                self._file()
                task_panel()
        keys = ModelKeys()
        keys.on("cycle", self.cycle)
        keys.on("speed", self.change_speed)
        keys.on("stop", self.stop)
        self.show()
        ui.timer(0.4, self.follow_run)

    def _open_address(self) -> None:
        """Restore the path, its start and its name from the address."""
        start = self.address.numbers("start", 3)
        if start is not None:
            self.start = Pose(*start)
        self.nodes = nodes_of(self.address.text("nodes"), _MAX_NODES)
        cycles = [] if self.nodes else cycles_of_text(self.address.text("inputs"), _MAX_CYCLES)
        self._put(_Drawn(self.start, tuple(self.nodes), tuple(cycles)))
        share = self.address.numbers("speed", 1)
        if share is not None:
            self.by_keys.speed_fraction = min(1.0, max(0.1, round(share[0], 1)))
        self.name = self.address.text("name", self.name)

    def _speed(self) -> None:
        limits = self.by_keys.limits
        with panel("Drive by keys"):
            with tag("div", classes="row-tight"):
                for key, text in (("forward", "↑"), ("back", "↓"), ("left", "←"), ("right", "→")):
                    tag("button", text, "plain", type="button", data_live_key=key, aria_label=key)
                button("−", lambda: self._set_speed(self.by_keys.speed_fraction - 0.1), label="slower")
                button("+", lambda: self._set_speed(self.by_keys.speed_fraction + 0.1), label="faster")
                button("Stop", self.stop)
            self.speed = tag("p", classes="num", style="margin:6px 0 0")
            tag(
                "p",
                f"limits: {limits.speed_mps:.2f} m/s, "
                f"{math.degrees(limits.yaw_rate_radps):.0f} °/s, "
                f"wheel {limits.wheel_mps:.2f} m/s, {limits.accel_mps2:.1f} m/s²",
                "dim",
                style="font-size:12px;margin:2px 0 0",
            )

    def _start(self) -> None:
        with panel("Start"), tag("div", classes="row-tight"):
            x, y, theta = self.start.as_list()
            degrees = round(math.degrees(theta), 2)
            self.start_fields = (
                number("x, m", x, lambda v: self.set_start(x=v), low=-50, high=50, step=0.1),
                number("y, m", y, lambda v: self.set_start(y=v), low=-50, high=50, step=0.1),
                number("heading, °", degrees, lambda v: self.set_start(theta=v), low=-360, high=360, step=5),
            )
            button("Where the robot is", self.start_at_robot)

    def _replay(self) -> None:
        with panel("Simulated replay"):
            with tag("div", classes="row-tight"):
                Choice(
                    "Error model of the replay",
                    offered_kinds(self.session.model),
                    self.session.model.kind,
                    self.choose_model,
                )
                button("Replay", self.replay)
            self.replayed = tag("p", classes="note num", role="status", style="margin:4px 0 0")

    def _file(self) -> None:
        with panel("Sequence"):
            with tag("div", classes="row-tight"):
                self.name_field = text_field("Name", self.name, self.set_name)
                button("Reset", self.reset)
                button("Save", self.save)
                button("Upload and run", self.run, strong=True)
            self.saved_paths = Select("Open a saved path", {}, "", self.open_saved)
            self.list_saved()
            self.saved = tag("p", classes="note dim", role="status", style="margin:4px 0 0")

    # ---- keys

    def cycle(self, event: events.GenericEventArguments) -> None:
        """Advance by one cycle with the held keys."""
        if self.nodes:
            return
        keys = [key for key in event.args if isinstance(key, str)] if isinstance(event.args, list) else []
        if len(self.by_keys.cycles) % _UNDONE_CYCLES == 0:
            self._leave()
        pose = self.by_keys.cycle(keys)
        self.top.set_model(pose, path_points(self.start, self.by_keys.cycles))
        self.show(path_drawn=True)

    def change_speed(self, event: events.GenericEventArguments) -> None:
        """Faster or slower."""
        self._set_speed(self.by_keys.speed_fraction + (0.1 if event.args is True else -0.1))

    def _set_speed(self, share: float) -> None:
        self.by_keys.speed_fraction = min(1.0, max(0.1, round(share, 1)))
        self.show()

    def stop(self, _event: object = None) -> None:
        """The model robot brakes."""
        if self.by_keys.cycles:
            self._leave()
        self.by_keys.stop()
        self.show()

    def undo(self) -> None:
        """Undo the last change: a second of driving, a node, a start, a reset."""
        self._go_to(self.history.undo(self._drawn()))

    def redo(self) -> None:
        """Redo what was undone."""
        self._go_to(self.history.redo(self._drawn()))

    def _drawn(self) -> _Drawn:
        return _Drawn(self.start, tuple(self.nodes), tuple(self.by_keys.cycles))

    def _leave(self) -> None:
        self.history.leave(self._drawn())

    def _put(self, drawn: _Drawn) -> None:
        self.start, self.nodes = drawn.start, list(drawn.nodes)
        self.by_keys.reset(self.start)
        self.by_keys.cycles = list(drawn.cycles)
        self.by_keys.pose = poses(self.start, self.by_keys.cycles)[-1]

    def _go_to(self, drawn: _Drawn | None) -> None:
        if drawn is not None:
            self._put(drawn)
            self._show_start()
            self.show()

    def reset(self) -> None:
        """Remove the path and return to the start."""
        self._leave()
        self.nodes.clear()
        self.by_keys.reset(self.start)
        self.show()

    def set_start(
        self, *, x: float | None = None, y: float | None = None, theta: float | None = None
    ) -> None:
        """Set the start pose of the model robot."""
        if self._filling:
            return
        start = Pose(
            self.start.x_m if x is None else x,
            self.start.y_m if y is None else y,
            self.start.theta_rad if theta is None else math.radians(theta),
        )
        self._start_at(start)

    def _start_at(self, start: Pose) -> None:
        if start != self.start:
            self._leave()
            self._put(_Drawn(start, tuple(self.nodes), tuple(self.by_keys.cycles)))
            self.show()

    def start_at_robot(self) -> None:
        """Start the path where the robot is."""
        self._start_at(self.session.corrected_pose() or Pose())
        self._show_start()

    def _show_start(self) -> None:
        x, y, theta = self.start.as_list()
        self._filling = True
        for field, value in zip(self.start_fields, (x, y, math.degrees(theta)), strict=True):
            field.value = round(value, 2)
        self._filling = False

    # ---- lines and arcs

    def choose_tool(self, tool: str) -> None:
        """Select keys, lines or arcs."""
        self.address.write(tool=tool)
        self.top.set(tool=tool)

    def add_node(self, event: events.GenericEventArguments) -> None:
        """A click: append a node."""
        if self.by_keys.cycles:
            notify("this path was driven by keys: reset it before drawing", good=False)
            return
        if len(self.nodes) >= _MAX_NODES:
            notify(
                f"a path has at most {_MAX_NODES} points: undo one, or save this path and begin another",
                good=False,
            )
            return
        x, y = float(event.args["x"]), float(event.args["y"])
        self._leave()
        self.nodes.append(Node(x, y, "arc" if event.args["kind"] == "arc" else "line"))
        self.show()

    def move_node(self, event: events.GenericEventArguments) -> None:
        """A drag: move a node."""
        index = int(event.args["index"])
        if event.args.get("first"):
            self._leave()
        if 0 <= index < len(self.nodes):
            self.nodes[index] = Node(float(event.args["x"]), float(event.args["y"]), self.nodes[index].kind)
            self.show()

    # ---- result

    @property
    def cycles(self) -> list[Cycle]:
        """The control inputs, ending at rest."""
        limits = self.session.worker.limits
        if self.nodes:
            return cycles_of(segments_through(self.start, self.nodes), limits, self.by_keys.speed_fraction)
        return braked_to_rest(self.by_keys.cycles, limits)

    def plan(self) -> Plan:
        """The plan of the control inputs."""
        return plan_of(checked_name(self.name), self.cycles)

    def show(self, *, path_drawn: bool = False) -> None:
        """Update all texts, the table and the path."""
        self.by_keys.limits = self.session.worker.limits
        cycles = self.cycles if self.nodes else self.by_keys.cycles
        self.keep()
        self._forget_replay(cycles)
        limits, speed_fraction = self.by_keys.limits, self.by_keys.speed_fraction
        set_text(
            self.speed,
            f"{100 * speed_fraction:.0f} %   {speed_fraction * limits.speed_mps:.2f} m/s   "
            f"{math.degrees(speed_fraction * limits.yaw_rate_radps):.0f} °/s",
        )
        at = poses(self.start, cycles)[-1]
        set_text(
            self.summary,
            f"{len(cycles)} cycles  {duration_s(cycles):.1f} s\n"
            f"ends at {at.x_m:.3f}, {at.y_m:.3f} m, {math.degrees(at.theta_rad):.1f} °",
        )
        limited_by = self.by_keys.limited_by
        set_text(
            self.limits_text, f"limited by: {', '.join(limited_by)}" if limited_by and not self.nodes else ""
        )
        rows = [
            [f"{k * 0.1:.1f}", f"{cycle.v_mps:.3f}", f"{cycle.omega_radps:.3f}"]
            for k, cycle in list(enumerate(cycles))[-_SHOWN_INPUTS:]
        ]
        self.table.fill(["t, s", "v, m/s", "ω, rad/s"], rows[::-1])
        if not path_drawn:
            self.top.set_model(at, path_points(self.start, cycles))
            self.top.set(
                pose=self.start.as_list(), nodes=[[node.x_m, node.y_m, node.kind] for node in self.nodes]
            )

    def _forget_replay(self, cycles: list[Cycle]) -> None:
        """Remove the replay and the file's name of another path."""
        shown = (self.start, tuple(cycles))
        if shown != self._last_shown:
            self._last_shown = shown
            if self.top.value("paths"):
                self.top.set(paths=[])
            set_text(self.replayed, "")
            set_text(self.saved, "")

    def keep(self) -> None:
        """Keep the path in the address."""
        start = ",".join(f"{value:g}" for value in self.start.as_list())
        self.address.write(
            start="" if self.start == Pose() else start,
            nodes=nodes_text(self.nodes),
            inputs="" if self.nodes else cycles_text(self.by_keys.cycles),
            speed=f"{self.by_keys.speed_fraction:g}",
        )

    def set_name(self, name: str) -> None:
        """Name the path."""
        self.name = name
        self.address.write(name=name)

    # ---- saved paths, and the run

    def list_saved(self) -> None:
        """List the saved paths."""
        found = plans_of("saved", self.session.sequence_folder, self.session.diagnosis_folder)
        self.saved_paths.fill({"": "choose one" if found else "none yet"} | found, "")

    def open_saved(self, path: str) -> None:
        """Open a saved path; Undo brings back the one before."""
        if not path:
            return
        try:
            plan = load_plan(path)
            cycles = cycles_of_plan(plan, self.session.worker.limits.wheelbase_m)
        except TruingError as error:
            notify(with_next(error), good=False)
            return
        self._leave()
        self._put(_Drawn(self.start, (), tuple(_in_cycles(cycles)[:_MAX_CYCLES])))
        self.name_field.value = plan.name
        self.show()

    def follow_run(self) -> None:
        """While a run drives: the path that it should take, from where the robot stood."""
        task = self.session.worker.snapshot.task
        driving = task is not None and task.stage == "driving"
        if driving and not self._driving:
            pose = self.session.corrected_pose() or Pose()
            points = path_points(pose, self.cycles)
            title = "desired, from where the robot stood"
            shown = {"points": points, "colour": _DESIRED_COLOUR, "dash": [8, 5], "name": "", "title": title}
            self.top.set(paths=[shown])
        self._driving = driving

    def choose_model(self, kind: str) -> None:
        """Select the active error model, for all pages."""
        self.session.set_model(kind=_KINDS[kind])
        self.top.set(paths=[])
        set_text(self.replayed, "")

    async def replay(self) -> None:
        """Replay the control inputs from the start, without and with the active error model."""
        cycles, model = self.cycles, self.session.model
        if not cycles:
            notify("there is no path: drive or draw one first", good=False)
            return
        path = path_points(self.start, cycles)
        try:
            erroneous = await self._erroneous(cycles)
        except TruingError as error:
            notify(with_next(error), good=False)
            return
        title = "MOM paper's error model" if model.kind == "paper" else "diagnosed model"
        shown = {"points": erroneous, "colour": _MODEL_COLOUR, "dash": [6, 4], "name": title, "title": title}
        self.top.set(paths=[shown] if erroneous else [])
        text = "no error model: the path follows the control inputs exactly"
        if erroneous:
            (x, y, theta), end = erroneous[-1], poses(self.start, cycles)[-1]
            text = (
                f"{title}: ends at {x:.3f}, {y:.3f} m, {math.degrees(theta):.1f} °, "
                f"{math.hypot(x - end.x_m, y - end.y_m):.3f} m from the desired end"
            )
        set_text(self.replayed, text)
        self.top.play(path, min(duration_s(cycles), 20.0))

    async def _erroneous(self, cycles: list[Cycle]) -> list[list[float]]:
        """The path under the active error model; empty without one."""
        model = self.session.model
        if model.kind == "paper":
            return replay_cycles(model.paper, self.start, cycles)
        if model.kind == "none":
            return []
        set_text(self.replayed, "simulating …")
        request = {
            "kind": "replay",
            "cycles": [[cycle.v_mps, cycle.omega_radps, cycle.duration_s] for cycle in cycles],
            "robot": known_robot(self.session.worker.parameters),
            "model": model.to_json(),
            "start": self.start.as_list(),
        }
        found: list[list[float]] = (await self.session.simulation.ask(request))["path"]
        return found

    def save(self) -> None:
        """Save the sequence file."""
        try:
            path = save_sequence(self.plan(), self.session.sequence_folder)
        except TruingError as error:
            notify(with_next(error), good=False)
            return
        set_text(self.saved, f"saved: {path}")
        self.list_saved()

    def run(self) -> None:
        """Save the sequence, show what it will do, and run it on the board; the run is recorded."""
        try:
            plan = self.plan()
            save_sequence(plan, self.session.sequence_folder)
            request = RunRequest(plan, self.session.run_folder, plan.name)
            self.preview.show(request)
        except TruingError as error:
            notify(with_next(error), good=False)


def _in_cycles(cycles: list[Cycle]) -> list[Cycle]:
    """Control inputs of a cycle's length each, as keys make them; the last of each may be shorter."""
    found = []
    for cycle in cycles:
        whole = int(cycle.duration_s / CYCLE_S + 1e-9)
        found += [Cycle(cycle.v_mps, cycle.omega_radps)] * whole
        rest = round(cycle.duration_s - whole * CYCLE_S, 3)
        if rest > 0.0:
            found.append(Cycle(cycle.v_mps, cycle.omega_radps, rest))
    return found
