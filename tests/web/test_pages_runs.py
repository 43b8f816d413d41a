"""Compare, Error models and Analysis in a browser: runs beside simulations, sliders, signals, diagnoses."""

from __future__ import annotations

import json
import math

import pytest

from support.foreign_files import write_sysid
from truing.recording.baseline import read_baseline
from truing.recording.reader import read_run
from web.browser_rig import (
    accessibility_violations,
    address,
    choose_tool,
    go,
    live,
    run_to_the_end,
    start_run,
    wait,
)
from web.page_reach import cut_texts, out_of_reach_by_tab
from web.synthetic_runs import BASELINE, TAU_S, VERDICT, synthetic_set, write_diagnosis

pytestmark = [pytest.mark.xdist_group("browser"), pytest.mark.slow]


@pytest.fixture(scope="module", autouse=True)
def runs(rig):
    return synthetic_set(rig.view.out / "made")


PLOT = "document.querySelector('.plot canvas')?.plot"


def paths(page):
    return page.evaluate(
        "document.querySelector('main canvas').topView.paths.map(p => [p.title, p.points.at(-1)])"
    )


def end_of(page, title):
    return next((point for name, point in paths(page) if name == title), None)


def curves(page):
    """Curves that the plot draws."""
    return page.evaluate(f"{PLOT}?.panels().reduce((sum, panel) => sum + panel.lines.length, 0) ?? 0")


def settled_end_of(page, title):
    """The end of a path once the page draws it no further."""
    seen = []

    def stands():
        seen.append(end_of(page, title))
        page.wait_for_timeout(500)
        return seen[-1] == end_of(page, title)

    wait(stands, "a picture that stands")
    return seen[-1]


def choose(page, label, text):
    page.get_by_label(label, exact=True).select_option(label=text)


def choose_drawn(page, run, speed):
    """A run of the made set, and its path in the picture."""
    choose(page, "Set", "made")
    choose(page, "Run", run)
    way = 1.3 / 1.45 * speed * (5.0 - TAU_S)
    wait(lambda: abs((end_of(page, "Real robot") or [0.0])[0] - way) < 0.01, f"the path of {run}", 60.0)


def test_a_run_lies_beside_its_simulations_and_others_join_it(page):
    go(page, "4", "Compare")
    choose_drawn(page, "02_straight", 0.5)
    page.get_by_role("button", name="None", exact=True).click()
    wait(lambda: end_of(page, "Simulated (model)") is None, "no error model")
    assert end_of(page, "Desired")[0] == pytest.approx(2.5, abs=0.01)
    assert end_of(page, "Real robot")[0] < end_of(page, "Simulated")[0] < end_of(page, "Desired")[0]
    table = page.get_by_role("table", name="Stopping points")
    assert "2.5000" in table.inner_text()
    page.get_by_role("button", name="MOM paper", exact=True).click()
    wait(lambda: end_of(page, "Simulated (model)"), "the paper's model")
    assert end_of(page, "Simulated (model)")[1] < -0.5
    page.get_by_text("Measured paths of other runs").click()
    page.get_by_label("also draw 03_straight").check()
    wait(lambda: end_of(page, "03_straight"), "the other run")
    wait(lambda: curves(page) >= 6, "all speeds drawn")


def test_runs_from_disk_are_dropped_in(page, rig, runs):
    go(page, "4", "Compare")
    zone = page.locator(".drop-zone input")
    zone.wait_for(state="attached")
    zone.set_input_files([runs / "baseline.toml", runs / "runs/03_straight.csv"])
    wait(lambda: (rig.view.out / "dropped/03_straight/runs/03_straight.csv").exists(), "the dropped run")
    wait(lambda: page.get_by_label("Set", exact=True).input_value().endswith("03_straight"), "its set")
    wait(lambda: end_of(page, "Simulated"), "its simulation")
    zone.set_input_files({"name": "bad.csv", "mimeType": "text/csv", "buffer": b"no run"})
    page.get_by_text("bad.csv", exact=False).first.wait_for()


