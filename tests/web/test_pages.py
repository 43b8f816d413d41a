"""The pages end to end: a headless Chromium, the view's process, the flashed image on a virtual board."""

from __future__ import annotations

import socket
import time

import pytest

from truing.device import Device
from truing.log_decode import decode_log
from truing.recording_reader import read_run
from truing.web.map_file import read_world
from web.browser_bench import (
    board_state,
    drive_by_key,
    faults_of_access,
    go,
    live,
    open_page,
    speed,
    wait,
)

pytestmark = [pytest.mark.xdist_group("browser"), pytest.mark.slow]


def test_arrow_keys_drive_and_letting_go_stops(page):
    drive_by_key(page)
    assert live(page, "state.driver") == "you"
    page.keyboard.up("ArrowUp")
    wait(lambda: speed(page) < 0.02, "standstill")
    x = live(page, "corrected[0]")
    assert isinstance(x, float)
    assert x > 0.05


def test_the_space_bar_stops_also_with_a_key_held_and_from_another_page(page, browser, bench, problems):
    other = open_page(browser, bench, problems)
    try:
        drive_by_key(page)
        assert live(other, "state.driver") == "another"
        other.keyboard.press("Space")
        wait(lambda: speed(page) < 0.02, "standstill")
        page.keyboard.up("ArrowUp")
        drive_by_key(page)
        page.keyboard.press("Space")
        wait(lambda: speed(page) < 0.02, "standstill")
        page.keyboard.up("ArrowUp")
    finally:
        other.close()


def test_one_page_drives_and_the_other_watches(page, browser, bench, problems):
    other = open_page(browser, bench, problems)
    try:
        page.keyboard.press("c")
        wait(lambda: live(page, "state.driver") == "you", "the wheel")
        other.keyboard.down("ArrowUp")
        time.sleep(0.7)
        assert speed(other) < 0.02
        other.keyboard.up("ArrowUp")
        page.keyboard.press("c")
        wait(lambda: live(other, "state.driver") == "nobody", "a free wheel")
    finally:
        other.close()


def test_killing_the_tab_while_driving_stops_the_wheels_in_the_log(browser, bench, problems):
    page = open_page(browser, bench, problems)
    drive_by_key(page)
    time.sleep(0.5)
    watcher = open_page(browser, bench, problems)
    try:
        page.close()
        closed = time.monotonic()
        wait(lambda: board_state(watcher) == "idle", "stopped board", 3.0)
        assert time.monotonic() - closed < 1.0
        wait(lambda: live(watcher, "state.driver") == "nobody", "a free wheel")
    finally:
        watcher.close()
    # The view lets the board go, so that its log can be read from here.
    bench.link.pull()
    time.sleep(0.3)
    with Device.open(bench.board.tcp) as device:
        log = device.log()
        data, _ = device.read_log(log)
        records = decode_log(data, log.offset, log.log_id).records
    bench.link.plug()
    assert log.end.name == "STOPPED"
    assert records["speed_left"].max() > 200


def test_a_pulled_cable_is_said_stops_the_robot_and_is_recovered_from(page, bench):
    drive_by_key(page)
    bench.link.pull()
    wait(lambda: live(page, "state.link?.state") == "lost", "a lost link")
    assert page.locator("[data-live='link-told']").first.inner_text() != ""
    page.keyboard.up("ArrowUp")
    time.sleep(1.0)  # the board's own command time-out
    bench.link.plug()
    wait(lambda: live(page, "state.link?.state") == "connected", "a connected board")
    wait(lambda: speed(page) < 0.02, "standstill")
    wait(lambda: live(page, "state.board?.faults?.some(f => f.name === 'host_silent')"), "the fault's name")
    page.locator("[data-live-clear]").click()
    wait(lambda: live(page, "state.board?.faults?.length") == 0, "cleared faults")
    drive_by_key(page)
    page.keyboard.up("ArrowUp")


def test_connect_and_disconnect_by_button(page):
    page.get_by_role("button", name="Disconnect", exact=True).click()
    wait(lambda: live(page, "state.link?.told") == "disconnected by you", "a disconnected board")
    page.get_by_role("button", name="Connect", exact=True).click()
    wait(lambda: live(page, "state.link?.state") == "connected", "a connected board")


def test_a_wall_is_painted_seen_saved_and_erased(page, bench):
    go(page, "2", "World")
    wait(lambda: live(page, "state.scan"), "a scan")
    page.get_by_role("button", name="Clear", exact=True).click()
    wait(lambda: live(page, "state.scan.laser.every(mm => mm === null)"), "an open floor")
    page.get_by_role("button", name="Fit", exact=True).click()
    box = page.locator("main canvas").first.bounding_box()
    assert box is not None
    page.get_by_role("button", name="Place robot", exact=True).click()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(middle[0] + 80, middle[1], steps=4)
    page.mouse.up()
    wait(lambda: abs(live(page, "corrected[2]")) < 0.01, "a robot that heads along x")  # type: ignore[arg-type]
    time.sleep(0.3)
    page.get_by_role("button", name="Wall", exact=True).click()

    def screen(ahead_m: float, aside_m: float) -> tuple[float, float]:
        at = page.evaluate(
            """([ahead, aside]) => { const v = document.querySelector('main canvas').topView;
            const [x, y, th] = window.truing.live.corrected, c = Math.cos(th), s = Math.sin(th);
            return v.toScreen(x + ahead * c - aside * s, y + ahead * s + aside * c); }""",
            [ahead_m, aside_m],
        )
        return box["x"] + at[0], box["y"] + at[1]

    page.mouse.move(*screen(1.0, -0.6))
    page.mouse.down()
    page.mouse.move(*screen(1.0, 0.6), steps=8)
    page.mouse.up()
    wait(lambda: live(page, "state.scan.laser[90]"), "the wall in the laser")
    seen = live(page, "state.scan.laser[90]")
    assert isinstance(seen, int)
    assert abs(seen - 1000) < 120
    page.get_by_role("button", name="Save", exact=True).click()
    file = bench.view.out / "maps/room.yaml"
    wait(file.exists, "the map's file")
    time.sleep(0.2)
    assert read_world(file).occupied.sum() > 20
    page.get_by_role("button", name="Clear", exact=True).click()
    wait(lambda: live(page, "state.scan.laser.every(mm => mm === null)"), "an open floor")
    page.get_by_role("button", name="Load", exact=True).click()
    wait(lambda: live(page, "state.scan.laser[90]"), "the wall in the laser again")


