"""What a plan commands over time, as a figure for the plot."""

from __future__ import annotations

import math

import numpy as np

from truing.plan import Kind, Plan
from truing.web.views.figures import COLOURS, Figure, Line, Panel, panels

# Names, unit and scale of a segment's two numbers.
_AXES = {
    Kind.EFFORT: (("left", "right"), "effort, %", 100.0, 100.0),
    Kind.VELOCITY: (("left", "right"), "wheel speed, m/s", 1.0, 1.0),
    Kind.TWIST: (("speed, m/s", "yaw rate, °/s"), "speed, m/s; yaw rate, °/s", 1.0, 180.0 / math.pi),
}


def plan_figure(plan: Plan) -> Figure:
    """A panel for each kind of command that the plan has; steps where it changes."""
    parts = []
    for kind, (names, unit, *scales) in _AXES.items():
        if not any(segment.kind is kind for segment in plan.segments):
            continue
        t, values = _steps(plan, kind)
        lines = [
            Line(name, t, scale * values[:, k], COLOURS[k])
            for k, (name, scale) in enumerate(zip(names, scales, strict=True))
        ]
        parts.append(Panel(unit, lines))
    return panels(parts, revision=plan.name)


def _steps(plan: Plan, kind: Kind) -> tuple[np.ndarray, np.ndarray]:
    """Times and the two numbers at both ends of every segment; NaN where another kind commands."""
    t, rows, begun = [], [], 0.0
    for segment in plan.segments:
        row = (segment.a, segment.b) if segment.kind is kind else (math.nan, math.nan)
        t += [begun, begun + segment.duration_s]
        rows += [row, row]
        begun += segment.duration_s
    return np.array(t), np.array(rows)