def test_a_slider_moved_by_keys_moves_the_overlay_and_the_model_is_saved(page, rig):
    go(page, "5", "Error models")
    choose_drawn(page, "01_straight", 0.3)
    page.get_by_role("button", name="MOM paper", exact=True).click()
    slider = page.get_by_role("slider", name="drift on straight lines, rad/m")
    slider.wait_for()
    wait(lambda: end_of(page, "Simulated (model)"), "the paper's model", 30.0)
    before = end_of(page, "Simulated (model)")
    slider.focus()
    for _ in range(25):
        page.keyboard.press("ArrowLeft")
    wait(lambda: end_of(page, "Simulated (model)")[1] < before[1] - 0.05, "a moved overlay")
    moved = settled_end_of(page, "Simulated (model)")
    page.get_by_label("distance scale, value").fill("0.1")
    page.get_by_label("distance scale, value").press("Enter")
    wait(lambda: math.hypot(*end_of(page, "Simulated (model)")) > math.hypot(*moved), "a longer path")
    page.get_by_role("button", name="Save as the robot's model").click()
    wait((rig.view.out / "models/robot.toml").exists, "the robot's model")
    go(page, "4", "Compare")
    pressed = page.get_by_role("button", name="MOM paper", exact=True)
    wait(lambda: pressed.get_attribute("aria-pressed") == "true", "the model in force")


def test_what_a_diagnosis_found_is_dropped_in_and_turned(page, rig):
    go(page, "5", "Error models")
    choose_drawn(page, "01_straight", 0.3)
    page.get_by_role("button", name="Diagnosed", exact=True).click()
    file = {"name": "made.json", "mimeType": "application/json", "buffer": json.dumps(VERDICT).encode()}
    page.locator(".drop-zone input").set_input_files(file)
    slider = page.get_by_role("slider", name="coulomb friction: left, effort")
    slider.wait_for()
    wait(lambda: end_of(page, "Simulated (model)"), "its simulation", 150.0)
    before = end_of(page, "Simulated (model)")
    assert abs(before[1]) < 0.5
    slider.evaluate("e => { e.value = 0.12; e.dispatchEvent(new Event('input')); }")
    wait(lambda: end_of(page, "Simulated (model)")[1] > before[1] + 0.1, "a robot that pulls to the left")
    page.get_by_role("button", name="Save as the robot's model").click()
    file = rig.view.out / "models/robot.toml"
    wait(lambda: file.exists() and "coulomb_friction" in file.read_text(), "the saved effect")
    assert read_baseline(file).effects["coulomb_friction"]["left"] == pytest.approx(0.12, abs=0.01)


def test_control_inputs_are_replayed_under_the_model_in_force(page):
    drifting = json.loads(json.dumps(VERDICT)) | {"name": "drifting"}
    drifting["effects"][0] |= {"name": "heading_drift", "scope": "body"}
    drifting["effects"][0]["parameters"] = {
        "drift": {"value": 0.3, "ci95": [0.28, 0.32], "unit": "rad/m"},
        "distance_scale": {"value": 0.0, "ci95": [-0.01, 0.01], "unit": "1"},
    }
    go(page, "5", "Error models")
    page.get_by_role("button", name="Diagnosed", exact=True).click()
    file = {"name": "drifting.json", "mimeType": "application/json", "buffer": json.dumps(drifting).encode()}
    page.locator(".drop-zone input").set_input_files(file)
    page.get_by_role("slider", name="heading drift: drift, rad/m").wait_for()
    page.get_by_role("button", name="Save as the robot's model").click()
    page.get_by_text("robot.toml", exact=False).first.wait_for()
    go(page, "3", "Trajectory")
    choose_tool(page, "Lines", "line")
    canvas = page.locator("main canvas").first
    box = canvas.bounding_box()
    canvas.click(position={"x": box["width"] / 2 + 150, "y": box["height"] / 2})
    page.get_by_text("ends at", exact=False).first.wait_for()
    found = page.get_by_role("button", name="Diagnosed", exact=True)
    wait(lambda: found.get_attribute("aria-pressed") == "true", "the saved model in force")
    page.get_by_role("button", name="Replay", exact=True).click()
    wait(lambda: paths(page), "a path under what was found", 150.0)
    ((_, (_x, y, theta)),) = paths(page)
    assert theta == pytest.approx(0.3 * 1.5, rel=0.15)
    assert y > 0.15
    page.get_by_text("diagnosed model: ends at", exact=False).wait_for()
    page.get_by_role("button", name="MOM paper", exact=True).click()
    page.get_by_role("button", name="Replay", exact=True).click()
    wait(lambda: paths(page) and paths(page)[0][1][1] < -0.1, "the paper's drift, to the right")
    page.get_by_role("button", name="None", exact=True).click()
    page.get_by_role("button", name="Replay", exact=True).click()
    page.get_by_text("follows the control inputs exactly", exact=False).wait_for()
    assert not paths(page)


