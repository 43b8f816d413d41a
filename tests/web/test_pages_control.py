"""Before anything moves, and who may move it: faults on every page, previews, countdowns, watching pages."""

from __future__ import annotations

import time

import pytest

from web.browser_rig import (
    START,
    accessibility_violations,
    board_state,
    choose_tool,
    drive_by_key,
    go,
    live,
    open_page,
    release_control,
    speed,
    take_control,
    wait,
)

pytestmark = [pytest.mark.xdist_group("browser"), pytest.mark.slow]

PAGES = ("Live", "World", "Trajectory", "Compare", "Error models", "Analysis", "3-D")


def test_a_latched_fault_is_a_banner_on_every_page_until_it_is_cleared(page, rig):
    drive_by_key(page)
    rig.link.pull()
    wait(lambda: live(page, "state.link?.state") == "lost", "a lost link")
    page.keyboard.up("ArrowUp")
    time.sleep(1.5)  # more than the board's own time-out: it stops by itself and latches why
    rig.link.plug()
    banner = page.locator(".fault-banner")
    banner.wait_for()
    for number, title in enumerate(PAGES, 1):
        go(page, str(number), title)
        assert banner.is_visible()
        text = banner.inner_text()
        assert "host_silent (latched)" in text
        assert "Next: " in text
        assert len(text.split("Next: ")[0]) > 30  # its cause
        assert page.evaluate("document.documentElement.scrollHeight") <= 721  # the page fits below it
    assert not accessibility_violations(page)
    # A link that is lost again takes nothing back.
    rig.link.pull()
    wait(lambda: live(page, "state.link?.state") == "lost", "a lost link")
    assert banner.is_visible()
    rig.link.plug()
    wait(lambda: live(page, "state.link?.state") == "connected", "a connected board")
    release_control(page)
    page.get_by_role("button", name="Clear faults").click()
    page.get_by_role("dialog").get_by_text("Only the page in control can clear the faults").wait_for()
    assert banner.is_visible()
    page.get_by_role("button", name="Take control").last.click()
    wait(lambda: not banner.is_visible(), "a cleared fault")
    assert live(page, "state.driver") == "you"


def drawn_path(page):
    """Upload and run of a straight line of 1.5 m: up to its preview."""
    go(page, "3", "Trajectory")
    choose_tool(page, "Lines", "line")
    canvas = page.locator("main canvas").first
    box = canvas.bounding_box()
    canvas.click(position={"x": box["width"] / 2 + 150, "y": box["height"] / 2})
    page.get_by_text("ends at", exact=False).first.wait_for()
    page.get_by_role("button", name="Upload and run").click()
    page.get_by_role("button", name=START).wait_for()


def countdown(page):
    return page.locator(".countdown p").inner_text()


def test_before_a_run_its_path_room_and_speed_are_shown_and_any_key_stops_the_countdown(page):
    drawn_path(page)
    box = page.get_by_role("dialog", name="Before the robot moves")
    facts = dict(zip(box.locator("dt").all_inner_texts(), box.locator("dd").all_inner_texts(), strict=True))
    assert facts["distance"].startswith("1.5") or facts["distance"].startswith("1.4")
    assert float(facts["room ahead"].split()[0]) >= 1.5
    assert facts["top speed"].endswith(" m/s")
    shown = page.evaluate("document.querySelector('.preview-map canvas').topView.paths[0].points")
    pose = live(page, "corrected")
    assert shown[0] == pytest.approx(pose, abs=0.01)
    assert ((shown[-1][0] - pose[0]) ** 2 + (shown[-1][1] - pose[1]) ** 2) ** 0.5 == pytest.approx(
        1.5, abs=0.05
    )
    assert not accessibility_violations(page)
    start = page.get_by_role("button", name=START)
    for stop in (
        lambda: page.keyboard.press("x"),
        lambda: page.keyboard.press("Space"),
        lambda: page.mouse.click(5, 5),
    ):
        if not start.is_visible():  # a press beside the dialog closes it as well
            page.get_by_role("button", name="Upload and run").click()
        start.click()
        wait(lambda: "any key stops" in countdown(page), "a countdown")
        stop()
        wait(
            lambda: not start.is_visible() or countdown(page) == "stopped: nothing has moved", "a stopped one"
        )
    page.wait_for_timeout(3500)
    assert board_state(page) != "sequence"
    assert live(page, "state.task") is None or live(page, "state.task.stage") != "driving"
    if not start.is_visible():
        page.get_by_role("button", name="Upload and run").click()
    start.click()
    wait(lambda: board_state(page) == "sequence", "a run that begins after the countdown")
    page.keyboard.press("Space")
    wait(lambda: speed(page) < 0.02, "standstill")


def test_a_stop_on_another_page_ends_the_countdown(page, browser, rig, problems):
    other = open_page(browser, rig, problems)
    try:
        drawn_path(page)
        page.get_by_role("button", name=START).click()
        wait(lambda: "any key stops" in countdown(page), "a countdown")
        # Without the pointer, which waits for frames that a page in the background draws too rarely.
        other.get_by_role("button", name="STOP").dispatch_event("click")
        # A page that is too busy to learn of it in time finds its start refused, and closes the dialog.
        text = page.locator(".countdown p")
        wait(lambda: text.all_inner_texts() in ([], ["stopped: nothing has moved"]), "a stopped countdown")
        page.wait_for_timeout(3500)
        assert board_state(page) != "sequence"
    finally:
        other.close()


def test_a_watching_page_looks_and_stops_and_changes_nothing(page, browser, rig, problems):
    take_control(page)
    other = open_page(browser, rig, problems, "world")
    try:
        wait(lambda: live(other, "state.driver") == "other", "a watching page")
        refusal = other.get_by_text("another page drives: it has to release control", exact=False)
        before = other.evaluate("[truing.live.corrected, truing.live.state.world]")
        laser = other.get_by_role("button", name="Laser", exact=True)
        assert laser.get_attribute("aria-pressed") == "true"
        laser.click()
        refusal.first.wait_for()
        wait(lambda: laser.get_attribute("aria-pressed") == "true", "the setting in force")
        canvas = other.locator("main canvas").first
        for tool in ("Place robot", "Paint"):
            other.get_by_role("button", name=tool, exact=True).click()
            canvas.click(position={"x": 200, "y": 200})
        other.get_by_role("button", name="Clear", exact=True).click()
        go(other, "1", "Live")
        other.get_by_role("button", name="Disconnect", exact=True).click()
        other.wait_for_timeout(1000)
        assert live(other, "state.link?.state") == "connected"
        assert other.evaluate("[truing.live.corrected, truing.live.state.world]") == before
        assert live(other, "state.scan.laser.length") > 0
        drive_by_key(page)
        other.keyboard.press("Space")
        wait(lambda: speed(page) < 0.02, "standstill")
        page.keyboard.up("ArrowUp")
    finally:
        other.close()
