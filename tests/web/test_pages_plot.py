"""One plot on every page: zoom, pan, cursor, playback, legend, files; the live one pauses and goes back."""

from __future__ import annotations

import pytest

from web.browser_rig import (
    address,
    choose_tool,
    drive_by_key,
    go,
    live,
    open_page,
    run_to_the_end,
    speed,
    start_run,
    wait,
)
from web.synthetic_runs import synthetic_set

pytestmark = [pytest.mark.xdist_group("browser"), pytest.mark.slow]

PLOT = "document.querySelector('.plot canvas')?.plot"
TOP = "document.querySelector('main canvas').topView"


@pytest.fixture(scope="module", autouse=True)
def runs(rig):
    return synthetic_set(rig.view.out / "made")


def window(page):
    return page.evaluate(f"{PLOT}?.window()")


def span(page):
    low, high = window(page)
    return high - low


def readout(page):
    return page.locator(".plot-readout").first.inner_text()


@pytest.fixture
def compared(page):
    """Compare with a run of six seconds, and where its plot is."""
    page.goto(page.url + "compare?set=made&run=02_straight")
    wait(lambda: (page.evaluate(f"{PLOT}?.panels().length") or 0) == 3, "three panels", 60.0)
    return page.locator(".plot canvas").bounding_box()


def test_wheel_drag_and_keys_move_the_window_of_all_panels(page, compared):
    box = compared
    assert window(page) == [0, 6]
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(*middle)
    page.mouse.wheel(0, -500)
    wait(lambda: span(page) < 4.0, "a zoomed plot")
    low, high = window(page)
    page.mouse.down()
    page.mouse.move(middle[0] - 200, middle[1], steps=4)
    page.mouse.up()
    wait(lambda: window(page)[0] > low + 0.3, "a moved window")
    assert span(page) == pytest.approx(high - low)
    wait(lambda: "t=" in address(page), "the window in the address")
    page.reload()
    wait(
        lambda: window(page) and abs(window(page)[0] - low) > 0.3 and span(page) < 4.0,
        "the same window",
        60.0,
    )
    page.locator(".plot canvas").focus()
    page.keyboard.press("f")
    wait(lambda: window(page) == [0, 6], "all of the run")
    page.keyboard.press(".")
    wait(lambda: span(page) == pytest.approx(4.8), "a zoom by key")


def test_the_cursor_tells_values_of_all_panels_and_stands_on_the_map(page, compared):
    box = compared
    page.mouse.move(box["x"] + 0.8 * box["width"], box["y"] + 20)
    wait(lambda: "Real robot 0.44" in readout(page), "the steady speed")
    assert readout(page).count("Real robot") == 2
    assert "left residual" in readout(page)
    at = page.evaluate("truingCursor.t")
    assert 4.0 < at < 5.5
    # The map draws the robot on every path that has this time.
    assert page.evaluate(f"{TOP}.paths.every(path => path.t.length === path.points.length)")
    page.locator(".plot canvas").focus()
    page.keyboard.press("i")
    wait(lambda: page.evaluate("truingCursor.t") > at, "a cursor moved by key")
    page.mouse.move(box["x"] + 50, box["y"] - 100)
    page.get_by_role("button", name="Play", exact=True).click()
    wait(lambda: 0.5 < (page.evaluate("truingCursor.t") or 0) < 6.0, "a cursor that plays")
    page.get_by_role("button", name="Stop playing").click()


def test_curves_are_hidden_by_their_name_and_saved_as_picture_and_table(page, compared):
    name = page.locator(".plot").get_by_role("button", name="Simulated", exact=True)
    name.click()
    wait(lambda: name.get_attribute("aria-pressed") == "false", "a hidden curve")
    assert page.evaluate(f"[...{PLOT}.hidden]") == ["Simulated"]
    with page.expect_download() as download:
        page.get_by_role("button", name="Save the figure as PNG").click()
    assert download.value.suggested_filename == "made_02_straight_speeds_and_residuals.png"
    assert download.value.path().read_bytes().startswith(b"\x89PNG")
    with page.expect_download() as download:
        page.get_by_role("button", name="Save the curves as CSV").click()
    head, *rows = download.value.path().read_text().splitlines()
    assert head.startswith('t_s,"left, Simulated (m/s)"')
    assert len(rows) == 121


def test_the_live_plot_is_paused_scrolled_back_and_goes_on(page):
    drive_by_key(page)
    page.keyboard.up("ArrowUp")
    wait(lambda: speed(page) < 0.02, "standstill")
    page.get_by_role("button", name="Pause", exact=True).click()
    low, high = window(page)
    count = live(page, "received")
    wait(lambda: live(page, "received") > count + 20, "samples that go on")
    assert window(page) == [low, high]
    page.locator(".plot canvas").focus()
    page.keyboard.press("j")
    wait(lambda: window(page)[0] < low, "an earlier window")
    box = page.locator(".plot canvas").bounding_box()
    page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 20)
    wait(lambda: "left commanded" in readout(page), "the values of then")
    with page.expect_download() as download:
        page.get_by_role("button", name="Save the curves as CSV").click()
    assert len(download.value.path().read_text().splitlines()) > 20
    page.get_by_role("button", name="Go on", exact=True).click()
    wait(lambda: window(page)[1] > high, "the present")


def test_trajectory_shows_the_robot_on_its_way_beside_the_desired_path(browser, rig, problems):
    page = open_page(browser, rig, problems, every_picture=True)  # the way is followed picture by picture
    go(page, "3", "Trajectory")
    choose_tool(page, "Lines", "line")
    box = page.locator("main canvas").first.bounding_box()
    page.locator("main canvas").first.click(position={"x": box["width"] / 2 + 60, "y": box["height"] / 2})
    page.get_by_text("ends at", exact=False).first.wait_for()
    run_to_the_end(page, lambda: start_run(page, "Upload and run"))
    desired = page.evaluate(f"{TOP}.paths.map(path => path.points)")[0]
    driven = page.evaluate(f"{TOP}.drivenPath")
    assert len(driven) > 5
    assert desired[0][:2] == pytest.approx(driven[0][:2], abs=0.05)
    assert desired[-1][:2] == pytest.approx(driven[-1][:2], abs=0.1)
    page.close()
    assert not problems