def statistics(page):
    return page.get_by_role("table", name="Statistics of the selection").locator("tbody tr").all_inner_texts()


def test_signals_are_chosen_spans_are_measured_and_saved(page, tmp_path):
    go(page, "6", "Analysis")
    choose(page, "Set", "made")
    choose(page, "Run", "02_straight")
    wait(lambda: len(statistics(page)) == 4, "four signals", 30.0)
    page.get_by_label("theta_rad", exact=True).check()
    wait(lambda: len(statistics(page)) == 5, "five signals")
    page.get_by_label("effort_left", exact=True).uncheck()
    wait(lambda: len(statistics(page)) == 4, "four signals again")
    wait(lambda: page.evaluate(f"{PLOT}.panels().length") == 3, "three panels")
    page.get_by_label("from, s").fill("4.5")
    page.get_by_label("to, s").fill("6")
    # The last 1.5 s of 0.5 m/s on wheels of 1.3 instead of 1.45 m/s.
    wait(lambda: statistics(page)[0].split("\t")[1:3] == ["31", "0.4483"], "the steady speed")
    page.get_by_role("button", name="Select", exact=True).click()
    wait(lambda: page.evaluate(f"{PLOT}.tool") == "select", "a plot that selects")
    box = page.locator(".plot canvas").first.bounding_box()
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 0.6 * box["height"], steps=4)
    page.mouse.up()
    wait(lambda: page.get_by_label("from, s").input_value() != "4.5", "a dragged selection")
    rows = page.get_by_role("table", name="Metrics of every step").locator("tbody tr").all_inner_texts()
    assert len(rows) >= 2
    assert rows[0].startswith("left")
    with page.expect_download() as download:
        page.get_by_role("button", name="Save the curves as CSV").click()
    text = download.value.path().read_text()
    assert (
        text.splitlines()[0] == "t_s,speed_left (m/s),speed_right (m/s),effort_right (% effort),theta_rad (°)"
    )
    with page.expect_download() as download:
        page.get_by_role("button", name="Save the figure as PNG").click()
    assert download.value.path().read_bytes().startswith(b"\x89PNG")


def test_a_diagnosis_is_started_watched_and_cancelled_with_the_page_alive(page):
    go(page, "6", "Analysis")
    choose(page, "Set", "made")
    page.get_by_role("button", name="Diagnose this set").click()
    page.get_by_text("diagnosing made", exact=False).wait_for()
    assert page.get_by_role("progressbar", name="Progress of the diagnosis").is_visible()
    frames = live(page, "frames")
    wait(lambda: live(page, "frames") != frames, "a picture that goes on")
    page.get_by_role("button", name="Cancel the diagnosis").click()
    page.get_by_text("cancelled", exact=True).wait_for()
    wait(lambda: not page.get_by_role("progressbar").is_visible(), "no bar")


