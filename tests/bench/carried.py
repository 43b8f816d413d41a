"""What each export format carries of each effect of the catalogue: writes host/truing/exporters/CARRIED.md.

    .venv/bin/python tests/bench/carried.py

For every effect that a wheel's model can hold, a robot with that effect is driven; its recordings are
simulated again by the program that runs each format, without the effect and with it. The others are named.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from truing.exporters.carried import Check, check
from truing.exporters.consumers import CONSUMERS, own
from truing.exporters.recorded import tasks
from truing.model.robot_model import RobotModel
from truing.model.wheel import WheelPhysics
from truing.recording.baseline import Baseline, RobotGeometry, WheelModel
from truing.recording.run import RecordingSet, Run

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "host" / "truing" / "exporters" / "CARRIED.md"
GEOMETRY = RobotGeometry("robot", 0.05, 0.24, 4096.0)
PLAIN = WheelPhysics(1.2, 0.25)
# Effect: what the left and the right wheel have of it. The first row is no effect: numbers that were wrong.
EFFECTS: dict[str, tuple[dict[str, float], dict[str, float]]] = {
    "other numbers": ({"gain_mps": 1.4, "time_constant_s": 0.2}, {"gain_mps": 1.4, "time_constant_s": 0.2}),
    "side_asymmetry": ({"gain_mps": 1.3, "time_constant_s": 0.2}, {"gain_mps": 1.1, "time_constant_s": 0.3}),
    "coulomb_friction": ({"friction": 0.05}, {"friction": 0.07}),
    "stribeck_friction": (
        {"friction": 0.03, "breakaway_excess": 0.06, "stribeck_mps": 0.06, "stribeck_shape": 2.0},
        {"friction": 0.04, "breakaway_excess": 0.05, "stribeck_mps": 0.06, "stribeck_shape": 2.0},
    ),
    "input_delay": ({"delay_s": 0.04}, {"delay_s": 0.06}),
    "driver_lag": ({"lag_s": 0.05}, {"lag_s": 0.05}),
    "direction_asymmetry": ({"reverse_gain": 0.85}, {"reverse_gain": 0.9}),
    "quadratic_drag": ({"drag": 0.2}, {"drag": 0.25}),
    "driver_deadband": ({"deadband": 0.05}, {"deadband": 0.05}),
}
# Effects that are written as something else than a wheel's physics.
ELSEWHERE = {
    "wheelbase_error": "becomes the wheelbase, in every format that has one",
    "speed_filter": "belongs to the recorder: `toml` alone keeps it, and checks apply it to simulated speeds",
}
ROW_S = 0.02
# (left, right) effort for so many seconds: steps from rest, a creep, a reversal, coasting, a ramp.
LEVELS = (
    *((0.0, 0.0, 0.4), (0.5, 0.4, 1.0), (0.9, 0.8, 1.0)),
    *((0.12, 0.14, 1.0), (-0.6, -0.5, 1.2), (0.0, 0.0, 0.8)),
)
# The error after may be this much above the tool's own.
BAR = 1.1

ABOUT = """\
# What each format carries of each effect

Written by `.venv/bin/python tests/bench/carried.py`. A robot with the effect is driven (7 s, counts at
50 Hz), and each format's file is run on the same efforts by its program: error of the wheels' speeds, mm/s,
before (the baseline without the effect) and after. Carried: at most {bar:g} times what our own simulation
leaves. The recordings come from `truing.model`: this says what formats carry, no more."""
OTHERS = """\
`toml` holds every effect of the catalogue, and the next diagnosis simulates them. `mat` holds what `python`
does, as numbers; `c-header`, `wpilib` and `ros2-control` are a controller's parameters: nothing runs them."""


def recordings(model: RobotModel) -> RecordingSet:
    """The model's own drive in counts, with the plain wheels as the baseline."""
    efforts = np.concatenate([np.tile((a, b), (round(s / ROW_S), 1)) for a, b, s in LEVELS])
    ramp = np.linspace(0.0, 0.5, 75)[:, None] * np.ones(2)
    efforts = np.concatenate((np.zeros((1, 2)), efforts, ramp)).T
    columns = {"t_s": ROW_S * np.arange(efforts.shape[1])}
    columns |= {f"effort_{side}": effort for side, effort in zip(("left", "right"), efforts, strict=True)}
    still = {f"ticks_{side}": np.zeros(efforts.shape[1]) for side in ("left", "right")}
    plain = WheelModel(PLAIN.gain_mps, PLAIN.time_constant_s)
    baseline = Baseline(Path("baseline.toml"), plain, plain, GEOMETRY)
    task = tasks(RecordingSet("made", (Run("made", columns | still),), baseline))[0]
    assert GEOMETRY.metres_per_count is not None
    counts = np.floor(own(model)(task) / GEOMETRY.metres_per_count)
    ticks = {f"ticks_{side}": row for side, row in zip(("left", "right"), counts, strict=True)}
    return RecordingSet("made", (Run("made", columns | ticks),), baseline)


def measured(effect: str, kinds: tuple[str, ...] = tuple(CONSUMERS)) -> Check:
    """One effect in these formats."""
    left, right = EFFECTS[effect]
    model = RobotModel(replace(PLAIN, **left), replace(PLAIN, **right), GEOMETRY, 1.0 / ROW_S)
    return check(model, recordings(model), kinds)


def unheld() -> list[str]:
    """Effects of the catalogue that no wheel's model holds."""
    from truing.diagnose.catalogue import CATALOGUE

    return sorted(name for name in CATALOGUE if name not in EFFECTS and name not in ELSEWHERE)


def cell(found: Check, kind: str) -> str:
    """A table's cell: errors before and after, mm/s, and whether the format carries the effect."""
    one = next(item for item in found.formats if item.kind == kind)
    if one.given_mps is None or one.after_mps is None:
        return "not run"
    if one.after_mps <= BAR * found.own_mps:
        return f"carried: {1e3 * one.given_mps:.0f}, {1e3 * one.after_mps:.2f}"
    if one.terms and all(value is None for value in one.terms.values()):
        return f"cannot hold it: {1e3 * one.after_mps:.0f}"
    return f"in part: {1e3 * one.given_mps:.0f}, {1e3 * one.after_mps:.1f}"


def page(found: dict[str, Check]) -> str:
    """The whole page."""
    kinds = list(CONSUMERS)
    lines = [
        *ABOUT.format(bar=BAR).splitlines(),
        "",
        "| effect | own | " + " | ".join(f"`{kind}`" for kind in kinds) + " |",
        "| --- |" + " --- |" * (len(kinds) + 1),
    ]
    for effect, result in found.items():
        cells = " | ".join(cell(result, kind) for kind in kinds)
        name = f"`{effect}`" if "_" in effect else effect
        lines.append(f"| {name} | {1e3 * result.own_mps:.2f} | {cells} |")
    lines += [
        "",
        *OTHERS.splitlines(),
        "",
        *(f"`{name}` {what}." for name, what in ELSEWHERE.items()),
        "",
        "No wheel's model, and so none of these formats, can hold:",
        "",
        *(f"- `{name}`" for name in unheld()),
        "",
    ]
    return "\n".join(lines)


def main() -> int:
    """Measure and write the page."""
    missing = [kind for kind, consumer in CONSUMERS.items() if not consumer.installed]
    if missing:
        print(f"not installed: what runs {', '.join(missing)}")
        return 1
    PAGE.write_text(page({effect: measured(effect) for effect in EFFECTS}), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
