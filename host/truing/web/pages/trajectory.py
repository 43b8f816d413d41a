"""Trajectory: drive the model robot with six keys or draw lines and arcs; upload and run what comes of it."""

from __future__ import annotations

import math

from nicegui import context, events, ui

from truing.errors import TruingError
from truing.plan import Plan
from truing.web.board_worker import RunOrder
from truing.web.elements import Choice, ModelKeys, PlainTable, TopView, button, heading, number, say, tag
from truing.web.error_model import KINDS, Kind
from truing.web.error_replay import replay_cycles
from truing.web.known_robot import known_robot
from truing.web.pages.live import task_panel
from truing.web.path_segments import Node, cycles_of, segments_through
from truing.web.pose import Pose
from truing.web.sequence_file import checked_name, plan_of, save_sequence
from truing.web.session import ViewSession
from truing.web.trajectory import Cycle, KeyTrajectory, braked, drawn, duration_s, poses

_TOOLS = {"pan": "Keys", "line": "Lines", "arc": "Arcs"}
_MOST_NODES = 60
_SHOWN_INPUTS = 6
_MODEL_COLOUR = "#d2a8ff"
_KINDS: dict[str, Kind] = {str(kind): kind for kind in KINDS}


def build(session: ViewSession) -> None:
    """The page."""
    _TrajectoryPage(session).build()