def test_the_next_experiment_is_driven_and_joins_the_set(page, rig):
    own = synthetic_set(rig.view.out / "recordings/own")
    finding = "Right wheel: its encoder loses counts, or its motor is not like the left one's."
    folder = write_diagnosis(rig.view.out, "recordings-own", finding=finding, has_next=True)
    (folder / "recordings-own.next.toml").write_text(
        'title = "Tell them apart"\n[[segment]]\nduration_s = 0.6\neffort = [0.2, 0.2]\n'
        "[[segment]]\nduration_s = 1.0\neffort = [0.0, 0.0]\n"
    )
    go(page, "6", "Analysis")
    choose(page, "Set", "recordings/own")
    page.get_by_text("Right wheel: its encoder loses counts", exact=False).wait_for()
    page.get_by_role("button", name="02_straight, 1.0 to 2.5 s").click()
    wait(lambda: page.get_by_label("Run", exact=True).input_value() == "02_straight", "the run")
    wait(lambda: page.get_by_label("from, s").input_value() == "1", "the stretch")
    shaded = f"({PLOT}.figure.marks ?? []).map(mark => [mark.from, mark.to, mark.colour])"
    wait(lambda: [1, 2.5, "#ff7b7b"] in page.evaluate(shaded), "its mark in the chart")
    page.get_by_role("button", name="Mismatch", exact=True).click()
    wait(lambda: page.evaluate(f"{PLOT}.panels().length") == 2, "a map for each wheel")
    page.locator(".plot canvas").focus()
    for key in ("ArrowDown", "ArrowDown", "i"):
        page.keyboard.press(key)
    readout = page.locator(".plot-readout")
    wait(lambda: readout.inner_text().startswith("02_straight"), "the second run's cell")
    assert "left, refitted 0.9" in readout.inner_text()
    with page.expect_download() as download:
        page.get_by_role("button", name="Save the curves as CSV").click()
    table = download.value.path().read_text().splitlines()
    assert table[0].startswith('t_s,"01_straight, left, refitted"')
    assert table[3].split(",")[2] == "6.5"
    place = page.evaluate(f"{PLOT}.place")
    x = place["left"] + (place["right"] - place["left"]) * 1.2 / 6.0
    page.locator(".plot canvas").click(position={"x": x, "y": place["tops"][1] + 0.5 * place["each"]})
    wait(lambda: page.evaluate(f"{PLOT}.panels().length") == 2 and "view=signals" in address(page), "the run")
    assert page.get_by_label("Run", exact=True).input_value() == "02_straight"
    assert [page.get_by_label(end).input_value() for end in ("from, s", "to, s")] == ["1", "1.5"]
    run_to_the_end(page, lambda: start_run(page, "Run the next experiment"))
    added = own / "runs/04_next.csv"
    assert added.is_file()
    run = read_run(added)
    assert run.metadata.plan["title"] == "Tell them apart"
    assert run.columns["vel_left_mps"].max() > 0.1


def shown(page):
    """What the Compare page shows of a run: paths, curves, rows of the table."""
    rows = page.get_by_role("table", name="Stopping points").locator("tbody tr").count()
    return len(paths(page)), curves(page), rows


def test_a_run_that_cannot_be_shown_clears_what_was_there_and_says_why(page, rig):
    folder = synthetic_set(rig.view.out / "broken")
    (folder / "runs/02_straight.csv").write_text("t_s,effort_left\n0,1\n")
    bare = [line for line in BASELINE.splitlines() if not line.startswith("wheelbase")]
    (folder / "baseline.toml").write_text("\n".join(bare))
    go(page, "4", "Compare")
    choose_drawn(page, "02_straight", 0.5)
    wait(lambda: min(shown(page)) > 0, "paths, speeds and a table")
    choose(page, "Set", "broken")
    choose(page, "Run", "02_straight")
    empty = f"{PLOT}?.figure.empty"
    wait(lambda: page.evaluate(empty) == "02_straight cannot be shown", "a stage that says why")
    assert shown(page) == (0, 0, 0)
    assert "column" in page.locator(".side [role=status]").first.inner_text()
    choose(page, "Run", "01_straight")
    wait(lambda: shown(page)[1] > 3, "speeds without a wheelbase")
    page.get_by_text("the set's baseline has no wheelbase", exact=False).wait_for()
    go(page, "6", "Analysis")
    choose(page, "Set", "made")
    wait(lambda: len(statistics(page)) > 2, "signals", 30.0)
    choose(page, "Set", "broken")
    choose(page, "Run", "02_straight")
    wait(lambda: page.evaluate(empty) == "02_straight cannot be shown", "a stage that says why")
    assert statistics(page) == []


