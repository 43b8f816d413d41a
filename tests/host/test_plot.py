"""Pictures and the report page: they show what was measured, stand alone, and bear odd runs."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from support.first_order_robot import BASELINE, TEST_XI, WHEELBASE_M, FirstOrderRobot
from truing.cli import group
from truing.identify.identification import identify_set
from truing.recording.baseline import Baseline
from truing.recording.run import RecordingSet, Run, RunMetadata
from truing.recording.writer import write_run
from truing.report.figures import MAX_POINTS, run_figures, thin
from truing.report.plot import path_window, render_png
from truing.report.run_page import render_report
from truing.report.run_view import integrate_path, view_run

PNG_MARK = b"\x89PNG\r\n\x1a\n"
METADATA = RunMetadata(
    firmware={"version": "0.1.0", "board": "truing-f405"},
    parameters={"kp_left": 0.25},
    plan={"name": "paper/XI", "title": "Test XI <both wheels>"},
    seed=7,
)


def driven(**options: object) -> Run:
    return FirstOrderRobot(right_gain_mps=1.40).drive(TEST_XI, **options)  # type: ignore[arg-type]


def page_of(*runs: Run, baseline: Baseline | None = BASELINE) -> str:
    recordings = RecordingSet("a robot", runs, baseline)
    return render_report(recordings, identify_set(recordings))


def figures_in(page: str) -> dict[str, dict[str, object]]:
    found = re.search(r"^const figures = (\{.*\});$", page, re.MULTILINE)
    assert found is not None
    tree = json.loads(found[1])
    assert isinstance(tree, dict)
    return tree


def size_of(png: bytes) -> tuple[int, int]:
    assert png.startswith(PNG_MARK)
    return int.from_bytes(png[16:20], "big"), int.from_bytes(png[20:24], "big")


def test_a_picture_is_a_png_and_the_same_every_time() -> None:
    view = view_run(driven(), BASELINE)
    png = render_png(view)
    width, height = size_of(png)
    assert width > 1000
    assert height > 500
    assert render_png(view) == png


def test_a_run_without_pose_gets_its_path_from_its_wheels_or_says_why_not() -> None:
    run = driven(columns=("vel",))
    with_baseline = view_run(run, BASELINE)
    assert with_baseline.path is not None
    assert with_baseline.path.source == "wheel travel"
    without = view_run(run, None)
    assert without.path is None
    assert "no pose" in without.path_reason
    assert size_of(render_png(without))[0] < size_of(render_png(with_baseline))[0]
    assert "no pose" in page_of(run, baseline=None)
    assert "no pose" not in page_of(run)


def test_a_run_with_pose_shows_the_pose() -> None:
    run = driven()
    pose = {"x_m": run.t_s, "y_m": 0.1 * run.t_s, "theta_rad": 0.0 * run.t_s}
    view = view_run(replace(run, columns=run.columns | pose), BASELINE)
    assert view.path is not None
    assert view.path.source == "odometry"
    assert np.array_equal(view.path.x_m, run.t_s)


def test_a_pivot_about_the_right_wheel_draws_a_circle_around_it() -> None:
    left = np.linspace(0.0, 2.0 * np.pi * WHEELBASE_M, 2001)
    x, y, theta = integrate_path(left, np.zeros_like(left), WHEELBASE_M)
    assert theta[-1] == pytest.approx(-2.0 * np.pi)
    radius = np.hypot(x, y + 0.5 * WHEELBASE_M)
    assert radius == pytest.approx(np.full_like(x, 0.5 * WHEELBASE_M), rel=1e-5)


def test_an_effort_command_is_drawn_as_the_speed_it_asks_for() -> None:
    run = driven()
    recordings = RecordingSet("a robot", (run,), BASELINE)
    fits = identify_set(recordings).whole_fits
    view = view_run(run, BASELINE, fits)
    assert view.left.commanded is not None
    assert view.left.commanded.max() == pytest.approx(0.50 * 1.45, rel=1e-3)
    assert view.commanded_label == "command × gain"
    assert view_run(run, BASELINE).left.commanded is None


def test_a_velocity_command_is_drawn_as_it_is() -> None:
    view = view_run(FirstOrderRobot().drive(((1.0, 0.0), (2.0, 0.3)), mode="velocity"), BASELINE)
    assert view.left.commanded is not None
    assert view.left.commanded.max() == 0.3
    assert view.same_command
    assert view.commanded_label == "commanded"


def test_a_gap_breaks_the_line() -> None:
    run = driven(columns=("vel",))
    late = run.columns | {"t_s": run.t_s + np.where(run.t_s > 4.0, 3.0, 0.0)}
    view = view_run(replace(run, columns=late))
    assert np.isnan(view.left.speed).sum() == 1
    render_png(view)


def test_speeds_are_drawn_at_the_middle_of_their_intervals() -> None:
    view = view_run(driven(), BASELINE)
    assert view.middle_s[10] == pytest.approx(view.t_s[10] - 0.025)


def test_a_robot_that_never_moves_can_be_drawn() -> None:
    run = FirstOrderRobot().drive(((2.0, 0.0),))
    assert render_png(view_run(run, BASELINE)).startswith(PNG_MARK)
    page_of(run)


def test_a_straight_path_is_not_drawn_as_a_slit() -> None:
    view = view_run(FirstOrderRobot().drive(TEST_XI), BASELINE)
    assert view.path is not None
    low_x, high_x, low_y, high_y = path_window(view.path)
    assert (high_y - low_y) > 0.4 * (high_x - low_x)


class Outline(HTMLParser):
    """What a page loads, and whether its elements close."""

    VOID = frozenset({"meta", "br", "hr", "img", "link", "input"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loads: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href") and value and not value.startswith("data:"):
                self.loads.append(value)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("script", "style"):
            self.text.append(data)


def outline(page: str) -> Outline:
    parser = Outline()
    parser.feed(page)
    parser.close()
    assert parser.open == []
    return parser


def test_the_page_is_whole_and_loads_nothing() -> None:
    parsed = outline(page_of(driven()))
    assert parsed.loads == []


def test_the_page_shows_title_tables_and_metadata() -> None:
    run = replace(driven(), metadata=METADATA)
    text = " ".join(outline(page_of(run)).text)
    for words in (
        "Test XI <both wheels>",
        "Steps, several levels",
        "35 → 50 %",
        "truing-f405",
        "kp_left",
        "0.25",
    ):
        assert words in text


def test_a_hostile_name_cannot_leave_its_place() -> None:
    nasty = '</script><script>alert("x")</script>'
    metadata = replace(METADATA, plan={"title": nasty}, extra={nasty: nasty})
    run = replace(driven(), name=nasty, metadata=metadata)
    page = page_of(run)
    assert nasty not in page
    outline(page)


def test_every_run_has_its_figures_with_finite_numbers() -> None:
    page = page_of(driven(name="01_a"), driven(name="02_b", columns=("vel",)))
    figures = figures_in(page)
    assert set(figures) == {"speeds-1", "path-1", "speeds-2", "path-2", "overlay-E-B-3"}
    names = [trace["name"] for trace in figures["speeds-1"]["data"]]  # type: ignore[attr-defined, index]
    assert {"left, measured", "right, measured", "left, model (free run)"} <= set(names)
    for name in figures:
        assert f'id="{name}"' in page


def test_figures_show_what_was_measured() -> None:
    run = driven()
    view = view_run(run, BASELINE)
    trace = run_figures(view)["speeds"]["data"][0]
    assert trace["y"] == pytest.approx(run.speed("left", BASELINE).values, rel=1e-5, abs=1e-9)


def test_a_long_run_is_thinned_and_keeps_its_peaks() -> None:
    values = np.sin(np.linspace(0.0, 300.0, 120_000))
    values[77_777] = 9.0
    values[5_555] = np.nan
    rows = thin(values)
    assert rows.size <= MAX_POINTS + 10
    assert np.nanmax(values[rows]) == 9.0
    assert np.isnan(values[rows]).any()
    assert rows[0] == 0
    assert rows[-1] == values.size - 1


def test_truing_plot_writes_pictures_and_a_page(tmp_path: Path) -> None:
    file = write_run(driven(columns=("vel", "cmd")), tmp_path / "01_XI.csv")
    out = tmp_path / "out"
    result = CliRunner().invoke(group, ["plot", str(file), "--out", str(out)], catch_exceptions=False)
    assert result.exit_code == 0
    assert sorted(path.name for path in out.iterdir()) == ["01_XI.png", "report.html"]
    assert "written:" in result.stdout
