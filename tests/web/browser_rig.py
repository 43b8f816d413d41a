"""Shared parts of the browser tests: a board, a link that can be cut, the view and its pages."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from support.served_board import ServedBoard
from web.view_process import CutLink, ViewProcess

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext, Page, ViewportSize


START = "Start in 3 s"


# In the page itself: when its own picture or table stands there, ms after the navigation began.
MARK_FIRST_PICTURE = """(() => { const look = () => {
    const picture = document.querySelector('main canvas, main table tbody tr');
    if (picture?.clientWidth) window.firstMs = performance.now(); else requestAnimationFrame(look);
}; look(); })()"""


# In the page itself: a picture at most every 90 ms, as on a slow machine. Thirty a second in software take a
# fifth of a core; a test that reads numbers and presses keys sees no more of them.
_FEW_PICTURES = """(() => {
    const ask = window.requestAnimationFrame.bind(window), forget = window.cancelAnimationFrame.bind(window);
    const asked = new Map();
    let last = 0;
    window.requestAnimationFrame = (draw) => {
        const id = setTimeout(() => asked.set(id, ask((now) => { asked.delete(id); last = now; draw(now); })),
            Math.max(0, last + 90 - performance.now()));
        return id;
    };
    window.cancelAnimationFrame = (id) => { clearTimeout(id); forget(asked.get(id)); asked.delete(id); };
})()"""


class Rig:
    """A board, a link that can be cut, and the view connected through it."""

    def __init__(self, folder: Path) -> None:
        self.board = ServedBoard(folder)
        self.link = CutLink(self.board.tcp)
        self.view = ViewProcess(folder / "out", port=self.link.port)

    def close(self) -> None:
        self.view.close()
        self.link.close()
        self.board.kill()


class Problems(list[str]):
    """Script errors of a page, and every request that leaves the view."""


def open_page(
    opener: Browser | BrowserContext,
    rig: Rig,
    problems: Problems,
    path: str = "",
    width: int = 1280,
    height: int = 720,
    every_picture: bool = False,
) -> Page:
    """A page of its own context with a browser, a further page of that context with a context."""
    size: ViewportSize = {"width": width, "height": height}
    if hasattr(opener, "new_context"):
        page = opener.new_page(viewport=size)
    else:
        page = opener.new_page()
        page.set_viewport_size(size)
    page.set_default_timeout(30_000)
    if not every_picture:
        page.add_init_script(_FEW_PICTURES)
    page.add_init_script(MARK_FIRST_PICTURE)
    page.on("pageerror", lambda error: problems.append(str(error)))

    def asked(request: object) -> None:
        url = str(getattr(request, "url", ""))
        if not url.startswith((rig.view.address, "data:", "blob:")):
            problems.append(f"asked for {url}")

    page.on("request", asked)
    page.goto(rig.view.address + path)
    wait(lambda: live(page, "state.link?.state") == "connected", "a connected board")
    wait(lambda: live(page, "samples.length") > 0, "samples")
    return page


def address(page: Page) -> str:
    """Path and query; `page.url` is that of the last event that Playwright has handled."""
    return str(page.evaluate("location.pathname + location.search"))


def live(page: Page, what: str) -> object:
    return page.evaluate(f"window.truing?.live?.{what} ?? null")


_SHOWN = """({
    came_by: performance.getEntriesByType("navigation")[0]?.type,
    state: window.truing?.live?.state ?? null,
    fields: [...document.querySelectorAll("input, select")].map(one => `${one.ariaLabel ?? ""}=${one.value}`),
})"""


def page_state(page: Page) -> str:
    """The page's address, how it came up, the state that the view sent last, its fields and its text."""
    try:
        return f"{page.url}\n{page.evaluate(_SHOWN)}\n{page.inner_text('body', timeout=2000)}"
    except Exception as error:  # a page that does not answer is a finding too
        return f"the page does not answer: {error}"


def wait(condition: Callable[[], object], what: str, seconds: float = 30.0) -> None:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return
        time.sleep(0.05)
    pytest.fail(f"no {what} within {seconds:g} s")


def speed(page: Page) -> float:
    last = live(page, "samples.at(-1)")
    assert isinstance(last, list)
    return max(abs(last[1]), abs(last[2]))


def board_state(page: Page) -> object:
    return live(page, "state.board?.state")


def go(page: Page, key: str, title: str) -> None:
    page.keyboard.press(key)
    page.wait_for_function("title => document.title.startsWith(title)", arg=title)


def cycles(page: Page) -> int:
    """Number of cycles on the Trajectory page."""
    summary = page.get_by_text(re.compile(r"^\d+ cycles")).first
    return int(summary.inner_text().split()[0]) if summary.count() else 0


def drive_by_key(page: Page) -> None:
    """Hold a key until the robot moves.

    On a busy machine a page's heartbeat may be late enough for it to lose control, or the link be lost for a
    moment, after which a key has to be released, as intended; then the key is pressed again.
    """
    page.keyboard.down("ArrowUp")
    wait(lambda: live(page, "state.driver") == "you" or _press_again(page), "control", 60.0)
    wait(lambda: speed(page) > 0.25 or _press_again(page), "movement", 60.0)


def _press_again(page: Page) -> bool:
    driver = live(page, "state.driver")
    if driver == "none" or (driver == "you" and board_state(page) == "idle"):
        page.keyboard.up("ArrowUp")
        page.keyboard.down("ArrowUp")
        time.sleep(1.0)
    return False


def run_to_the_end(page: Page, start: Callable[[], object]) -> None:
    """Start a run and wait until it has been saved.

    On a busy machine the page before may hold control for a moment longer, and a page's heartbeat may be late
    enough for the board to be stopped; both are intended, and the run is started again.
    """
    wait(lambda: live(page, "state.driver") != "other", "free control")

    def begin() -> None:
        before = live(page, "state.task")
        start()
        wait(lambda: live(page, "state.task") != before, "a run that begins after its countdown")

    def is_saved() -> bool:
        stage = live(page, "state.task?.stage")
        if stage == "stopped":
            begin()
        return stage == "done"

    begin()

    wait(is_saved, "finished run", 90.0)


def start_run(page: Page, button: str) -> None:
    """Press a button that asks for a run, and start the countdown of its preview."""
    start = page.get_by_role("button", name=START)
    if not start.is_visible():
        page.get_by_role("button", name=button).click()
    start.click()


def choose_tool(page: Page, button: str, tool: str) -> None:
    """Choose what the mouse does on the floor view, and wait until the view has it."""
    page.get_by_role("button", name=button, exact=True).click()
    wait(
        lambda: page.evaluate("document.querySelector('main canvas').topView.tool") == tool,
        f"the tool {tool}",
    )


def take_control(page: Page) -> None:
    """By the key that takes and releases control."""
    wait(lambda: live(page, "state.driver") != "other", "no driver")
    if live(page, "state.driver") == "none":
        page.keyboard.press("c")
    wait(lambda: live(page, "state.driver") == "you", "control")


def release_control(page: Page) -> None:
    """If the page still has it."""
    if live(page, "state.driver") == "you":
        page.keyboard.press("c")
    wait(lambda: live(page, "state.driver") != "you", "a page without control")


def accessibility_violations(page: Page) -> list[tuple[str, list[str]]]:
    """Violations that axe rates serious or critical."""
    from axe_playwright_python.sync_playwright import Axe

    found = [v for v in Axe().run(page).response["violations"] if v["impact"] in ("serious", "critical")]
    return [(v["id"], [n["html"][:120] for n in v["nodes"]]) for v in found]
