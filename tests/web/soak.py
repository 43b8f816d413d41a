"""The view for minutes at 200 Hz: does it grow, and does it lose a log sample?

    .venv/bin/python tests/web/soak.py --minutes 10

Two pages look on while runs logged at 200 Hz are driven, fetched and saved one after the other. Memory, after
a warm-up and at the end, is the resident set of the view's process, that of its helpers (the virtual board,
the simulation of runs), and the JavaScript heap of either page after a collection.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

from support.browser import start_browser
from truing.recording.reader import read_run
from web.browser_rig import START
from web.process_memory import helpers_mb, resident_mb
from web.synthetic_runs import synthetic_set, write_diagnosis
from web.view_process import ViewProcess

if TYPE_CHECKING:
    from playwright.sync_api import Page

MAX_GROWTH_MB = 10.0
RATE_HZ = 200
_RUN_S = 6.0
# Beyond the time that was asked for, on a machine that has others to serve.
_SPARE_S = 300.0
_BEGAN = "['waiting', 'uploading', 'driving', 'fetching'].includes(truing.live.state.task?.stage)"
_OVER = "['done', 'failed', 'stopped'].includes(truing.live.state.task?.stage)"
_PLAN = f"""title = "Turning on the spot"
log_rate_hz = {RATE_HZ}
[[segment]]
duration_s = {_RUN_S - 2.0}
velocity_mps = [0.2, -0.2]
[[segment]]
duration_s = 2.0
velocity_mps = [0.0, 0.0]
"""


@dataclass(frozen=True)
class SoakResult:
    """Measured figures.

    Attributes
    ----------
    live_hz : samples that reached the page in a second of the board's own time, after the warm-up: a virtual
        board on a busy machine falls behind, and a wall clock would tell of the machine.
    growth_mb : of the view's process.
    helpers_growth_mb : of the processes that it started.
    page_growth_mb, driver_growth_mb : of the heap of the page that looks on, and of the one that drives.
    dropped : log records that are missing in the runs.
    stops : runs that were stopped because the page was silent.
    """

    seconds: float
    live_hz: float
    growth_mb: float
    helpers_growth_mb: float
    page_growth_mb: float
    driver_growth_mb: float
    runs: int
    records: int
    dropped: int
    stops: int

    @property
    def max_growth_mb(self) -> float:
        """The largest growth of any part."""
        return max(self.growth_mb, self.helpers_growth_mb, self.page_growth_mb, self.driver_growth_mb)


def soaked_set(folder: Path) -> Path:
    """A set whose diagnosis proposes the run that is driven again and again."""
    made = synthetic_set(folder / "recordings/soak")
    diagnoses = write_diagnosis(folder, "recordings-soak", has_next=True)
    (diagnoses / "recordings-soak.next.toml").write_text(_PLAN)
    return made


def soak(folder: Path, seconds: float, warm_s: float, min_runs: int = 1) -> SoakResult:
    """Look on for so long after the warm-up, and until so many runs have been saved."""
    from playwright.sync_api import sync_playwright

    soaked_set(folder)
    view = ViewProcess(folder, "--rate", str(RATE_HZ))
    pid = view.process.pid
    try:
        with sync_playwright() as playwright:
            browser = start_browser(playwright)
            watcher, driver = browser.new_page(), browser.new_page()
            watcher.goto(view.address)
            driver.goto(view.address + "analysis")
            driver.bring_to_front()
            driver.wait_for_function("truing?.live?.state.link?.state === 'connected'", timeout=60_000)
            driver.get_by_label("Set", exact=True).select_option(label="recordings/soak")
            # The first drawing is slow, and a driving page whose heartbeat is late loses control.
            driver.wait_for_function("document.querySelectorAll('.plot .key').length > 1", timeout=60_000)
            drive_runs(driver, warm_s, 1)
            before = [resident_mb(pid), helpers_mb(pid), heap_mb(watcher), heap_mb(driver)]
            (count, board_s), began = _samples(watcher), time.monotonic()
            stops = drive_runs(driver, seconds, min_runs)
            spent = time.monotonic() - began
            counted, until_s = _samples(watcher)
            rate = (counted - count) / (until_s - board_s)
            after = [resident_mb(pid), helpers_mb(pid), heap_mb(watcher), heap_mb(driver)]
            browser.close()
    finally:
        view.close()
    grown = (b - a for a, b in zip(before, after, strict=True))
    return SoakResult(spent, rate, *grown, *_missing(folder / "recordings/soak/runs"), stops)


def drive_runs(page: Page, seconds: float, min_runs: int) -> int:
    """Run after run, until the time is over and so many are saved; how many were stopped.

    On a busy machine a page without heartbeat for 2.5 s loses control, as intended, and the next run starts.
    """
    saved = stops = 0
    began = time.monotonic()
    while time.monotonic() < began + seconds or saved < min_runs:
        if time.monotonic() > began + seconds + _SPARE_S:
            raise RuntimeError(f"{saved} runs saved and {stops} stopped in {time.monotonic() - began:.0f} s")
        known = page.evaluate("truing.live.state.task?.saved ?? ''")
        page.get_by_role("button", name="Run the next experiment").click()
        page.get_by_role("button", name=START).click()
        # Told by the page itself, so that no change between two looks is missed.
        page.wait_for_function(_BEGAN, timeout=60_000)
        page.wait_for_function(_OVER, timeout=120_000)
        task = page.evaluate("truing.live.state.task")
        if task["stage"] == "done" and task["saved"] != known:
            saved += 1
        elif task["stage"] == "stopped" and "timed out" in task["problem"]:
            stops += 1
        else:
            raise RuntimeError(f"the run ended badly: {task}")
    return stops


def _missing(folder: Path) -> tuple[int, int, int]:
    """Runs, their records, and the records that are not there."""
    runs = records = dropped = 0
    for path in sorted(folder.glob("*_next.csv")):
        t = read_run(path).t_s
        steps = np.rint(np.diff(t) * RATE_HZ).astype(int)
        expected = round(_RUN_S * RATE_HZ)
        runs += 1
        records += len(t)
        dropped += int(np.maximum(steps - 1, 0).sum()) + max(0, expected - 1 - int(steps.sum()))
    return runs, records, dropped


def heap_mb(page: Page) -> float:
    session = page.context.new_cdp_session(page)
    session.send("HeapProfiler.collectGarbage")
    used = session.send("Runtime.getHeapUsage")["usedSize"]
    session.detach()
    return float(used) / 1e6


def _samples(page: Page) -> tuple[int, float]:
    """How many have come, and the board's time of the last (s)."""
    count, board_s = page.evaluate("[truing.live.received, truing.live.samples.at(-1)[0]]")
    return int(count), float(board_s)


def main() -> int:
    """Soak as long as asked, print the figures, fail beyond the limits."""
    parser = argparse.ArgumentParser(description="Soak the view at 200 Hz.")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--warm", type=float, default=60.0, help="seconds before the first measurement")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = soak(Path(folder), 60.0 * arguments.minutes, arguments.warm)
    print(json.dumps(asdict(found), indent=2))
    return int(found.dropped > 0 or found.max_growth_mb > MAX_GROWTH_MB)


if __name__ == "__main__":
    sys.exit(main())
