"""A picture of every page at both widths, with runs to look at and the robot driving: for review.

With `--readme` the two pictures of the README as well, in few colours.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from support.browser import start_browser
from truing.web.views.mismatch_map import mismatch_map
from web.browser_rig import MARK_FIRST_PICTURE
from web.synthetic_runs import time_cells, write_diagnosis
from web.view_process import ViewProcess

SIZES = {"wide": (1280, 720), "narrow": (390, 844)}
# Velocities: the desired path is known; the virtual robot's odometry tells the real one.
TITLE = 'title = "A square with round corners"'
REST = """
[[segment]]
duration_s = 1.0
twist = { v_mps = 0.0, omega_radps = 0.0 }
"""
SIDE = """
[[segment]]
duration_s = 2.5
twist = { v_mps = 0.4, omega_radps = 0.0 }
[[segment]]
duration_s = 1.5
twist = { v_mps = 0.3, omega_radps = 1.0471975512 }
"""


PICTURES = Path(__file__).resolve().parents[2] / "host/truing/web/pictures"


def main(folder: Path, *, readme: bool = False) -> None:
    """Make the pictures in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    out = folder / "out"
    _runs(out)
    view = ViewProcess(out)
    try:
        with sync_playwright() as playwright:
            browser = start_browser(playwright)
            for size, (width, height) in SIZES.items():
                for name, prepare in PAGES.items():
                    page = browser.new_page(viewport={"width": width, "height": height})
                    page.add_init_script(MARK_FIRST_PICTURE)
                    page.goto(view.address + ("" if name == "live" else name))
                    page.wait_for_function("window.truing?.live?.samples?.length > 0")
                    time.sleep(1.0)
                    print(f"{name}, {size}: first picture after {page.evaluate('window.firstMs'):.0f} ms")
                    prepare(page)
                    page.screenshot(path=folder / f"{name.partition('=')[2] or name}-{size}.png")
                    page.close()
            browser.close()
    finally:
        view.close()
    if readme:
        for name in ("live", "compare"):
            with Image.open(folder / f"{name}-wide.png") as picture:
                picture.convert("RGB").quantize(128).save(PICTURES / f"{name}.png", optimize=True)


def _runs(out: Path) -> None:
    """Drive a plan on a virtual board, and add a diagnosis of it."""
    from truing.plan import load_plan
    from truing.virtual.options import VirtualOptions
    from truing.web.session import ViewOptions, ViewSession
    from truing.web.worker.state import RunRequest

    if (out / "recordings/square/runs").is_dir():
        return
    out.mkdir(parents=True, exist_ok=True)
    (out / "square.toml").write_text(TITLE + REST + 4 * SIDE + REST)
    session = ViewSession(ViewOptions("sim", VirtualOptions(), out / "recordings/square"))
    session.world.clear()  # the paper's tests need more room than the default world has
    session.start()
    try:
        _until(lambda: session.worker.snapshot.link == "connected")
        for file in (out / "square.toml", "paper/XI", "paper/XVII"):
            session.worker.run_plan(
                RunRequest(load_plan(str(file)), session.run_folder, Path(str(file)).stem, seed=1)
            )
            _until(lambda: session.worker.snapshot.task is not None and session.worker.snapshot.task.is_over)
            task = session.worker.snapshot.task
            if task is None or task.stage != "done":
                raise SystemExit(f"{file}: {task}")
    finally:
        session.close()
    names = ("01_square", "02_XI", "03_XVII")
    cells = [replace(time_cells(wheel), runs=names) for wheel in ("left", "right")]
    stretches = [{"run": "03_XVII", "span": [1.0, 1.5], "text": "03_XVII, 1.0 to 1.5 s: right wheel"}]
    write_diagnosis(out, "recordings-square", map=mismatch_map(cells), stretches=stretches)


def _until(condition: Callable[[], bool], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError("the virtual board does not finish")
        time.sleep(0.1)


def _drive(page: Page) -> None:
    page.keyboard.down("ArrowUp")
    time.sleep(2.0)
    page.keyboard.down("ArrowLeft")
    time.sleep(2.2)


def _square(page: Page) -> None:
    page.get_by_label("Set", exact=True).select_option(label="recordings/square")
    page.get_by_label("Run", exact=True).select_option(label="01_square")
    time.sleep(1.0)
    # The first simulation with effects compiles them.
    page.get_by_text("simulating").wait_for(state="hidden", timeout=120_000)
    time.sleep(1.0)
    page.evaluate("scrollTo(0, 0)")


def _compare(page: Page) -> None:
    page.get_by_role("button", name="MOM paper", exact=True).click()
    _square(page)
    box = page.locator(".plot canvas").bounding_box()
    if box is not None:  # the cursor, and the robot on every path
        page.mouse.move(box["x"] + 0.45 * box["width"], box["y"] + 0.4 * box["height"])
    time.sleep(0.5)


def _models(page: Page) -> None:
    page.get_by_role("button", name="Diagnosed", exact=True).click()
    page.get_by_label("Diagnosis", exact=True).select_option(label="recordings-square")
    _square(page)


def _analysis(page: Page) -> None:
    page.get_by_label("Set", exact=True).select_option(label="recordings/square")
    page.get_by_label("Run", exact=True).select_option(label="03_XVII")
    page.get_by_label("from, s").fill("7.5")
    page.get_by_label("to, s").fill("9")
    time.sleep(4.0)


def _mismatch(page: Page) -> None:
    page.get_by_label("Set", exact=True).select_option(label="recordings/square")
    page.get_by_role("button", name="Mismatch", exact=True).click()
    page.wait_for_function("document.querySelector('.plot canvas').plot.figure.panels[0]?.map")
    canvas = page.locator(".plot canvas")
    canvas.focus()
    for key in ("ArrowDown", "ArrowDown", "i"):
        page.keyboard.press(key)
    time.sleep(0.5)


def _experiments(page: Page) -> None:
    page.get_by_label("Kind", exact=True).select_option(value="diagnosis")
    page.get_by_label("Plan", exact=True).select_option(value="diagnosis/reversals")
    shown = "document.querySelector('.plot canvas').plot.figure.revision"
    page.wait_for_function(f"{shown} === 'diagnosis/reversals'")
    time.sleep(1.0)


PAGES: dict[str, Callable[[Page], None]] = {
    "live": _drive,
    "world": _drive,
    "trajectory": _drive,
    "compare": _compare,
    "models": _models,
    "analysis": _analysis,
    "analysis?view=mismatch": _mismatch,
    "scene": _drive,
    "experiments": _experiments,
    "parameters": lambda page: page.get_by_label("wheelbase_m", exact=True).wait_for(),
}


if __name__ == "__main__":
    main(Path(sys.argv[1]), readme="--readme" in sys.argv)
