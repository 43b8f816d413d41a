"""Runs of one kind are laid over each other, so that a linear robot's runs fall on their dashed levels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from support.first_order_robot import BASELINE, TEST_XI, FirstOrderRobot
from truing.identify.identification import identify_set
from truing.identify.tables import shape_table
from truing.recording.run import RecordingSet
from truing.report.overlays import overlay_figure, overlays, save_overlay
from truing.report.png import save_table

ROBOT = FirstOrderRobot(gain_mps=1.40, time_constant_s=0.2)


@pytest.fixture(scope="module")
def driven() -> RecordingSet:
    def steps(*levels: float) -> tuple[tuple[float, float], ...]:
        return ((1.0, 0.0), *((2.0, level) for level in levels), (2.0, 0.0))

    runs = (
        ROBOT.drive(steps(0.30), name="01_a", right_share=0.0),
        ROBOT.drive(steps(0.60), name="02_b", right_share=0.0),
        ROBOT.drive(TEST_XI, name="03_c"),
        ROBOT.drive(steps(0.15, 0.30, 0.25), name="04_d"),
        ROBOT.drive(steps(0.30), name="05_e", right_share=0.0, mode="velocity"),
    )
    return RecordingSet("linear", runs, BASELINE)


def test_each_kind_of_run_gets_one_overlay(driven: RecordingSet) -> None:
    laid = overlays(driven, identify_set(driven))
    assert [(overlay.mode, overlay.count, len(overlay.curves)) for overlay in laid] == [
        ("E-L", 1, 2),
        ("V-L", 1, 1),
        ("E-B", 3, 4),
    ]
    assert laid[0].title == "Effort, left wheel, one level (E-L)"


def test_a_linear_robots_runs_settle_on_their_normalised_levels(driven: RecordingSet) -> None:
    for overlay in overlays(driven, identify_set(driven)):
        for curve in overlay.curves:
            for begin, end, level in curve.levels:
                late = (curve.times_s > begin + 0.6 * (end - begin)) & (curve.times_s < end - 0.05)
                assert np.mean(curve.speed[late]) == pytest.approx(level, abs=0.01)


def test_an_overlay_is_drawn_as_a_picture_and_for_the_page(driven: RecordingSet, tmp_path: Path) -> None:
    result = identify_set(driven)
    for overlay in overlays(driven, result):
        path = save_overlay(overlay, tmp_path / f"{overlay.name}.png")
        assert path.read_bytes().startswith(b"\x89PNG")
        traces = overlay_figure(overlay)["data"]
        shown = [trace["name"] for trace in traces if trace.get("showlegend", True)]
        assert shown == [f"{curve.run}, {curve.wheel}" for curve in overlay.curves]


def test_a_table_is_a_picture_too(driven: RecordingSet, tmp_path: Path) -> None:
    table = shape_table(identify_set(driven))
    assert save_table(table, tmp_path / "table.png").read_bytes().startswith(b"\x89PNG")
    assert table.to_csv().splitlines()[0] == ",".join(
        f'"{name}"' if "," in name else name for name in table.header
    )
