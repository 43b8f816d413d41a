"""What a verdict is worth: the diagnosis' JSON against what was hidden."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from support.practice_robots.trial import Answer

Result: TypeAlias = dict[str, Any]
Judgement: TypeAlias = dict[str, Any]
SIGNALS = ("left", "right", "pose")
MAX_AMBIGUOUS = 3
CLEAN_VERDICTS = ("consistent", "parameters_only")
ENERGY_SHARE = 0.95  # the fewest rows that hold this share of the energy are where the effect is


def judge(answer: Answer, result: Result) -> Judgement:
    """Judge one verdict.

    Returns
    -------
    `right`: as the bar of its kind asks; `named`: every hidden effect is listed, under
    `missing_physics` with nothing else (one extra for pairs) or among at most three of `ambiguous`;
    `alone`: under `missing_physics`, exactly; `confidently_wrong`: `missing_physics` with something
    that is not there; `covered`, `pure`: the located spans' two shares (None without spans or truth);
    `inside`: parameter -> whether the true value lies in its interval.
    """
    verdict = str(result.get("verdict"))
    listed = [str(effect["name"]) for effect in result.get("effects", [])]
    hidden = set(answer.names) if answer.kind != "outside" else set()
    extra = [name for name in listed if name not in hidden]
    every = bool(hidden) and hidden <= set(listed)
    allowed = 1 if answer.kind == "pair" else 0
    sure = verdict == "missing_physics"
    ambiguous = verdict == "ambiguous"
    named = every and (
        (sure and len(extra) <= allowed) or (ambiguous and len(listed) <= MAX_AMBIGUOUS + allowed)
    )
    covered, pure = located(answer, result)
    if answer.kind.startswith("null"):
        right = verdict in CLEAN_VERDICTS
    elif answer.kind == "outside":
        right = verdict == "unexplained" and place_is_right(covered, pure)
    else:
        right = named
    return {
        "effect": "+".join(answer.names) or answer.kind,
        "kind": answer.kind,
        "strength": answer.strength,
        "S": [round(effect.strength, 3) for effect in answer.effects],
        "plan": answer.plan,
        "seed": answer.seed,
        "verdict": verdict,
        "listed": listed,
        "right": right,
        "named": named,
        "alone": every and sure and not extra,
        "ambiguous": len(listed) if ambiguous else 0,
        "confidently_wrong": sure and bool(extra),
        "false_positive": answer.kind.startswith("null") and verdict not in CLEAN_VERDICTS,
        "covered": covered,
        "pure": pure,
        "inside": inside(answer, result) if named else {},
        "approximate": any(effect.approximate for effect in answer.effects),
    }


def place_is_right(covered: float | None, pure: float | None) -> bool:
    """Half of the effect's energy lies in the spans, and half of the spans is effect."""
    return covered is not None and pure is not None and covered >= 0.5 and pure >= 0.5


def inside(answer: Answer, result: Result) -> dict[str, bool]:
    """Whether each true parameter lies in the interval given for it."""
    out: dict[str, bool] = {}
    for effect in answer.effects:
        for listed in result.get("effects", []):
            if listed["name"] != effect.name:
                continue
            for name, value in effect.parameters.items():
                given = listed.get("parameters", {}).get(name)
                if given is None or not given.get("ci95") or not np.isfinite(value):
                    continue
                low, high = given["ci95"]
                if low is None or high is None:
                    continue
                out[f"{effect.name}.{name}"] = bool(_within(name, value, float(low), float(high)))
    return out


def _within(name: str, value: float, low: float, high: float) -> bool:
    if name == "uphill_heading":  # an angle
        middle = (low + high) / 2
        value = middle + (value - middle + np.pi) % (2 * np.pi) - np.pi
    return low - 1e-12 <= value <= high + 1e-12


