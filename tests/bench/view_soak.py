"""The view for ten minutes with all that it does: how its memory grows, helper processes included.

Three pages are open in Chromium: one drives run after run, recorded at 200 Hz; one turns to every page, takes
dropped recordings and compares them; one looks on. A set is diagnosed again and again. Memory is the resident
set of the view's process and of every process that it has started, between two rounds, when no diagnosis
runs and no file is being read. The table of it lies in out/bench/view_soak.csv.
"""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from bench.figure import Figure
from support.browser import start_browser
from web.browser_rig import go, live, take_control, wait
from web.process_memory import helpers_mb, resident_mb
from web.soak import RATE_HZ, drive_runs, heap_mb, soaked_set
from web.synthetic_runs import synthetic_set
from web.view_process import ViewProcess

if TYPE_CHECKING:
    from playwright.sync_api import Page

# A shorter one shows whether it works: TRUING_SOAK_MINUTES=1 ./run bench view_soak
_MINUTES = float(os.environ.get("TRUING_SOAK_MINUTES", "10"))
# Before the first measurement: modules are imported and rollouts compiled, once.
_WARM_ROUNDS = 3
_BAR_MB = 20.0
_DIAGNOSED_S, _DIAGNOSED_SHARE = 20.0, 0.02
_PAGES = (
    ("1", "Live"),
    ("2", "World"),
    ("3", "Trajectory"),
    ("5", "Error models"),
    ("6", "Analysis"),
    ("7", "3-D"),
    ("8", "Experiments"),
    ("9", "Parameters"),
    ("4", "Compare"),
)


def measure(root: Path) -> list[Figure]:
    """Go on in rounds for ten minutes after the warm-up."""
    with tempfile.TemporaryDirectory() as folder:
        rows = _soak(Path(folder), 60.0 * _MINUTES)
    kept = root / "out/bench/view_soak.csv"
    kept.parent.mkdir(parents=True, exist_ok=True)
    lines = [",".join(f"{value:.1f}" for value in row) for row in rows]
    kept.write_text("\n".join(["t_s,view_mb,helpers_mb,pages_mb", *lines]) + "\n")
    all_of_it = [view + helpers for _, view, helpers, _ in rows]
    pages = [heaps for *_, heaps in rows]
    what = f"{rows[-1][0] / 60.0:.0f} minutes of the view, {len(rows)} rounds"
    return [
        Figure(f"{what}: growth of view and helpers", _growth(all_of_it), "MB", "less", _BAR_MB),
        Figure(f"{what}: growth of the pages' heaps", _growth(pages), "MB", "less", _BAR_MB),
    ]


def _growth(values: list[float]) -> float:
    """From the first rounds to the last ones: one round alone holds what has just not been freed yet."""
    share = max(1, len(values) // 5)
    return median(values[-share:]) - median(values[:share])


def _soak(folder: Path, seconds: float) -> list[tuple[float, float, float, float]]:
    """Time (s) and memory (MB) of the view, its helpers and its pages after every round."""
    from playwright.sync_api import sync_playwright

    soaked_set(folder)
    made = synthetic_set(folder / "made")
    view = ViewProcess(folder, "--rate", str(RATE_HZ))
    pid = view.process.pid
    rows: list[tuple[float, float, float, float]] = []
    try:
        with sync_playwright() as playwright:
            browser = start_browser(playwright)
            watcher, looker, driver = (browser.new_page() for _ in range(3))
            watcher.goto(view.address)
            looker.goto(view.address + "compare")
            driver.goto(view.address + "analysis?set=recordings/soak&run=01_straight")
            driver.wait_for_function("truing?.live?.state.link?.state === 'connected'", timeout=60_000)
            driver.wait_for_function("document.querySelectorAll('.plot .key').length > 1", timeout=60_000)
            began, rounds = 0.0, 0
            while rounds < _WARM_ROUNDS or time.monotonic() < began + seconds:
                rounds += 1
                _look_round(looker, made)
                driver.bring_to_front()
                _drive(driver)
                _diagnose(driver)
                if rounds < _WARM_ROUNDS:
                    continue
                began = began or time.monotonic()
                heaps = sum(heap_mb(page) for page in (watcher, looker, driver))
                rows.append((time.monotonic() - began, resident_mb(pid), helpers_mb(pid), heaps))
            browser.close()
    finally:
        view.close()
    return rows


def _drive(page: Page) -> None:
    """A run; where the machine was too busy for the board's heartbeat, its fault is cleared instead."""
    try:
        drive_runs(page, 0.0, 1)
    except RuntimeError as error:
        if "host_silent" not in str(error):
            raise
        page.evaluate("document.activeElement?.blur()")
        take_control(page)
        page.get_by_role("button", name="Clear faults").click()
        wait(lambda: live(page, "state.board?.faults?.length") == 0, "cleared faults")


def _look_round(page: Page, made: Path) -> None:
    """Every page once; a recording is dropped, compared under an error model, and looked at."""
    page.bring_to_front()
    for key, title in _PAGES:
        page.evaluate("document.activeElement?.blur()")
        go(page, key, title)
        wait(lambda: page.locator("main canvas, main table").count(), "the page's picture")
    page.locator(".drop-zone input").set_input_files([made / "baseline.toml", made / "runs/03_straight.csv"])
    run = page.get_by_label("Run", exact=True)
    wait(lambda: "dropped/" in page.evaluate("location.search") and run.count(), "the dropped set", 60.0)
    page.get_by_role("button", name="MOM paper", exact=True).click()
    drawn = "document.querySelector('main canvas').topView.paths.some(p => p.title === 'Simulated (model)')"
    wait(lambda: page.evaluate(drawn), "its simulation", 60.0)
    page.get_by_role("button", name="None", exact=True).click()
    wait(lambda: not page.evaluate(drawn), "no error model", 60.0)


def _diagnose(page: Page) -> None:
    """Begin a diagnosis of the set, and cancel it once it computes, or after a while on a busy machine."""
    page.get_by_role("button", name="Diagnose this set").click()
    page.get_by_text("diagnosing", exact=False).wait_for()
    until = time.monotonic() + _DIAGNOSED_S
    while page.locator("progress").is_visible() and time.monotonic() < until:
        if page.evaluate("document.querySelector('progress').value") > _DIAGNOSED_SHARE:
            break
        time.sleep(0.2)
    cancel = page.get_by_role("button", name="Cancel the diagnosis")
    if cancel.is_visible():
        cancel.click()
    wait(lambda: not page.locator("progress").is_visible(), "an end of the diagnosis")
    wait(lambda: live(page, "state.driver") != "other", "free control")
