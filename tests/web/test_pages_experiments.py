"""Experiments: a plan is chosen, shown, driven, compared and diagnosed; parameters; exports."""

from __future__ import annotations

import pytest

from truing.board.parameter_file import read_parameter_file
from truing.recording.reader import read_run
from truing.web.process.robot_side import served_robot
from web.browser_rig import address, go, live, run_to_the_end, start_run, take_control, wait
from web.synthetic_runs import synthetic_set

pytestmark = [pytest.mark.xdist_group("browser"), pytest.mark.slow]

TOP = "document.querySelector('main canvas').topView"
PLOT = "document.querySelector('.plot canvas')?.plot"


def choose(page, label, text):
    page.get_by_label(label, exact=True).select_option(label=text)


def test_every_plan_is_shown_before_it_is_driven(page):
    go(page, "8", "Experiments")
    for kind, plan in (("The paper's tests", "XI"), ("Diagnosis", "staircase")):
        choose(page, "Kind", kind)
        wait(
            lambda plan=plan: page.locator("select[aria-label=Plan] option", has_text=plan).count(),
            "its plans",
        )
        value = page.locator("select[aria-label=Plan] option", has_text=f"{plan}:").first.get_attribute(
            "value"
        )
        page.get_by_label("Plan", exact=True).select_option(value=value)
        wait(lambda value=value: value in address(page), "the plan in the address")
        wait(lambda value=value: page.evaluate(f"{PLOT}?.figure.revision") == value, "what it commands")
        assert page.evaluate(f"{TOP}.paths[0].points.length") > 2
    page.reload()
    wait(lambda: page.get_by_label("Plan", exact=True).input_value() == value, "the plan after a reload")


def test_a_step_is_driven_and_leads_to_comparison_and_diagnosis(page, browser, rig, problems):
    synthetic_set(rig.view.out / "recordings/steps")
    go(page, "8", "Experiments")
    choose(page, "Kind", "Step")
    page.get_by_label("duration, s", exact=True).fill("0.5")
    page.get_by_label("height", exact=True).fill("30")
    page.get_by_text("Step of 30% effort, both, 0.5 s", exact=False).wait_for()
    wait(
        lambda: page.locator("select[aria-label='Add to set'] option", has_text="recordings/steps").count(),
        "sets",
    )
    choose(page, "Add to set", "recordings/steps")
    # Another page lists the runs of the set meanwhile.
    other = browser.new_page()
    other.goto(rig.view.address + "compare?set=recordings/steps&run=01_straight")
    wait(lambda: other.locator("select[aria-label=Run] option").count() == 3, "three runs")
    run_to_the_end(page, lambda: start_run(page, "Preview and run"))
    wait(lambda: other.locator("select[aria-label=Run] option").count() == 4, "the new run by itself")
    assert other.get_by_label("Run", exact=True).input_value() == "01_straight"
    other.close()
    saved = live(page, "state.task.saved")
    run = read_run(str(saved))
    assert run.metadata.plan["title"] == "Step of 30% effort, both, 0.5 s"
    page.get_by_text("04_step is in recordings/steps", exact=False).wait_for()
    page.get_by_role("button", name="Diagnose this set").click()
    page.get_by_text("diagnosing steps", exact=False).wait_for()
    page.get_by_role("button", name="Cancel the diagnosis").click()
    page.get_by_text("cancelled", exact=True).wait_for()
    page.get_by_role("link", name="Compare", exact=False).last.click()
    page.wait_for_function("document.title.startsWith('Compare')")
    wait(lambda: page.get_by_label("Run", exact=True).input_value() == "04_step", "the run that was driven")


def feedforward(page):
    """The board's feedforward on the Parameters page: in force, and by default; by name."""
    go(page, "9", "Parameters")
    page.get_by_label("Search").fill("ff_k")
    page.get_by_label("Search").press("Tab")
    rows = page.locator("table.parameters tbody tr", has_text="ff_k")
    wait(lambda: rows.count() == 12, "twelve parameters")
    now = {row.locator("th").inner_text(): float(row.locator("input").input_value()) for row in rows.all()}
    defaults = [float(row.locator("td").nth(3).inner_text()) for row in rows.all()]
    return now, dict(zip(now, defaults, strict=True))


def tune_up_to_its_last_drive(page):
    go(page, "8", "Experiments")
    choose(page, "Kind", "Tune the feedforward")
    page.get_by_text("Steps of speed, forward and back", exact=False).first.wait_for()
    start_run(page, "Preview and run")
    for step in (1, 2, 3):
        page.get_by_text(f"({step} of 3)", exact=False).wait_for(timeout=90_000)