def located(answer: Answer, result: Result) -> tuple[float | None, float | None]:
    """Share of the effects' energy that the spans cover, and share of the spans' rows that is effect."""
    if not answer.energy:
        return None, None
    pose = all(effect.domain == "pose" for effect in answer.effects)
    signals = ("pose",) if pose else ("left", "right")
    energy = {
        (run, signal): np.asarray(of_run[signal])
        for run, of_run in answer.energy.items()
        for signal in signals
    }
    marked = {key: np.zeros(len(values), bool) for key, values in energy.items()}
    for span in result.get("mismatch", []):
        key = (str(span["run"]).removesuffix(".csv"), signal_of(str(span["signal"])))
        if key not in marked:
            continue
        ends = (np.arange(len(marked[key])) + 1) * _row_s(answer)
        marked[key] |= (ends > float(span["t_start_s"]) + 1e-6) & (ends <= float(span["t_end_s"]) + 1e-6)
    values = np.concatenate([energy[key] for key in energy])
    spans = np.concatenate([marked[key] for key in energy])
    if not spans.any() or values.sum() <= 0:
        return 0.0, 0.0
    return float(values[spans].sum() / values.sum()), float(_effect_rows(values)[spans].mean())


def _row_s(answer: Answer) -> float:
    return 1.0 / answer.rate_hz


def _effect_rows(energy: NDArray[np.float64]) -> NDArray[np.bool_]:
    order = np.argsort(-energy)
    held = np.cumsum(energy[order]) / energy.sum()
    out = np.zeros(len(energy), bool)
    out[order[: int(np.searchsorted(held, ENERGY_SHARE)) + 1]] = True
    return out


def signal_of(name: str) -> str:
    """Which of left, right and pose a column belongs to."""
    if name.startswith(("truth", "gyro", "x_m", "y_m", "theta", "pose")):
        return "pose"
    return "left" if "left" in name else "right"


def rates(judgements: Iterable[Judgement]) -> dict[str, tuple[int, int]]:
    """Hits and trials for each bar of the acceptance."""
    all_of = list(judgements)
    single = [j for j in all_of if j["kind"] == "single"]
    full = [j for j in single if j["strength"] == "full"]
    weak = [j for j in single if j["strength"] == "weak"]
    pairs = [j for j in all_of if j["kind"] == "pair"]
    nulls = [j for j in all_of if j["kind"].startswith("null")]
    outside = [j for j in all_of if j["kind"] == "outside"]
    spans = [
        j
        for j in [*single, *pairs, *outside]
        if j["covered"] is not None and j["verdict"] not in CLEAN_VERDICTS
    ]
    bounds = [hit for j in single for hit in j["inside"].values() if not j["approximate"]]
    rough = [hit for j in single for hit in j["inside"].values() if j["approximate"]]

    def of(some: list[Judgement], what: str) -> tuple[int, int]:
        return sum(bool(j[what]) for j in some), len(some)

    return {
        "full: named (>= 95 %)": of(full, "named"),
        "weak: named (>= 85 %)": of(weak, "named"),
        "full: named alone (>= 85 %)": of(full, "alone"),
        "weak: named alone (>= 70 %)": of(weak, "alone"),
        "singles answered ambiguous": (sum(j["ambiguous"] > 0 for j in single), len(single)),
        "pairs: both named (>= 75 %)": of(pairs, "named"),
        "nulls: no false positive (>= 98 %)": of(nulls, "right"),
        "confidently wrong (<= 2 %)": of(all_of, "confidently_wrong"),
        "outside: unexplained and placed (>= 80 %)": of(outside, "right"),
        "outside: unexplained": (sum(j["verdict"] == "unexplained" for j in outside), len(outside)),
        "parameters inside, exact ones (90 to 99 %)": (sum(bounds), len(bounds)),
        "parameters inside, approximate ones": (sum(rough), len(rough)),
        "spans cover 0.8 of the energy": (sum(j["covered"] >= 0.8 for j in spans), len(spans)),
        "0.8 of the spans is effect": (sum(j["pure"] >= 0.8 for j in spans), len(spans)),
    }
