"""Compare and Error models in a browser: a run beside its simulations, and sliders that move the overlay."""

from __future__ import annotations

import json

import pytest

from truing.baseline import read_baseline
from web.browser_bench import go, wait
from web.made_runs import VERDICT, made_set

pytestmark = [pytest.mark.xdist_group("browser"), pytest.mark.slow]


@pytest.fixture(scope="module", autouse=True)
def runs(bench):
    return made_set(bench.view.out / "made")


def paths(page):
    return page.evaluate(
        "document.querySelector('main canvas').topView.paths.map(p => [p.title, p.points.at(-1)])"
    )


def end_of(page, title):
    return next((point for name, point in paths(page) if name == title), None)


def choose(page, label, text):
    page.get_by_label(label, exact=True).select_option(label=text)


def test_a_run_lies_beside_its_simulations_and_others_join_it(page):
    go(page, "4", "Compare")
    choose(page, "Set", "made")
    choose(page, "Run", "02_straight")
    wait(lambda: end_of(page, "Desired"), "the desired path", 30.0)
    page.get_by_role("button", name="None", exact=True).click()
    wait(lambda: end_of(page, "Simulated (model)") is None, "no error model")
    assert end_of(page, "Desired")[0] == pytest.approx(2.5, abs=0.01)
    assert end_of(page, "Real robot")[0] < end_of(page, "Simulated")[0] < end_of(page, "Desired")[0]
    table = page.get_by_role("table", name="Stopping points")
    assert "2.5000" in table.inner_text()
    page.get_by_role("button", name="The paper's", exact=True).click()
    wait(lambda: end_of(page, "Simulated (model)"), "the paper's model")
    assert end_of(page, "Simulated (model)")[1] < -0.5
    page.get_by_text("Real paths of other runs").click()
    page.get_by_label("also draw 03_straight").check()
    wait(lambda: end_of(page, "03_straight"), "the other run")
    assert page.locator(".js-plotly-plot .scatterlayer .trace").count() >= 6


def test_runs_from_disk_are_dropped_in(page, bench, runs):
    go(page, "4", "Compare")
    zone = page.locator(".drop-zone input")
    zone.wait_for(state="attached")
    zone.set_input_files([runs / "baseline.toml", runs / "runs/03_straight.csv"])
    wait(lambda: (bench.view.out / "dropped/runs/03_straight.csv").exists(), "the dropped run")
    wait(lambda: page.get_by_label("Set", exact=True).input_value().endswith("dropped"), "its set")
    wait(lambda: end_of(page, "Simulated"), "its simulation")
    zone.set_input_files({"name": "bad.csv", "mimeType": "text/csv", "buffer": b"no run"})
    page.get_by_text("bad.csv", exact=False).first.wait_for()


def test_a_slider_moved_by_keys_moves_the_overlay_and_the_model_is_saved(page, bench):
    go(page, "5", "Error models")
    choose(page, "Set", "made")
    page.get_by_role("button", name="The paper's", exact=True).click()
    slider = page.get_by_role("slider", name="drift on straight lines, rad/m")
    slider.wait_for()
    wait(lambda: end_of(page, "Simulated (model)"), "the paper's model", 30.0)
    before = end_of(page, "Simulated (model)")
    slider.focus()
    for _ in range(25):
        page.keyboard.press("ArrowLeft")
    wait(lambda: end_of(page, "Simulated (model)")[1] < before[1] - 0.05, "a moved overlay")
    page.get_by_label("distance scale, value").fill("0.1")
    page.get_by_label("distance scale, value").press("Enter")
    wait(lambda: end_of(page, "Simulated (model)")[0] > before[0], "a longer path")
    page.get_by_role("button", name="Save as the robot's model").click()
    wait((bench.view.out / "models/robot.toml").exists, "the robot's model")
    go(page, "4", "Compare")
    pressed = page.get_by_role("button", name="The paper's", exact=True)
    wait(lambda: pressed.get_attribute("aria-pressed") == "true", "the model in force")


def test_what_a_diagnosis_found_is_dropped_in_and_turned(page, bench):
    go(page, "5", "Error models")
    choose(page, "Set", "made")
    page.get_by_role("button", name="Found", exact=True).click()
    file = {"name": "made.json", "mimeType": "application/json", "buffer": json.dumps(VERDICT).encode()}
    page.locator(".drop-zone input").set_input_files(file)
    slider = page.get_by_role("slider", name="coulomb friction: left, effort")
    slider.wait_for()
    wait(lambda: end_of(page, "Simulated (model)"), "its simulation", 60.0)
    before = end_of(page, "Simulated (model)")
    assert abs(before[1]) < 0.5
    slider.evaluate("e => { e.value = 0.12; e.dispatchEvent(new Event('input')); }")
    wait(lambda: end_of(page, "Simulated (model)")[1] > before[1] + 0.1, "a robot that pulls to the left")
    page.get_by_role("button", name="Save as the robot's model").click()
    file = bench.view.out / "models/robot.toml"
    wait(lambda: "coulomb_friction" in file.read_text(), "the saved effect")
    assert read_baseline(file).effects["coulomb_friction"]["left"] == pytest.approx(0.12, abs=0.01)
