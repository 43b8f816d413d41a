"""What a page says first of a diagnosis: the finding, and where it shows."""

from __future__ import annotations

from dataclasses import replace

from support.diagnoses import friction, missing_physics
from support.recorded_sets import recordings
from truing.diagnose.data.encoder_faults import EncoderFault
from truing.diagnose.present.page import render_report
from truing.diagnose.result import MismatchSpan
from truing.web.views.finding import finding, stretches


def test_an_encoder_at_fault_is_said_first_with_its_wheel():
    fault = EncoderFault("right", {"01": 0.9, "02": 0.8}, 0.1, 0.05, ())
    found = replace(missing_physics(), checks=(fault.check(),))
    assert finding(found).startswith("Right wheel: its encoder loses counts")


def test_the_report_draws_the_wheel_that_is_not_trusted_as_it_was_recorded():
    fault = EncoderFault("right", {"01": 0.9, "02": 0.8}, 0.1, 0.05, ())
    page = render_report(recordings(4), replace(missing_physics(), checks=(fault.check(),)))
    assert "right, recorded (not trusted)" in page
    assert "right, measured" not in page
    assert "left, measured" in page


def test_otherwise_the_effect_that_is_missing_is_said():
    assert "friction" in finding(missing_physics(effects=(friction(),)))


def test_the_largest_stretches_come_first_and_say_run_wheel_share_and_regime():
    spans = tuple(
        MismatchSpan(f"{k:02d}_run", "vel_right_mps", 1.0, 2.5, 0.1 * k, "while it slows down")
        for k in range(1, 7)
    )
    found = stretches(replace(missing_physics(), mismatch=spans))
    assert [one["run"] for one in found] == ["06_run", "05_run", "04_run", "03_run"]
    assert found[0]["span"] == [1.0, 2.5]
    assert found[0]["text"] == "06_run, 1.0 to 2.5 s: right wheel, 60 % of the mismatch, while it slows down"
