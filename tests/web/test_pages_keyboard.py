"""Keyboard-only operation: pages, tools, canvas, lists, sliders, driving."""

from __future__ import annotations

import pytest

from web.browser_rig import (
    START,
    cycles,
    drive_by_key,
    go,
    live,
    run_to_the_end,
    speed,
    take_control,
    wait,
)
from web.page_reach import out_of_reach_by_tab
from web.synthetic_runs import synthetic_set

pytestmark = [pytest.mark.xdist_group("browser"), pytest.mark.slow]

_NAME = """(() => { const e = document.activeElement;
return [e.tagName, (e.getAttribute('aria-label') || e.textContent || '').trim()]; })()"""


@pytest.fixture(autouse=True)
def runs(rig):
    return synthetic_set(rig.view.out / "made")


def tab_to(page, name, tag=""):
    """Press Tab until the focus is there."""
    for _ in range(90):
        page.keyboard.press("Tab")
        at, text = page.evaluate(_NAME)
        if text.startswith(name) and (not tag or at == tag):
            return
    pytest.fail(f"Tab never comes to {name!r}")


def test_a_wall_is_painted_and_saved_by_keys(page, rig):
    go(page, "2", "World")
    take_control(page)
    wait(lambda: live(page, "state.scan"), "a scan")
    before = live(page, "state.world")
    tab_to(page, "Paint", "BUTTON")
    page.keyboard.press("Enter")
    tab_to(page, "The world from above", "CANVAS")
    for key in "iiill":
        page.keyboard.press(key)
    page.keyboard.press("Enter")
    wait(lambda: live(page, "state.world") != before, "a painted spot")
    tab_to(page, "Save", "BUTTON")
    page.keyboard.press("Enter")
    wait((rig.view.out / "maps/room.yaml").exists, "the map's file")


def test_a_path_is_driven_uploaded_and_run_by_keys(page):
    go(page, "3", "Trajectory")
    page.keyboard.down("ArrowUp")
    wait(lambda: cycles(page) >= 14, "a path that takes longer than the shortest run")
    page.keyboard.up("ArrowUp")
    tab_to(page, "Upload and run", "BUTTON")
    # The preview's button has the focus when it opens.
    focused = page.locator("button:focus")

    def press():
        page.keyboard.press("Enter")
        page.get_by_role("button", name=START).wait_for()
        wait(lambda: focused.inner_text() == START, "the preview's button")
        page.keyboard.press("Enter")

    run_to_the_end(page, press)


def test_lists_and_sliders_are_worked_by_keys(page):
    go(page, "5", "Error models")
    tab_to(page, "MOM paper", "BUTTON")
    page.keyboard.press("Enter")
    tab_to(page, "drift on straight lines, rad/m", "INPUT")
    page.keyboard.press("ArrowRight")
    value = page.evaluate("Number(document.activeElement.value)")
    assert value > -0.2635
    go(page, "6", "Analysis")
    tab_to(page, "Run", "SELECT")
    first = page.evaluate("document.activeElement.value")
    page.keyboard.press("ArrowUp" if page.evaluate("document.activeElement.selectedIndex") else "ArrowDown")
    wait(lambda: page.get_by_label("Run", exact=True).input_value() != first, "another run")
    tab_to(page, "Diagnose this set", "BUTTON")


def test_help_driving_and_stop_are_on_keys(page):
    page.keyboard.press("?")
    page.get_by_role("dialog").get_by_text("stop, from every page", exact=False).wait_for()
    page.keyboard.press("Escape")
    page.get_by_role("dialog").wait_for(state="hidden")
    drive_by_key(page)
    page.keyboard.press("Space")
    wait(lambda: speed(page) < 0.02, "standstill")
    page.keyboard.up("ArrowUp")


def test_an_experiment_is_chosen_shown_and_its_dialog_left_by_keys(page):
    go(page, "8", "Experiments")
    tab_to(page, "Kind", "SELECT")
    while page.evaluate("document.activeElement.value") != "step":
        page.keyboard.press("ArrowDown")
    page.get_by_label("height", exact=True).wait_for()
    tab_to(page, "height", "INPUT")
    page.keyboard.press("Control+a")
    page.keyboard.type("25")
    page.get_by_text("Step of 25% effort", exact=False).wait_for()
    tab_to(page, "Preview and run", "BUTTON")
    page.keyboard.press("Enter")
    box = page.get_by_role("dialog", name="Before the robot moves")
    box.wait_for()
    wait(lambda: page.evaluate(_NAME)[1].startswith(START), "the focus on the start")
    assert out_of_reach_by_tab(page) == []
    inside = "document.querySelector('.q-dialog').contains(document.activeElement)"
    wait(lambda: page.evaluate(inside), "the focus back in the dialog")  # it is led back after it has left
    page.keyboard.press("Escape")
    box.wait_for(state="hidden")
    wait(lambda: page.evaluate(_NAME)[1] == "Preview and run", "the focus where it was")


def test_a_parameter_is_found_changed_and_put_back_by_keys(page):
    go(page, "9", "Parameters")
    page.get_by_label("wheelbase_m", exact=True).wait_for()
    tab_to(page, "Search", "INPUT")
    page.keyboard.type("wheelbase")
    wait(lambda: page.locator("table.parameters tbody tr").count() == 1, "one parameter")
    tab_to(page, "wheelbase_m", "INPUT")
    page.keyboard.press("Control+a")
    page.keyboard.type("0.3")
    page.keyboard.press("Enter")
    box = page.get_by_role("dialog", name="Control")
    box.wait_for()
    wait(lambda: page.evaluate(_NAME)[1] == "Take control", "the focus in the dialog")
    assert out_of_reach_by_tab(page) == []
    tab_to(page, "Take control", "BUTTON")
    page.keyboard.press("Enter")
    page.get_by_text("1 of 45 values are not stored", exact=False).wait_for()
    tab_to(page, "Load what is stored", "BUTTON")
    page.keyboard.press("Enter")
    page.get_by_text("A restart keeps every value as it is.").wait_for()
