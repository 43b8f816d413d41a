"""What the browser tests share: a board, a cable to pull, the view on it, pages, and looking at them."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page

from support.served_board import ServedBoard
from web.view_process import CutLink, ViewProcess


class Bench:
    """A board, a cable to pull, and the view on it."""

    def __init__(self, folder: Path) -> None:
        self.board = ServedBoard(folder)
        self.link = CutLink(self.board.tcp)
        self.view = ViewProcess(folder / "out", port=self.link.port)

    def close(self) -> None:
        self.view.close()
        self.link.close()
        self.board.kill()


class Problems(list[str]):
    """What a page complained of, and every address beyond the view that it asked for."""


def open_page(
    browser: Browser, bench: Bench, problems: Problems, path: str = "", width: int = 1280, height: int = 720
) -> Page:
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(30_000)
    page.on("pageerror", lambda error: problems.append(str(error)))

    def asked(request: object) -> None:
        url = str(getattr(request, "url", ""))
        if not url.startswith((bench.view.address, "data:", "blob:")):
            problems.append(f"asked for {url}")

    page.on("request", asked)
    page.goto(bench.view.address + path)
    wait(lambda: live(page, "state.link?.state") == "connected", "a connected board")
    wait(lambda: live(page, "samples.length") > 0, "samples")
    return page


def live(page: Page, what: str) -> object:
    return page.evaluate(f"window.truing?.live?.{what} ?? null")


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
    """How many cycles the Trajectory page has painted."""
    told = page.get_by_text(re.compile(r"^\d+ cycles")).first
    return int(told.inner_text().split()[0]) if told.count() else 0


def drive_by_key(page: Page) -> None:
    """Hold a key until the robot moves.

    On a machine that is busy elsewhere a page may be silent for so long that it loses the wheel, as it
    should; then the key is pressed anew.
    """
    page.keyboard.down("ArrowUp")
    wait(lambda: live(page, "state.driver") == "you" or _press_anew(page), "the wheel", 60.0)
    wait(lambda: speed(page) > 0.25 or _press_anew(page), "movement", 60.0)


def _press_anew(page: Page) -> bool:
    if live(page, "state.driver") == "nobody":
        page.keyboard.up("ArrowUp")
        page.keyboard.down("ArrowUp")
        time.sleep(0.3)
    return False


def take_the_wheel(page: Page) -> None:
    """By the key that takes and leaves it."""
    wait(lambda: live(page, "state.driver") != "another", "a free wheel")
    if live(page, "state.driver") == "nobody":
        page.keyboard.press("c")
    wait(lambda: live(page, "state.driver") == "you", "the wheel")


def leave_the_wheel(page: Page) -> None:
    """If it still has it."""
    if live(page, "state.driver") == "you":
        page.keyboard.press("c")
    wait(lambda: live(page, "state.driver") != "you", "a page without the wheel")


def faults_of_access(page: Page) -> list[tuple[str, list[str]]]:
    """What axe calls serious or critical."""
    found = [v for v in Axe().run(page).response["violations"] if v["impact"] in ("serious", "critical")]
    return [(v["id"], [n["html"][:120] for n in v["nodes"]]) for v in found]