def test_the_global_map_grows(page):
    go(page, "2", "World")
    page.get_by_role("button", name="By odometry", exact=True).click()
    response = page.request.get(page.url.split("/world")[0] + "/maps/odometry.png")
    assert response.ok
    assert response.body().startswith(b"\x89PNG")


def test_a_path_driven_by_six_keys_becomes_a_sequence_that_the_board_runs(page, bench):
    go(page, "3", "Trajectory")
    page.keyboard.down("ArrowUp")
    time.sleep(1.0)
    page.keyboard.up("ArrowUp")
    page.keyboard.press("+")
    page.keyboard.down("a")
    time.sleep(0.5)
    page.keyboard.up("a")
    page.keyboard.press("Space")
    page.get_by_text("cycles", exact=False).first.wait_for()
    page.get_by_label("Name").fill("keyed")
    page.get_by_label("Name").press("Tab")
    page.get_by_role("button", name="Upload and run").click()
    wait(lambda: live(page, "state.task?.stage") == "done", "finished run", 30.0)
    saved = live(page, "state.task?.saved")
    assert isinstance(saved, str)
    run = read_run(saved)
    assert run.columns["x_m"][-1] > 0.1
    assert (bench.view.out / "sequences/keyed.toml").is_file()
    assert run.metadata is not None
    assert run.metadata.plan["name"] == "keyed"


def test_lines_are_drawn_dragged_and_run_and_losing_the_page_stops_the_run(browser, bench, problems):
    page = open_page(browser, bench, problems, "trajectory")
    page.get_by_role("button", name="Lines", exact=True).click()
    canvas = page.locator("main canvas").first
    canvas.click(position={"x": 600, "y": 300})
    canvas.click(position={"x": 700, "y": 400})
    told = page.get_by_text("ends at", exact=False)
    told.wait_for()
    first = told.inner_text()
    box = canvas.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 700, box["y"] + 400)
    page.mouse.down()
    page.mouse.move(box["x"] + 760, box["y"] + 250, steps=5)
    page.mouse.up()
    wait(lambda: told.inner_text() != first, "a moved end")
    page.get_by_role("button", name="Upload and run").click()
    wait(lambda: board_state(page) == "sequence", "a running sequence")
    watcher = open_page(browser, bench, problems)
    try:
        page.close()
        wait(lambda: board_state(watcher) != "sequence", "an ended sequence", 2.0)
        wait(lambda: speed(watcher) < 0.02, "standstill", 2.0)
    finally:
        watcher.close()
    assert not problems


def test_the_world_and_the_robot_are_seen_in_three_dimensions(page):
    go(page, "7", "3-D")

    def scene(what: str) -> object:
        return page.evaluate(
            f"(() => {{ const s = document.querySelector('main canvas').scene3d; return {what}; }})()"
        )

    wait(lambda: page.evaluate("document.querySelector('main canvas')?.scene3d?.blocks?.count") or 0, "walls")
    drawn = scene("s.drawn")
    wait(lambda: scene("s.drawn") > drawn, "pictures")
    assert page.locator(".scene-told").inner_text() == ""
    page.locator("main canvas").focus()
    before = scene("s.eye.position.x")
    page.keyboard.press("j")
    wait(lambda: abs(scene("s.eye.position.x") - before) > 0.05, "a turned view")
    page.get_by_role("button", name="Follow", exact=True).click()
    drive_by_key(page)
    away = "Math.hypot(s.eye.position.x - s.robot.position.x, s.eye.position.y - s.robot.position.y)"
    wait(lambda: scene(away) < 2.2, "a camera behind the robot")
    page.keyboard.up("ArrowUp")


def test_the_picture_keeps_thirty_frames_a_second(page):
    time.sleep(2.5)
    rate = live(page, "rate")
    assert isinstance(rate, int)
    assert rate >= 25


@pytest.mark.parametrize("path", ["", "world", "trajectory", "compare", "models", "analysis", "scene"])
@pytest.mark.parametrize("width", [1280, 390])
def test_no_page_has_a_serious_fault_of_access_or_scrolls_sideways(browser, bench, problems, path, width):
    page = open_page(browser, bench, problems, path, width, 720 if width > 500 else 844)
    try:
        wait(lambda: page.locator("main canvas, main .main-svg").count() > 0, "a picture")
        assert not faults_of_access(page)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    finally:
        page.close()
    assert not problems


def test_a_web_socket_of_another_site_is_refused(bench):
    host, port = bench.view.address.removeprefix("http://").rstrip("/").split(":")
    for path in ("/live?session=x", "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"):
        with socket.create_connection((host, int(port)), timeout=5) as raw:
            raw.sendall(
                f"GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\nOrigin: http://evil.example\r\n"
                "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
                "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode()
            )
            assert b" 403 " in raw.recv(200).split(b"\r\n")[0]
