"""Live: pose, commands and measurements of the robot; manual driving."""

from __future__ import annotations

from functools import partial

from truing.web.pages.address import Address
from truing.web.pages.components import LiveKeys, Plot, TopView
from truing.web.pages.control import ControlGate
from truing.web.pages.elements import Toggle, button, live_text, panel, tag
from truing.web.session import ViewSession

_KEYS = (
    ("", ""),
    ("forward", "↑"),
    ("", ""),
    ("left", "←"),
    ("", ""),
    ("right", "→"),
    ("", ""),
    ("back", "↓"),
    ("", ""),
)


_SHOWN = ("follow", "sensors", "odometry")


def build(session: ViewSession, address: Address) -> None:
    """The page."""

    def show(name: str, on: bool) -> None:
        top.set(**{name: on})
        address.write({name: "1" if on else "0"})

    with tag("div", classes="view"):
        with tag("section", classes="stage", aria_label="Floor"):
            label = "The robot, its trail and its sensors from above"
            top = TopView(label, "live", fitted=True, address=address)
            shown = {name: address.flag(name, name == "sensors") for name in _SHOWN}
            top.set(**shown)
            with tag("div", classes="overlay"):
                for name, on in shown.items():
                    Toggle(name.capitalize(), on, partial(show, name))
                button("Clear trail", data_live_trail="")
                button("Fit", top.fit)
        with tag("section", classes="side", aria_label="Instruments"):
            instruments()
            connection(session)
            task_panel()
    LiveKeys()


def instruments() -> None:
    """Speeds, efforts and their recent history."""
    with panel("Wheels"), tag("div", classes="gauges"):
        tag("span", "")
        tag("span", "left", "head left")
        tag("span", "right", "head right")
        for name, unit, text in (
            ("command", "m/s", "commanded"),
            ("speed", "m/s", "measured"),
            ("effort", "%", "effort"),
        ):
            tag("span", f"{text}, {unit}", "name")
            live_text(f"{name}-left", "num left")
            live_text(f"{name}-right", "num right")
        tag("span", "")
        for side in ("left", "right"):
            with tag("div", classes=f"meter {side}", aria_hidden="true"):
                tag("span", data_live_bar=f"effort-{side}")
    Plot("Wheel speeds, commands and efforts", source="live").classes("strip")
    drive_panel()
    pose_facts()


def pose_facts() -> None:
    """The robot's pose and how well it is known."""
    with panel("Pose"):
        facts(
            ("x", "x, m"),
            ("theta", "heading, °"),
            ("y", "y, m"),
            ("forward", "speed, m/s"),
            ("odometry-error", "odometry error, mm"),
            ("frame-rate", "frame rate, Hz"),
        )


def facts(*rows: tuple[str, str]) -> None:
    """Names and live values in two columns."""
    with tag("div", classes="pair"):
        for half in (rows[::2], rows[1::2]):
            with tag("dl", classes="facts", style="align-content:start"):
                for name, text in half:
                    tag("dt", text)
                    live_text(name, "num", "dd")


def drive_panel() -> None:
    """Take control, drive, change speed."""
    with panel("Drive"):
        with tag("div", classes="row-tight"):
            tag("button", "Take control", "plain strong", type="button", data_live_claim="")
            button("−", label="slower").on(
                "click", js_handler="() => window.truing.live.keyTarget()?.faster(false)"
            )
            live_text("speed-fraction", "num", first="40 %")
            button("+", label="faster").on(
                "click", js_handler="() => window.truing.live.keyTarget()?.faster(true)"
            )
        with tag("div", classes="keys", style="margin-top:8px", aria_label="Driving keys", role="group"):
            for key, arrow in _KEYS:
                if key:
                    tag("button", arrow, "plain", type="button", data_live_key=key, aria_label=key)
                else:
                    tag("span", "")


def connection(session: ViewSession) -> None:
    """Board and link state; connect and disconnect."""
    gate = ControlGate(session)
    with panel("Board"):
        facts(
            ("board-name", "board"),
            ("battery", "battery, V"),
            ("mode", "mode"),
            ("sequence", "sequence"),
            ("log", "log"),
            ("source-rate", "sample rate"),
        )
        with tag("p", classes="note", role="status", style="margin:6px 0"):
            live_text("link-message", "")
            tag("span", " ")
            live_text("link-next", "dim", first="")
        with tag("div", classes="row-tight"):
            button("Connect", lambda: gate.run("connect the board", session.worker.reconnect))
            button("Disconnect", lambda: gate.run("disconnect the board", session.worker.disconnect))


def task_panel() -> None:
    """The running plan and its result."""
    with panel("Plan"):
        with tag("p", style="margin:0 0 4px", role="status"):
            live_text("task", "")
        with tag("div", classes="meter task", aria_hidden="true"):
            tag("span", data_live_bar="task")
        with tag("p", style="margin:4px 0 0", classes="note"):
            live_text("task-problem", "", first="")
            live_text("task-saved", "dim", first="")
