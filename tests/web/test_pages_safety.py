"""Stopping in the browser: acknowledged, an alarm when not delivered, latched; old values are grey."""

from __future__ import annotations

import os
import signal

import pytest

from web.browser_rig import drive_by_key, go, live, speed, wait

pytestmark = [pytest.mark.xdist_group("browser"), pytest.mark.slow]

# Milliseconds from a stop to the alarm, measured in the page itself.
_MEASURE_ALARM = """() => { const begun = performance.now(), alert = document.querySelector('.stop-alert');
    window.alarmMs = null;
    const look = () => { if (alert.checkVisibility()) window.alarmMs = performance.now() - begun;
        else setTimeout(look, 5); };
    window.truing.live.stop(); look(); }"""


@pytest.fixture
def frozen(rig):
    """Calls that freeze the view's process and let it run again."""
    pid = rig.view.process.pid
    yield lambda: os.kill(pid, signal.SIGSTOP), lambda: os.kill(pid, signal.SIGCONT)
    os.kill(pid, signal.SIGCONT)


def state(page):
    return page.locator("[data-live='state']").first.inner_text()


def alarm(page):
    return page.get_by_role("alert").get_by_text("STOP NOT DELIVERED: cut the power").is_visible()


def is_stale(page):
    return page.evaluate("document.body.classList.contains('stale')")


def delivered(page):
    return page.evaluate("truing.live.stopId > 0 && truing.live.stopDelivered === truing.live.stopId")


def test_a_stop_is_acknowledged_by_the_board_and_latches_until_someone_drives(page):
    drive_by_key(page)
    page.keyboard.press("Space")
    wait(lambda: delivered(page), "an acknowledged stop")
    wait(lambda: state(page) == "STOPPED", "the latched state")
    wait(lambda: speed(page) < 0.02, "standstill")
    page.wait_for_timeout(1000)  # the key is still held
    assert state(page) == "STOPPED"
    assert speed(page) < 0.02
    page.keyboard.up("ArrowUp")
    page.wait_for_timeout(500)
    assert state(page) == "STOPPED"
    assert not alarm(page)
    drive_by_key(page)
    wait(lambda: state(page) == "live", "a state that is no longer latched")
    page.keyboard.up("ArrowUp")


def test_a_stop_that_a_frozen_server_does_not_deliver_is_an_alarm_on_every_page(page, frozen):
    freeze, resume = frozen
    for key, title in (("1", "Live"), ("2", "World"), ("6", "Analysis")):
        go(page, key, title)
        freeze()
        page.evaluate(_MEASURE_ALARM)
        wait(lambda: page.evaluate("window.alarmMs"), "the alarm")
        assert page.evaluate("window.alarmMs") >= 290.0
        assert alarm(page)
        assert state(page) == "stopping"
        box = page.locator(".stop-alert").bounding_box()
        assert box is not None
        assert box["width"] >= 1280
        # The alarm does not cover the button: another stop can be sent.
        page.get_by_role("button", name="STOP").click(trial=True)
        wait(lambda: is_stale(page), "grey values")
        resume()
        wait(lambda: delivered(page), "an acknowledged stop")
        assert not alarm(page)
        wait(lambda: not is_stale(page), "new values")


def test_a_stop_on_a_cut_link_is_an_alarm_and_is_delivered_once_the_link_is_back(page, rig):
    rig.link.pull()
    try:
        wait(lambda: is_stale(page), "grey values")
        page.get_by_role("button", name="STOP").click()
        wait(lambda: alarm(page), "the alarm")
        page.wait_for_timeout(1000)
        assert alarm(page)
        assert not delivered(page)
    finally:
        rig.link.plug()
    wait(lambda: delivered(page), "an acknowledged stop")
    assert not alarm(page)
    wait(lambda: not is_stale(page), "new values")
    wait(lambda: state(page) == "STOPPED", "the latched state")


def test_values_older_than_half_a_second_are_grey(page, frozen):
    value = page.locator("[data-live='speed-left']").first
    colour = "e => getComputedStyle(e).color"
    fresh = value.evaluate(colour)
    freeze, resume = frozen
    freeze()
    wait(lambda: is_stale(page), "grey values")
    age = page.evaluate("performance.now() - truing.live.sampledAt")
    assert age > 500.0
    assert value.evaluate(colour) != fresh
    resume()
    wait(lambda: value.evaluate(colour) == fresh, "the colour of fresh values")


def test_the_space_bar_stops_in_dialogs_lists_and_number_fields(page):
    def stops():
        return live(page, "stopId")

    go(page, "2", "World")
    page.get_by_label("Brush, m", exact=True).focus()
    before = stops()
    page.keyboard.press("Space")
    assert stops() == before + 1
    go_to = page.get_by_label("Name", exact=True)
    go_to.focus()
    page.keyboard.press("Space")
    assert stops() == before + 1  # at rest a space in a text field is text
    page.locator("main canvas").first.focus()
    page.keyboard.press("?")
    page.get_by_role("dialog").wait_for()
    page.keyboard.press("Space")
    assert stops() == before + 2
    page.keyboard.press("Escape")
    page.get_by_role("dialog").wait_for(state="hidden")
    go(page, "4", "Compare")
    page.get_by_label("Set", exact=True).focus()
    page.keyboard.press("Space")
    assert stops() == before + 3