_MOVES_BETWEEN_PRESS_AND_RELEASE = """() => {
    const room = document.createElement('div');
    document.querySelector('.side').prepend(room);
    window.addEventListener('pointerdown', () => { room.style.height = '120px'; }, { once: true });
}"""


def test_a_button_that_moves_under_the_pointer_is_pressed_all_the_same(page):
    go(page, "5", "Error models")
    for name in ("None", "MOM paper", "None"):
        button = page.get_by_role("button", name=name, exact=True)
        button.wait_for()
        page.evaluate(_MOVES_BETWEEN_PRESS_AND_RELEASE)
        box = button.bounding_box()
        page.mouse.move(box["x"] + 5, box["y"] + 5)
        page.mouse.down()
        page.wait_for_timeout(50)
        page.mouse.up()
        wait(lambda button=button: button.get_attribute("aria-pressed") == "true", f"{name} pressed")
        page.locator(".side > div").first.evaluate("e => e.remove()")


def test_a_run_chosen_before_its_sets_list_has_come_is_the_run_of_that_name(page, rig):
    """As on a slow link: both choices leave the page before an answer to the first one arrives."""
    synthetic_set(rig.view.out / "twin")
    go(page, "4", "Compare")
    choose(page, "Set", "made")
    choose_drawn(page, "01_straight", 0.3)
    page.evaluate(
        """(path) => { for (const [label, value] of [["Set", path], ["Run", "03_straight"]]) {
            const list = document.querySelector(`select[aria-label="${label}"]`);
            list.value = value; list.dispatchEvent(new Event("change")); } }""",
        str((rig.view.out / "twin").resolve()),
    )
    wait(lambda: page.get_by_label("Set", exact=True).input_value().endswith("twin"), "the set")
    wait(lambda: page.get_by_label("Run", exact=True).input_value() == "03_straight", "the run")
    way = 1.3 / 1.45 * 0.6 * (5.0 - TAU_S)
    wait(lambda: abs((end_of(page, "Real robot") or [0.0])[0] - way) < 0.01, "its path", 60.0)


def test_a_dropped_table_is_asked_about_and_a_sysid_file_is_a_set_of_its_own(page, rig, tmp_path):
    go(page, "4", "Compare")
    zone = page.locator(".drop-zone input")
    zone.wait_for(state="attached")
    rows = [f"{0.05 * k:.2f},{0.2 + 0.01 * (k % 7)},0.2,{0.01 * k:.3f},{0.01 * k:.3f}" for k in range(60)]
    table = tmp_path / "bench.csv"
    table.write_text("\n".join(["time,pwmL,pwmR,speedL,speedR", *rows]))
    zone.set_input_files(table)
    box = page.get_by_role("dialog", name="Import")
    box.get_by_text("The columns are taken so").wait_for()
    assert "speedL" in box.get_by_role("table").inner_text()
    assert not accessibility_violations(page)
    assert not out_of_reach_by_tab(page)
    assert not cut_texts(page)
    box.get_by_label("Mapping").fill(
        '[columns]\nt_s = "time"\neffort_left = "pwmL"\neffort_right = "pwmR"\n'
        'vel_left_mps = "speedL"\nvel_right_mps = "speedR"\n'
    )
    box.get_by_role("button", name="Import", exact=True).click()
    wait(
        lambda: page.get_by_label("Set", exact=True).input_value().endswith("dropped/bench"), "its set", 60.0
    )
    assert (rig.view.out / "dropped/bench/mapping.toml").is_file()
    zone.set_input_files(write_sysid(tmp_path / "lift.json"))
    wait(lambda: page.get_by_label("Set", exact=True).input_value().endswith("dropped/lift"), "its set", 60.0)
    assert len(list((rig.view.out / "dropped/lift/runs").glob("*.csv"))) == 4