def test_the_feedforward_is_tuned_to_the_end_and_put_back_when_stopped(page):
    tune_up_to_its_last_drive(page)
    wait(lambda: live(page, "state.task?.stage") == "driving", "the last drive")
    page.keyboard.press("Space")
    page.get_by_text("tune_after stopped: stopped by the user", exact=False).wait_for()
    now, defaults = feedforward(page)
    assert now == defaults
    tune_up_to_its_last_drive(page)
    page.get_by_text("mm/s after: the board holds the new values", exact=False).wait_for(timeout=90_000)
    rows = page.get_by_role("table", name="Feedforward before and after").locator("tbody tr")
    learned = {row.split("\t")[0]: row.split("\t")[1:] for row in rows.all_inner_texts()}
    page.get_by_text("_tune_after is in", exact=False).wait_for()
    now, _ = feedforward(page)
    assert now == pytest.approx({name: float(after) for name, (_, after) in learned.items()}, rel=1e-3)
    page.get_by_role("button", name="Defaults", exact=True).click()
    wait(lambda: feedforward(page)[0] == defaults, "the defaults")


def test_the_wiring_is_checked_to_the_end_and_a_stop_ends_it(page, rig):
    """The view does not see that this robot is a virtual one: whoever stands beside it turns the wheels."""
    hand = served_robot(rig.board.tcp)
    go(page, "8", "Experiments")
    choose(page, "Kind", "Check the wiring")
    turned = page.get_by_role("button", name="Turned")
    for to_the_end in (False, True):
        page.get_by_role("button", name="Preview and run").click()
        page.get_by_role("button", name="Start in 3 s").click()
        for side, name in enumerate(("left", "right")):
            page.get_by_text(f"Turn the {name} wheel FORWARD by one whole turn", exact=False).wait_for()
            hand.turn(side)
            if not to_the_end:
                page.keyboard.press("Space")
                break
            turned.click()
        wait(lambda: live(page, "state.task?.stage") in ("done", "stopped"), "an end")
        if not to_the_end:
            page.get_by_text("the check was stopped. Next: start it again").wait_for()
            wait(lambda: live(page, "stopDelivered") == live(page, "stopId"), "an acknowledged stop")
            wait(lambda: not turned.is_visible(), "nobody asked to turn a wheel")
    page.get_by_text("motors, encoders and counts per revolution are right").wait_for()
    page.get_by_text("right motor output", exact=False).wait_for()
    hand.close()


def test_parameters_are_changed_compared_saved_to_a_file_and_put_back(page, rig):
    go(page, "9", "Parameters")
    field = page.get_by_label("wheelbase_m", exact=True)
    field.wait_for()
    before = field.input_value()
    take_control(page)
    page.get_by_role("button", name="Save to file").click()
    file = rig.view.out / "parameters/board.toml"
    wait(file.exists, "the file")
    assert str(read_parameter_file(file)["wheelbase_m"]) == before
    field.fill("0.3")
    field.press("Tab")
    page.get_by_text("1 of 45 values are not stored", exact=False).wait_for()
    assert "0.3" in page.get_by_role("table", name="Parameters that differ").inner_text()
    choose(page, "Compare with", "board")
    page.get_by_role("button", name="Put these into force").click()
    wait(lambda: field.input_value() == before, "the old value")
    field.fill("99")
    field.press("Tab")
    message = page.locator(".q-notification", has_text="wheelbase_m").first
    message.wait_for()
    wait(lambda: message.bounding_box()["x"] >= 1280 - 360, "a message beside the list, not over it")
    wait(lambda: field.input_value() == before, "the value in force")
    page.get_by_label("Search").fill("wheelbase")
    wait(lambda: page.locator("table.parameters tbody tr").count() == 1, "one parameter")


def test_the_saved_model_is_exported(page, rig):
    synthetic_set(rig.view.out / "made")
    page.goto(page.url + "models?set=made&run=01_straight")
    page.get_by_text("speed error simulated", exact=False).wait_for(timeout=60_000)
    page.get_by_role("button", name="Save as the robot's model").click()
    wait((rig.view.out / "models/robot.toml").exists, "the robot's model")
    page.get_by_text("Export the robot's model").click()
    for kind, holds in (
        ("MJCF: MuJoCo", b"<mujoco"),
        ("C: a header with the board's parameters", b"#define"),
    ):
        choose(page, "Format", kind)
        with page.expect_download() as download:
            page.get_by_role("button", name="Export", exact=True).click()
        assert holds in download.value.path().read_bytes()
