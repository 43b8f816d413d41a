"""The frame of every page: navigation, link state, driver and stop button."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from nicegui import context, ui

from truing.web.pages.address import Address
from truing.web.pages.control import ControlGate
from truing.web.pages.elements import button, dialog_box, live_text, tag
from truing.web.session import ViewSession

PAGES = {
    "/": "Live",
    "/world": "World",
    "/trajectory": "Trajectory",
    "/compare": "Compare",
    "/models": "Error models",
    "/analysis": "Analysis",
    "/scene": "3-D",
    "/experiments": "Experiments",
    "/parameters": "Parameters",
}
# Pages that show a run: the one chosen on one of them is shown by the others too.
_SHOW_RUNS = ("/compare", "/models", "/analysis")

_HELP = (
    ("↑ ↓ ← → or W A S D", "drive while held: forward, back, left, right"),
    ("+ and −", "faster, slower"),
    ("space", "stop, from every page"),
    ("C", "take or release control"),
    (f"1 to {len(PAGES)}", "pages"),
    ("I J K L, comma, full stop, F, 0", "floor view: pan, zoom, fit, 100 px/m"),
    ("Enter", "floor view: apply the tool at the centre"),
    ("J L, comma, full stop, F, I K, P", "plot: pan, zoom, all of it, cursor, play or pause"),
    ("Ctrl Z, Ctrl Y", "World and Trajectory: undo, redo"),
)


def frame(session: ViewSession, routes: dict[str, Callable[[Address], None]]) -> None:
    """The navigation bar, the faults, and the page of the present address."""
    ui.add_head_html(
        '<link rel="stylesheet" href="/view-static/theme.css">'
        '<link rel="modulepreload" href="/view-static/live.js">'
        '<link rel="modulepreload" href="/view-static/address.js">'
        '<script type="module">import { live } from "/view-static/live.js";'
        'import "/view-static/address.js";'
        f'live.start("{context.client.id}");</script>'
    )
    ui.query("html").props('lang="en"')
    help_box = _help()
    gate = ControlGate(session)
    with tag("header", classes="bar-top"):
        tag("h1", "truing")
        with tag("nav", aria_label="Pages"):
            links = {}
            for number, (path, name) in enumerate(PAGES.items(), 1):
                shows_runs = {"data_shows_runs": ""} if path in _SHOW_RUNS else {}
                links[path] = tag("a", href=path, data_page=path, **shows_runs)
                with links[path]:
                    tag("span", name)
                    tag("kbd", str(number), aria_hidden="true")
        with tag("div", classes="state"):
            with tag("span", classes="lamp link", role="status"):
                live_text("link", "", first="connecting")
            with tag("span", classes="lamp faults", role="status"):
                live_text("state", "num")
            with tag("span", classes="lamp driver long", role="status"):
                live_text("driver", "", first="no driver")
            tag("button", "Keys ?", "plain long", type="button", data_help="").on("click", help_box.open, [])
            with tag("button", "STOP", "stop", type="button", data_live_stop="", aria_keyshortcuts="Space"):
                tag("kbd", "space", aria_hidden="true", style="color:#fff;border-color:#e58f89")
        tag("div", "STOP NOT DELIVERED: cut the power", "stop-alert", role="alert")
    with tag("section", classes="fault-banner", aria_label="Faults"):
        with tag("div", role="alert"):
            tag("ul", classes="faults", data_live_faults="")
        clear = partial(gate.run, "clear the faults", session.worker.clear_faults)
        button("Clear", clear, label="Clear faults")

    def mark(path: str) -> None:
        for at, link in links.items():
            if at == path:
                link._props["aria-current"] = "page"
            else:
                link._props.pop("aria-current", None)
            link.update()

    router = context.client.sub_pages_router
    address = Address(router.current_path)

    def marked(path: str, build: Callable[[Address], None]) -> Callable[[], None]:
        def page() -> None:
            mark(path)
            ui.page_title(f"{PAGES[path]} · truing")
            with tag("main"):
                build(address)

        return page

    def opened(to: str) -> None:
        before = address.path
        shown = address.shows(to)
        address.opened(to)
        # Back to another state of the same page: it is made anew from its address.
        if address.path == before and not shown:
            pages.refresh()

    router.on_path_changed(opened)
    pages = ui.sub_pages({path: marked(path, build) for path, build in routes.items()})


def _help() -> ui.dialog:
    with ui.dialog() as dialog, dialog_box():
        tag("h2", "Keys")
        with tag("dl", classes="facts"):
            for keys, what in _HELP:
                tag("dt", what)
                with tag("dd"):
                    tag("kbd", keys)
    dialog.props('aria-label="Keys"')
    return dialog