class _TrajectoryPage:
    """A trajectory in the making; each page has its own."""

    def __init__(self, session: ViewSession) -> None:
        self.session = session
        self.client = context.client
        self.by_keys = KeyTrajectory(session.worker.limits)
        self.nodes: list[Node] = []
        self.start = Pose()
        self.name = "path"
        self.share = 0.5

    # ---- elements

    def build(self) -> None:
        """Make the elements."""
        with tag("div", classes="view"):
            with tag("section", classes="stage", aria_label="Canvas"):
                self.top = TopView("The model robot and its painted path, 100 pixels to a metre", "model")
                self.top.set(pose=self.start.as_list())
                self.top.on("node", self.add_node)
                self.top.on("moved", self.move_node, throttle=0.05)
                with tag("div", classes="overlay"):
                    Choice("How", _TOOLS, "pan", self.choose_tool)
                    button("Undo", self.undo)
                    button("Fit", self.top.fit)
                    button("100 px/m", lambda: self.top.zoom(0), label="Scale of 100 pixels to a metre")
            with tag("section", classes="side", aria_label="Control inputs"):
                self._speed()
                self._start()
                with tag("div"):
                    heading("Control inputs u(t)")
                    self.told = tag("p", classes="num", role="status", style="margin:0")
                    self.held = tag("p", classes="held", role="status", style="margin:0")
                    self.table = PlainTable("The last control inputs")
                self._replay()
                self._file()
                task_panel()
        keys = ModelKeys()
        keys.on("cycle", self.cycle)
        keys.on("speed", self.change_speed)
        keys.on("stop", self.stop)
        self.show()

    def _speed(self) -> None:
        limits = self.by_keys.limits
        with tag("div"):
            heading("Six keys")
            with tag("div", classes="row-tight"):
                for key, text in (("forward", "↑"), ("back", "↓"), ("left", "←"), ("right", "→")):
                    tag("button", text, "plain", type="button", data_live_key=key, aria_label=key)
                button("−", lambda: self._set_share(self.by_keys.share - 0.1), label="slower")
                button("+", lambda: self._set_share(self.by_keys.share + 0.1), label="faster")
                button("Stop", self.stop)
            self.speed = tag("p", classes="num", style="margin:6px 0 0")
            tag(
                "p",
                f"limits of this robot: {limits.speed_mps:.2f} m/s, "
                f"{math.degrees(limits.turn_radps):.0f} °/s, "
                f"wheel {limits.wheel_mps:.2f} m/s, {limits.accel_mps2:.1f} m/s²",
                "dim",
                style="font-size:12px;margin:2px 0 0",
            )

    def _start(self) -> None:
        with tag("div"):
            heading("Start")
            with tag("div", classes="row-tight"):
                number("x, m", 0.0, lambda v: self.set_start(x=v), low=-50, high=50, step=0.1)
                number("y, m", 0.0, lambda v: self.set_start(y=v), low=-50, high=50, step=0.1)
                number("heading, °", 0.0, lambda v: self.set_start(theta=v), low=-360, high=360, step=5)

    def _replay(self) -> None:
        with tag("div"):
            heading("Replay on the model")
            with tag("div", classes="row-tight"):
                texts = {str(kind): text for kind, text in KINDS.items()}
                Choice("Error model of the replay", texts, self.session.model.kind, self.choose_model)
                button("Replay", self.replay)
            self.replayed = tag("p", classes="told num", role="status", style="margin:4px 0 0")

    def _file(self) -> None:
        with tag("div"):
            heading("Sequence")
            with tag("div", classes="row-tight"):
                name = ui.input("Name", value=self.name).props("dense outlined dark").style("width:130px")
                name.on_value_change(lambda event: setattr(self, "name", str(event.value)))
                button("Reset", self.reset)
                button("Save", self.save)
                button("Upload and run", self.run, strong=True)
            self.saved = tag("p", classes="told dim", role="status", style="margin:4px 0 0")

    # ---- keys

    def cycle(self, event: events.GenericEventArguments) -> None:
        """One cycle of held keys."""
        if self.nodes:
            return
        keys = [key for key in event.args if isinstance(key, str)] if isinstance(event.args, list) else []
        pose = self.by_keys.cycle(keys)
        self.top.set_model(pose, drawn(self.start, self.by_keys.cycles))
        self.show(painted=True)

    def change_speed(self, event: events.GenericEventArguments) -> None:
        """Faster or slower."""
        self._set_share(self.by_keys.share + (0.1 if event.args is True else -0.1))

    def _set_share(self, share: float) -> None:
        self.by_keys.share = min(1.0, max(0.1, round(share, 1)))
        self.show()

    def stop(self, _event: object = None) -> None:
        """The model robot brakes."""
        self.by_keys.stop()
        self.show()

    def undo(self) -> None:
        """Take back a second of driving, or the last node."""
        if self.nodes:
            self.nodes.pop()
        else:
            self.by_keys.undo()
        self.show()

    def reset(self) -> None:
        """Begin anew at the start."""
        self.nodes.clear()
        self.by_keys.reset(self.start)
        self.show()

    def set_start(
        self, *, x: float | None = None, y: float | None = None, theta: float | None = None
    ) -> None:
        """Where the model robot begins."""
        self.start = Pose(
            self.start.x_m if x is None else x,
            self.start.y_m if y is None else y,
            self.start.theta_rad if theta is None else math.radians(theta),
        )
        cycles = list(self.by_keys.cycles)
        self.by_keys.reset(self.start)
        self.by_keys.cycles = cycles
        self.by_keys.pose = poses(self.start, cycles)[-1]
        self.show()

    # ---- lines and arcs

    def choose_tool(self, tool: str) -> None:
        """Keys, lines or arcs."""
        self.top.set(tool=tool)

    def add_node(self, event: events.GenericEventArguments) -> None:
        """A click: the path goes on to here."""
        if self.by_keys.cycles:
            say("this path was driven by keys; reset it to draw one", good=False)
            return
        if len(self.nodes) >= _MOST_NODES:
            say(f"a path has at most {_MOST_NODES} points", good=False)
            return
        x, y = float(event.args["x"]), float(event.args["y"])
        self.nodes.append(Node(x, y, "arc" if event.args["kind"] == "arc" else "line"))
        self.show()

    def move_node(self, event: events.GenericEventArguments) -> None:
        """A drag: a point goes elsewhere, and the path with it."""
        index = int(event.args["index"])
        if 0 <= index < len(self.nodes):
            self.nodes[index] = Node(float(event.args["x"]), float(event.args["y"]), self.nodes[index].kind)
            self.show()

    # ---- what comes of it

    @property
    def cycles(self) -> list[Cycle]:
        """The control inputs, the robot standing at their end."""
        limits = self.session.worker.limits
        if self.nodes:
            return cycles_of(segments_through(self.start, self.nodes), limits, self.share)
        return braked(self.by_keys.cycles, limits)

    def plan(self) -> Plan:
        """The sequence."""
        return plan_of(checked_name(self.name), self.cycles)

    def show(self, *, painted: bool = False) -> None:
        """Write everything anew."""
        self.by_keys.limits = self.session.worker.limits
        cycles = self.cycles if self.nodes else self.by_keys.cycles
        limits, share = self.by_keys.limits, self.by_keys.share
        self.share = share
        _write(
            self.speed,
            f"{100 * share:.0f} %   {share * limits.speed_mps:.2f} m/s   "
            f"{math.degrees(share * limits.turn_radps):.0f} °/s",
        )
        at = poses(self.start, cycles)[-1]
        _write(
            self.told,
            f"{len(cycles)} cycles  {duration_s(cycles):.1f} s\n"
            f"ends at {at.x_m:.3f}, {at.y_m:.3f} m, {math.degrees(at.theta_rad):.1f} °",
        )
        held = self.by_keys.held
        _write(self.held, f"held back by: {', '.join(held)}" if held and not self.nodes else "")
        rows = [
            [f"{k * 0.1:.1f}", f"{cycle.v_mps:.3f}", f"{cycle.omega_radps:.3f}"]
            for k, cycle in list(enumerate(cycles))[-_SHOWN_INPUTS:]
        ]
        self.table.fill(["t, s", "v, m/s", "ω, rad/s"], rows[::-1])
        if not painted:
            self.top.set_model(at, drawn(self.start, cycles))
            self.top.set(
                pose=self.start.as_list(), nodes=[[node.x_m, node.y_m, node.kind] for node in self.nodes]
            )

    def choose_model(self, kind: str) -> None:
        """None, the paper's, or what was found: it is in force everywhere."""
        model = self.session.model
        if kind == "found" and not model.effects and not model.numbers:
            say("nothing was found yet: choose a diagnosis under Error models, and save it", good=False)
        self.session.set_model(kind=_KINDS[kind])
        self.top.set(paths=[])
        _write(self.replayed, "")

    async def replay(self) -> None:
        """The model robot drives the control inputs again, from the start; the one with errors beside it."""
        cycles, model = self.cycles, self.session.model
        if not cycles:
            say("there is nothing to replay: drive a path, or draw one", good=False)
            return
        path = drawn(self.start, cycles)
        try:
            erring = await self._erring(cycles)
        except TruingError as error:
            say(str(error), good=False)
            return
        title = "with the paper's errors" if model.kind == "paper" else "with what was found"
        shown = {"points": erring, "colour": _MODEL_COLOUR, "dash": [6, 4], "name": title, "title": title}
        self.top.set(paths=[shown] if erring else [])
        text = "no errors: the model robot goes exactly where it is told"
        if erring:
            (x, y, theta), end = erring[-1], poses(self.start, cycles)[-1]
            text = (
                f"{title}: ends at {x:.3f}, {y:.3f} m, {math.degrees(theta):.1f} °, "
                f"{math.hypot(x - end.x_m, y - end.y_m):.3f} m off"
            )
        _write(self.replayed, text)
        self.top.play(path, min(duration_s(cycles), 20.0))

    async def _erring(self, cycles: list[Cycle]) -> list[list[float]]:
        """The path under the model that is in force; empty where that is none."""
        model = self.session.model
        if model.kind == "paper":
            return replay_cycles(model.paper, self.start, cycles)
        if model.kind == "none":
            return []
        _write(self.replayed, "simulating …")
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
        """Write the sequence file."""
        try:
            path = save_sequence(self.plan(), self.session.sequence_folder)
        except TruingError as error:
            say(str(error), good=False)
            return
        _write(self.saved, f"saved: {path}")

    def run(self) -> None:
        """Save, upload, drive on the board, fetch the log, write the run."""
        try:
            plan = self.plan()
            save_sequence(plan, self.session.sequence_folder)
            order = RunOrder(plan, self.session.run_folder, plan.name)
            self.session.run(self.client.id, order)
        except TruingError as error:
            say(str(error), good=False)


def _write(element: ui.element, text: str) -> None:
    element._text = text
    element.update()
