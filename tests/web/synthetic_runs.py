"""Recording sets made for the tests of the view: straight lines on the baseline's own wheels."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from truing.recording.run import Run, RunMetadata
from truing.recording.writer import write_run
from truing.web.path.sequence_file import plan_of
from truing.web.path.trajectory import Cycle
from truing.web.views.mismatch_map import mismatch_map

if TYPE_CHECKING:
    from truing.diagnose.present.cells import TimeCells

BASELINE = """
[robot]
wheel_radius_m = 0.0635
wheelbase_m = 0.283
counts_per_rev = 2400
[wheel.left]
gain_mps = 1.45
time_constant_s = 0.35
[wheel.right]
gain_mps = 1.45
time_constant_s = 0.35
"""
TAU_S = 0.35


def straight_run(speed: float = 0.5, name: str = "01_straight", gain: float = 1.45) -> Run:
    """A second at rest, then five with the effort of that speed on wheels of another gain."""
    t = np.arange(0.0, 6.001, 0.05)
    since = np.maximum(t - 1.0, 0.0)
    x = gain / 1.45 * speed * (since - TAU_S * (1.0 - np.exp(-since / TAU_S)))
    v = np.concatenate(([0.0], np.diff(x) / np.diff(t)))
    effort = np.where(t > 1.001, speed / 1.45, 0.0)
    columns = {
        "t_s": t,
        "effort_left": effort,
        "effort_right": effort,
        "vel_left_mps": v,
        "vel_right_mps": v,
        "x_m": x,
        "y_m": np.zeros_like(t),
        "theta_rad": np.zeros_like(t),
    }
    plan = plan_of("straight", [Cycle(0.0, 0.0)] * 10 + [Cycle(speed, 0.0)] * 50)
    return Run(name, columns, metadata=RunMetadata(plan=plan.to_dict()))


def synthetic_set(folder: Path) -> Path:
    """A set of three runs with its baseline."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "baseline.toml").write_text(BASELINE)
    for number, speed in enumerate((0.3, 0.5, 0.6), 1):
        run = straight_run(speed, f"{number:02d}_straight", gain=1.3)
        write_run(run, folder / "runs" / f"{run.name}.csv")
    return folder


VERDICT = {
    "schema": 1,
    "name": "made",
    "verdict": "missing_physics",
    "effects": [
        {
            "name": "coulomb_friction",
            "scope": "both",
            "explanation": 0,
            "parameters": {
                "left": {"value": 0.05, "ci95": [0.04, 0.06], "unit": "effort"},
                "right": {"value": 0.05, "ci95": [0.04, 0.06], "unit": "effort"},
            },
        }
    ],
    "numbers": [
        {
            "wheel": "left",
            "name": "gain_mps",
            "unit": "m/s",
            "given": 1.45,
            "refitted": 1.3,
            "with_effects": {"value": 1.4, "ci95": [1.38, 1.42], "unit": "m/s"},
        }
    ],
}
"""A diagnosis in the form of `truing diagnose --json`."""


def time_cells(wheel: str) -> TimeCells:
    """Of the synthetic set: the mismatch of 02_straight is the largest from 1.0 to 1.5 s."""
    from truing.diagnose.present.cells import TimeCells

    times = np.full((3, 12), 0.9)
    times[1, 2] = 6.5
    times[2, 11] = np.nan
    names = tuple(f"{number:02d}_straight" for number in (1, 2, 3))
    return TimeCells(wheel, names, np.arange(0.0, 6.1, 0.5), times, np.exp(-times), times > 5.0)  # type: ignore[arg-type]


def write_diagnosis(out: Path, name: str, **shown: object) -> Path:
    """A diagnosis of a set as the view's helper leaves it; what the page shows, besides what is given."""
    folder = out / "diagnoses"
    (folder / "pages").mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.json").write_text(json.dumps(VERDICT))
    page = {
        "heading": "Physics is missing",
        "finding": "Dry friction is missing.",
        "sections": [["Verdict", ["Dry friction."]], ["Next", ["Record more."]]],
        "stretches": [{"run": "02_straight", "span": [1.0, 2.5], "text": "02_straight, 1.0 to 2.5 s"}],
        "has_next": False,
        "map": mismatch_map([time_cells("left"), time_cells("right")]),
    }
    (folder / "pages" / f"{name}.json").write_text(json.dumps(page | shown))
    return folder
