"""What a diagnosis found, as a page says it first: one sentence, and the stretches of runs that show it."""

from __future__ import annotations

from typing import Any

from truing.diagnose.present.text import headline
from truing.diagnose.result import Diagnosis, MismatchSpan

_MAX_STRETCHES = 4
_SIGNALS = {
    "vel_left_mps": "left wheel",
    "vel_right_mps": "right wheel",
    "truth_theta_rad": "heading",
    "truth_x_m": "position",
    "truth_y_m": "position",
}


def finding(diagnosis: Diagnosis) -> str:
    """The finding in one sentence, the wheel first where a wheel's recording is at fault."""
    for check in diagnosis.checks:
        if check.topic == "encoder" and check.severity == "warning" and check.wheel is not None:
            other = "left" if check.wheel == "right" else "right"
            wheel = check.wheel.capitalize()
            return f"{wheel} wheel: its encoder loses counts, or its motor is not like the {other} one's."
    return headline(diagnosis)


def stretches(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The stretches with the largest shares of the mismatch, largest first: run, ends (s) and a text."""
    spans = sorted(diagnosis.mismatch, key=lambda span: -span.share)[:_MAX_STRETCHES]
    return [
        {"run": span.run, "span": [span.t_start_s, span.t_end_s], "text": _stretch_text(span)}
        for span in spans
    ]


def _stretch_text(span: MismatchSpan) -> str:
    where = f"{span.run}, {span.t_start_s:.1f} to {span.t_end_s:.1f} s"
    what = _SIGNALS.get(span.signal, span.signal)
    return f"{where}: {what}, {100.0 * span.share:.0f} % of the mismatch, {span.regime}"
