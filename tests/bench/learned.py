"""Learned corrections on concealed effects: outside the catalogue, and inside with that effect switched off.

    ./run bench learned

builds what is missing, a trial at a time, and goes on where it was stopped; `out/bench/learned` holds a line
per trial. `TRUING_LEARNED_TRIALS=N` ends it after N more. The process that builds a robot keeps its answer
until the correction is learned. What is judged are the trial's judging runs, which nobody fitted.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from bench.figure import Figure
from bench.narx import Narx
from truing.diagnose.data.set_data import SetData
from truing.diagnose.diagnosis_input import read_input
from truing.diagnose.engine import analyse
from truing.diagnose.learned.learner import applied
from truing.diagnose.learned.regression import Left, groups_of
from truing.diagnose.result import Diagnosis
from truing.trial.concealed import Asked, run_concealed
from truing.trial.effects import CATALOGUE, OUTSIDE

OUTSIDE_SEEDS = (103, 104, 105)
CATALOGUE_SEEDS = (101,)
# Shares that the bars ask for, and the largest rise of an error.
CLOSED, IN_SHARE, RISE = 0.6, 0.8, 0.02
# A true effect that lowers the error by less than this share leaves no gap.
MIN_GAP = 0.02
# Which variables are the right ones; () where no variable of the rows holds the effect.
RIGHT: dict[str, tuple[str, ...]] = {
    "coulomb_friction": ("speed",),
    "stribeck_friction": ("speed",),
    "turning_scrub": ("speed_difference",),
    "quadratic_drag": ("speed",),
    "supply_sag": ("load", "heat", "set_time", "net_effort", "other_net_effort"),
    "winding_heating": ("heat", "set_time"),
    "input_delay": ("recent_effort",),
    "driver_lag": ("recent_effort",),
    "driver_deadband": ("effort",),
    "current_limit": ("net_effort", "effort"),
    "speed_limit": ("speed",),
    "direction_asymmetry": ("effort", "speed"),
    "side_asymmetry": ("effort", "speed"),
    "coast_decay": ("effort", "speed"),
    "gear_backlash": ("net_effort",),
    "torque_ripple": ("angle_repeating",),
    "encoder_eccentricity": ("angle_repeating",),
    "encoder_dropout": ("speed",),
    "speed_filter": ("recent_effort",),
    "inertia_coupling": ("other_net_effort",),
    "wheel_slip": ("net_effort", "effort", "load"),
    "floor_slope": ("heading",),
    "payload_change": ("set_time",),
    "drive_train_resonance": ("ringing", "ringing_rate", "mean_ringing", "mean_ringing_rate"),
    "square_law_driver": ("effort",),
    "rough_patches": ("place_x", "place_y", "place_x_repeating", "place_y_repeating"),
    "effort_dropouts": (),
    "slipping_hub": ("net_effort",),
    "one_way_flywheel": ("speed", "net_effort"),
    "tether": ("ahead", "travel", "place_x"),
    "swinging_load": ("ringing", "ringing_rate", "mean_ringing", "mean_ringing_rate"),
}


def asked_for() -> list[tuple[str, int]]:
    """All trials: each effect outside the catalogue, and each inside that wheels alone show."""
    wheels = [name for name, hidden in CATALOGUE.items() if hidden.domain != "pose"]
    return [(name, seed) for seed in OUTSIDE_SEEDS for name in OUTSIDE] + [
        (name, seed) for seed in CATALOGUE_SEEDS for name in wheels
    ]


def diagnosed(folder: Path, switched_off: str) -> Diagnosis:
    """The diagnosis with a learned correction, without one effect of the catalogue."""
    excluded = frozenset((switched_off,) if switched_off in CATALOGUE else ())
    return analyse(read_input(folder, folder / "baseline.toml"), jobs=1, excluded=excluded, learn=True)


def one_trial(name: str, seed: int, folder: Path) -> dict[str, Any]:
    """Build, learn, open the seal and judge."""
    judged = folder / "judged"
    done = run_concealed(
        Asked(name, seed, weak=False, core=True, judged=judged),
        folder / "set",
        diagnose=lambda recorded, _baseline: diagnosed(recorded, name),
    )
    return judge(folder, done.answer, done.first.diagnosis) | {"seed": seed}


def judge(folder: Path, answer: dict[str, Any], diagnosis: Diagnosis) -> dict[str, Any]:
    """Errors on the judging runs: of the physics, the correction, the truth, and a network."""
    from truing.trial.true_model import TrueModel

    runs = len(list((folder / "set" / "runs").glob("*.csv")))
    true = TrueModel(folder / "set", folder / "judged", runs, answer)
    data = true.all.data
    rows = true.judging & data.judged

    def error(speeds: Any) -> float:
        return 1e3 * float(np.sqrt(np.mean((data.speed_mps - speeds)[rows] ** 2)))

    model = diagnosis.explanations[0]
    base = true.speeds(model.theta, model.effects)
    learned = diagnosis.learned
    assert learned is not None
    after = base
    if learned.correction is not None:
        assert learned.theta is not None
        after = applied(learned.correction, _rows(data, true.speeds(learned.theta, learned.effects)))
    network = Narx(true.real, true.real.counted.astype(float)).free_run(data)
    return {
        "effect": true.names[0],
        "driving": answer["driving"],
        "verdict": diagnosis.verdict,
        "named": list(model.effects),
        "before_mmps": error(base),
        "after_mmps": error(after),
        "true_mmps": error(true.truth.recorded[true.truth_rows(data)]),
        "narx_mmps": error(network),
        "heldout_before_mmps": 1e3 * learned.heldout_before,
        "heldout_after_mmps": 1e3 * learned.heldout_after,
        "terms": [[one.term.place, one.term.variable, one.term.constant] for one in learned.terms],
    }


def _rows(data: SetData, base: Any) -> Left:
    """Rows for a correction that is already learned."""
    return Left(data, base, base, np.ones_like(base), groups_of(data), np.ones(2), np.ones(2))


def results(root: Path) -> list[dict[str, Any]]:
    """What is known so far; trials that are missing are made, as many as `TRUING_LEARNED_TRIALS` allows."""
    kept = root / "out" / "bench" / "learned"
    kept.mkdir(parents=True, exist_ok=True)
    left = int(os.environ.get("TRUING_LEARNED_TRIALS", "1000"))
    found = []
    for name, seed in asked_for():
        path = kept / f"{name}_{seed}.json"
        if not path.exists() and left > 0:
            left -= 1
            folder = Path(tempfile.mkdtemp(prefix="learned-"))
            try:
                path.write_text(json.dumps(one_trial(name, seed, folder)) + "\n", encoding="utf-8")
            finally:
                shutil.rmtree(folder, ignore_errors=True)
        if path.exists():
            found.append(json.loads(path.read_text(encoding="utf-8")))
    return found


def closed(one: dict[str, Any], after: str = "after_mmps") -> float:
    """Share of the way to the true effect's error; NaN where there is none to go."""
    gap = one["before_mmps"] - one["true_mmps"]
    if gap < MIN_GAP * one["before_mmps"]:
        return float("nan")
    return float((one["before_mmps"] - one[after]) / gap)


