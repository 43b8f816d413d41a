"""A page of many runs stays small enough to send: no plot library, and as many points as a screen shows."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from support import diagnoses
from support.browser import CHROMIUM, start_browser
from support.recorded_sets import recordings
from truing.diagnose.present.page import render_report
from truing.identify.identification import identify_set
from truing.recording.run import RecordingSet, Run
from truing.report.figures import PAGE_POINTS, slimmed
from truing.report.run_page import render_report as render_runs

LARGEST_BYTES = 1_500_000


def dense(count: int = 14, seconds: float = 7.0, rate_hz: float = 500.0) -> RecordingSet:
    """Runs of steps, logged fast and with noise, so that no two rows are the same."""
    rng = np.random.default_rng(1)
    t = np.arange(0.0, seconds, 1.0 / rate_hz)
    runs = []
    for number in range(count):
        effort = np.where(t < 0.5, 0.0, np.where(t < 4.0, 0.3 + 0.02 * number, -0.2))
        columns = {"t_s": t}
        for side in ("left", "right"):
            columns[f"effort_{side}"] = effort
            columns[f"vel_{side}_mps"] = 1.4 * effort + 0.01 * rng.standard_normal(len(t))
        runs.append(Run(f"{number + 1:02d}_steps", columns, order=tuple(columns)))
    return RecordingSet("dense", tuple(runs), recordings(1).baseline)


@pytest.mark.slow
def test_fourteen_runs_at_500_hz_make_pages_below_a_megabyte_and_a_half() -> None:
    runs = dense()
    assert len(render_runs(runs, identify_set(runs)).encode()) < LARGEST_BYTES
    found = diagnoses.missing_physics()
    assert len(render_report(recordings(4), found).encode()) < LARGEST_BYTES


def test_a_page_loads_nothing_and_brings_no_plot_library() -> None:
    page = render_report(recordings(4), diagnoses.missing_physics())
    assert "Plotly" not in page
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=", page)


def line(points: int, name: str) -> dict[str, object]:
    values = np.zeros(points)
    values[points // 3] = 5.0
    return {"type": "scatter", "mode": "lines", "x": list(range(points)), "y": values.tolist(), "name": name}


def test_long_lines_lose_points_and_keep_their_peaks() -> None:
    figures = {"a": {"data": [line(50_000, "long"), line(40, "short")], "layout": {}}}
    figures["b"] = {"data": [line(50_000, "long too")], "layout": {}}
    thinned = slimmed(figures, 10_000)
    counts = [len(trace["x"]) for figure in thinned.values() for trace in figure["data"]]
    assert counts[1] == 40
    assert sum(counts) < 1.1 * 10_000
    assert min(counts[0], counts[2]) > 2000
    assert all(max(trace["y"]) == 5.0 for figure in thinned.values() for trace in figure["data"])
    assert slimmed(figures, PAGE_POINTS * 10) == figures


def test_the_page_opens_in_a_browser_without_an_error(tmp_path: Path) -> None:
    """Every figure is drawn, has its axes' numbers, and can be zoomed and undone."""
    sync_api = pytest.importorskip("playwright.sync_api")
    if not CHROMIUM.exists():
        pytest.skip("no browser here")
    file = tmp_path / "page.html"
    file.write_text(render_report(recordings(4), diagnoses.missing_physics()), encoding="utf-8")
    said: list[str] = []
    with sync_api.sync_playwright() as playwright:
        browser = start_browser(playwright)
        page = browser.new_page(viewport={"width": 1100, "height": 9000})
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(file.as_uri())
        page.wait_for_function("[...document.querySelectorAll('.plot')].every((p) => p.querySelector('svg'))")
        assert page.locator(".plot").count() > 5
        assert page.locator(".plot svg .traces path").count() > 10
        assert page.locator(".plot svg .traces rect").count() > 10
        assert "NaN" not in page.locator("main").inner_html()
        first = page.locator("#run-1")
        before = first.locator(".traces path").first.get_attribute("d")
        box = first.locator("svg").bounding_box()
        page.mouse.move(box["x"] + 300, box["y"] + 100)
        assert "measured" in first.locator(".readout").inner_text()
        page.mouse.down()
        page.mouse.move(box["x"] + 500, box["y"] + 100)
        page.mouse.up()
        assert first.locator(".traces path").first.get_attribute("d") != before
        page.mouse.dblclick(box["x"] + 400, box["y"] + 100)
        assert first.locator(".traces path").first.get_attribute("d") == before
        browser.close()
    assert not said
