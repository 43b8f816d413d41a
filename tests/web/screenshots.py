"""A picture of every page at both widths, the robot driving: for people to look at."""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from playwright.sync_api import sync_playwright

from web.view_process import ViewProcess

SIZES = {"wide": (1280, 720), "narrow": (390, 844)}


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    view = ViewProcess(folder / "out")
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
            for size, (width, height) in SIZES.items():
                for name in ("live", "world", "trajectory"):
                    page = browser.new_page(viewport={"width": width, "height": height})
                    page.goto(view.address + ("" if name == "live" else name))
                    page.wait_for_function("window.truing?.live?.samples?.length > 0")
                    time.sleep(0.5)
                    page.keyboard.down("ArrowUp")
                    time.sleep(1.0)
                    page.keyboard.down("ArrowLeft")
                    time.sleep(1.6)
                    page.screenshot(path=folder / f"{name}-{size}.png")
                    page.close()
            browser.close()
    finally:
        view.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