def rises(one: dict[str, Any]) -> bool:
    """Whether a correction was shown that raises the error on the judging runs."""
    return bool(one["after_mmps"] > (1.0 + RISE) * one["before_mmps"])


def is_right(one: dict[str, Any]) -> bool:
    """Whether the first variable is the right one; nothing is right where no variable holds the effect."""
    right = RIGHT[one["effect"]]
    return one["terms"][0][1] in right if one["terms"] else not right


def bounds(hits: int, count: int) -> tuple[float, float]:
    """95 % bounds of a share (Wilson 1927)."""
    z2 = 1.96**2
    share = hits / count
    middle = (share + 0.5 * z2 / count) / (1.0 + z2 / count)
    half = 1.96 / (1.0 + z2 / count) * np.sqrt(share * (1.0 - share) / count + 0.25 * z2 / count**2)
    return max(float(middle - half), 0.0), min(float(middle + half), 1.0)


def measure(root: Path) -> list[Figure]:
    """The bars' figures over what was made."""
    figures = []
    every = results(root)
    for title, names in (("outside", OUTSIDE), ("leave one out", CATALOGUE)):
        here = [one for one in every if one["effect"] in names and np.isfinite(closed(one))]
        if not here:
            continue
        each = 100.0 / len(here)
        good = each * sum(closed(one) >= CLOSED for one in here)
        narx = each * sum(closed(one, "narx_mmps") >= CLOSED for one in here)
        bar, what = 100.0 * IN_SHARE, f"learned, {title} ({len(here)} trials)"
        figures += [
            Figure(f"{what}: closes 60 % in", good, "%", "more", bar, "NARX network", narx),
            Figure(f"{what}: raises the error in", each * sum(map(rises, here)), "%", "less", 0.0),
            Figure(f"{what}: right variable in", each * sum(map(is_right, here)), "%", "more", bar),
        ]
    return figures


def page(every: list[dict[str, Any]]) -> str:
    """The table of a page."""
    lines = ["| figure | share | 95 % bounds | trials | bar |", "| --- | --- | --- | --- | --- |"]
    for title, names in (("outside the catalogue", OUTSIDE), ("catalogue without the effect", CATALOGUE)):
        here = [one for one in every if one["effect"] in names and np.isfinite(closed(one))]
        questions = (
            ("closes at least 60 %", [closed(one) >= CLOSED for one in here], "80 %"),
            ("a NARX network does so", [closed(one, "narx_mmps") >= CLOSED for one in here], ""),
            ("raises the error by more than 2 %", [rises(one) for one in here], "never"),
            ("first variable is the right one", [is_right(one) for one in here], "80 %"),
        )
        for text, hits, bar in questions if here else ():
            low, high = bounds(sum(hits), len(hits))
            share = f"{100 * sum(hits) / len(hits):.0f} % | {100 * low:.0f} to {100 * high:.0f} %"
            lines.append(f"| {title}: {text} | {share} | {sum(hits)} of {len(hits)} | {bar} |")
    lines += [
        "",
        "| hidden | seed | named | learned | physics | learned | NARX | truth | closed |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for one in every:
        terms = ", ".join(f"{variable} ({place})" for place, variable, _ in one["terms"][:2]) or "nothing"
        terms += f", {len(one['terms']) - 2} more" if len(one["terms"]) > 2 else ""
        share = closed(one)
        sizes = " | ".join(f"{one[f'{key}_mmps']:.1f}" for key in ("before", "after", "narx", "true"))
        named = ", ".join(one["named"]) or "–"
        text = f"{100 * share:.0f} %" if np.isfinite(share) else "no gap"
        lines.append(f"| {one['effect']} | {one['seed']} | {named} | {terms} | {sizes} | {text} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(page(results(Path(__file__).resolve().parents[2])))
