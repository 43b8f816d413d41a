"""What a page shows is in its address: back, reload and a link; undo and redo; lists of what was saved."""

from __future__ import annotations

import pytest

from web.browser_rig import address, choose_tool, cycles, go, live, open_page, take_control, wait
from web.synthetic_runs import synthetic_set

pytestmark = [pytest.mark.xdist_group("browser"), pytest.mark.slow]

TOP = "document.querySelector('main canvas').topView"


@pytest.fixture(scope="module", autouse=True)
def runs(rig):
    return synthetic_set(rig.view.out / "made")


def chosen(page):
    return page.get_by_label("Run", exact=True).input_value()


def is_pressed(page, name):
    button = page.get_by_role("button", name=name, exact=True)
    return button.count() == 1 and button.get_attribute("aria-pressed") == "true"


def test_back_reload_and_a_link_lead_to_the_same_run_model_and_zoom(page, browser, rig, problems):
    go(page, "4", "Compare")
    page.get_by_label("Set", exact=True).select_option(label="made")
    page.get_by_label("Run", exact=True).select_option(label="02_straight")
    wait(lambda: "run=02_straight" in address(page), "the run in the address")
    page.get_by_role("button", name="MOM paper", exact=True).click()
    wait(lambda: "model=paper" in address(page), "the model in the address")
    page.get_by_label("Run", exact=True).select_option(label="03_straight")
    wait(lambda: "run=03_straight" in address(page), "the other run in the address")
    page.go_back()
    wait(lambda: chosen(page) == "02_straight", "the run before")
    box = page.locator("main canvas").first.bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 100)
    page.mouse.wheel(0, -400)
    wait(lambda: "v=" in address(page), "the zoom in the address")
    zoom = page.evaluate(f"{TOP}.zoom")
    page.reload()
    other = open_page(browser, rig, problems, address(page)[1:])
    try:
        for one in (page, other):
            wait(lambda one=one: chosen(one) == "02_straight", "the same run")
            wait(lambda one=one: is_pressed(one, "MOM paper"), "the same model")
            wait(lambda one=one: abs(one.evaluate(f"{TOP}.zoom") - zoom) < 0.01, "the same zoom")
    finally:
        other.close()
    # The other pages show the run that was chosen last, and this page is found as it was left.
    go(page, "6", "Analysis")
    wait(lambda: chosen(page) == "02_straight", "the run on another page")
    go(page, "4", "Compare")
    wait(lambda: abs(page.evaluate(f"{TOP}.zoom") - zoom) < 0.01, "the zoom as it was left")
    page.get_by_role("button", name="None", exact=True).click()


def test_moved_sliders_are_in_the_address(page):
    go(page, "5", "Error models")
    page.get_by_role("button", name="MOM paper", exact=True).click()
    field = page.get_by_label("distance scale, value")
    field.fill("0.1")
    field.press("Enter")
    wait(lambda: "paper.scale~0.1" in address(page), "the slider in the address")
    page.reload()
    wait(lambda: field.count() == 1 and field.input_value() == "0.1", "the slider as it was")


def test_a_path_is_undone_redone_reloaded_and_opened_again(page):
    go(page, "3", "Trajectory")
    choose_tool(page, "Lines", "line")
    canvas = page.locator("main canvas").first
    canvas.click(position={"x": 600, "y": 300})
    wait(lambda: cycles(page) > 0, "a line")
    first = cycles(page)
    canvas.click(position={"x": 700, "y": 400})
    wait(lambda: cycles(page) > first, "another line")
    both = cycles(page)
    page.keyboard.press("Control+z")
    wait(lambda: cycles(page) == first, "the first line alone")
    page.keyboard.press("Control+z")
    wait(lambda: cycles(page) == 0, "no line")
    page.get_by_role("button", name="Redo", exact=True).click()
    page.keyboard.press("Control+y")
    wait(lambda: cycles(page) == both, "both lines again")
    page.get_by_label("Name", exact=True).fill("kept")
    page.get_by_role("button", name="Save", exact=True).click()
    page.get_by_text("kept.toml", exact=False).first.wait_for()
    wait(lambda: address(page).count("_l") == 2, "the path in the address")
    page.reload()
    wait(lambda: cycles(page) == both, "the path after a reload")
    page.get_by_role("button", name="Reset", exact=True).click()
    wait(lambda: cycles(page) == 0, "no path")
    page.get_by_label("Open a saved path").select_option(label="kept")
    wait(lambda: cycles(page) == both, "the saved path")


def test_a_change_of_the_world_is_undone_and_redone_and_a_map_is_opened(page):
    go(page, "2", "World")
    take_control(page)
    wait(lambda: live(page, "state.scan"), "a scan")
    page.get_by_label("Name", exact=True).fill("before")
    page.get_by_role("button", name="Save", exact=True).click()
    page.get_by_text("before.yaml", exact=False).first.wait_for()

    def occupied():
        picture = page.request.get(page.url.split("/world")[0] + "/maps/world.png")
        return picture.body()

    before = occupied()
    page.get_by_role("button", name="Clear", exact=True).click()
    wait(lambda: occupied() != before, "an empty world")
    empty = occupied()
    page.get_by_role("button", name="Undo", exact=True).click()
    wait(lambda: occupied() == before, "the world as it was")
    page.locator("main canvas").first.focus()
    page.keyboard.press("Control+Shift+Z")
    wait(lambda: occupied() == empty, "the empty world again")
    page.get_by_label("Open a saved map").select_option(label="before")
    wait(lambda: occupied() == before, "the map that was opened")
