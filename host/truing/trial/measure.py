"""A verdict beside the truth: intervals, errors on other runs, places, and how near the best rival comes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from truing.arrays import BoolArray, FloatArray, IntArray
from truing.diagnose.fit import Fit
from truing.diagnose.intervals import idle_parameters
from truing.diagnose.problem import Problem
from truing.diagnose.result import Diagnosis, EffectParameter, MismatchSpan, NamedEffect
from truing.diagnose.search import Search
from truing.recording.run import TRUTH_COLUMNS
from truing.trial.comparators.opinion import Opinion
from truing.trial.comparators.picker import picker
from truing.trial.comparators.sparse import sparse
from truing.trial.comparators.sysid import sysid
from truing.trial.effects import ALL
from truing.trial.score import IN_CATALOGUE
from truing.trial.true_model import TrueModel

# Rivals of the concealed effect that are refitted to noise-free output.
_RIVALS = 3
# A true structure that lowers the error by less than this share leaves no gap to close.
_MIN_GAP = 0.02
# An effect is where this share of its energy is.
WHERE_IT_IS = 0.95
SPEED_SIGNALS = ("vel_left_mps", "vel_right_mps")


@dataclass(frozen=True)
class Measured:
    """Figures of one verdict beside the truth; None where there is nothing to compare.

    Attributes
    ----------
    inside : per parameter of a rightly named effect, whether its interval holds the effective value.
    effective : those values.
    intervals : what the verdict says of them.
    gap_closed : (baseline - fitted) / (baseline - true structure refitted) on the judging runs.
    gap_closed_refitted : the same from the refitted baseline: what naming alone is worth.
    harm : fitted over baseline error on the judging runs.
    over_floor : held-out error with the named effect over the noise floor.
    true_over_floor : that floor over the noise that was really there.
    covered : share of the effect's energy in the spans.
    effect_share : share of the spans' cells that are among those that hold 95 % of the effect's energy.
    effect_energy : share of the energy in the spans that is the effect's, the rest being noise.
    left_covered, left_share : `covered` and `effect_share` of what the refitted baseline leaves of noise-free
        output, for effects outside the catalogue: more than that no recording shows.
    rival, rival_distance : the rival that comes nearest to the concealed effect on noise-free output, and the
        whitened norm of what it misses there.
    opinions : what the other methods name.
    """

    inside: dict[str, bool] = field(default_factory=dict)
    effective: dict[str, float] = field(default_factory=dict)
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)
    gap_closed: float | None = None
    gap_closed_refitted: float | None = None
    harm: float | None = None
    over_floor: float | None = None
    true_over_floor: float | None = None
    covered: float | None = None
    effect_share: float | None = None
    effect_energy: float | None = None
    left_covered: float | None = None
    left_share: float | None = None
    rival: str = ""
    rival_distance: float | None = None
    opinions: dict[str, list[str]] = field(default_factory=dict)
    opinion_gaps: dict[str, float] = field(default_factory=dict)


def measure(true_model: TrueModel, diagnosis: Diagnosis) -> Measured:
    """Compare one diagnosis with the truth."""
    known = str(true_model.answer["family"]) in IN_CATALOGUE
    opinions = {
        "regression with sign": sysid(true_model.real),
        "sparse regression": sparse(true_model.real),
        "picker by training error": picker(diagnosis, _rows(true_model)),
    }
    told = {name: list(opinion.names) for name, opinion in opinions.items()}
    covered, effect_share, effect_energy = _places(true_model, diagnosis)
    figures = Measured(
        over_floor=_over_floor(diagnosis),
        true_over_floor=diagnosis.fit.noise_floor / true_model.noise_mps,
        covered=covered,
        effect_share=effect_share,
        effect_energy=effect_energy,
        opinions=told,
    )
    if not known:
        left = _left_places(true_model, diagnosis)
        return _with(figures, harm=_harm(true_model, diagnosis), left_covered=left[0], left_share=left[1])
    hints = _hints(true_model.on_clean, diagnosis)
    ideal = true_model.effective(hints)
    ceiling = true_model.ceiling(ideal)
    rival, distance = _nearest_rival(true_model, ideal, diagnosis)
    effective, intervals, inside = _intervals(true_model, ideal, diagnosis)
    closed, refitted, harm = _gaps(true_model, diagnosis, ceiling)
    return _with(
        figures,
        inside=inside,
        effective=effective,
        intervals=intervals,
        gap_closed=closed,
        gap_closed_refitted=refitted,
        harm=harm,
        rival=rival,
        rival_distance=distance,
        opinion_gaps=_opinion_gaps(true_model, opinions, ceiling),
    )


def _parameters(said: dict[str, NamedEffect], name: str) -> Mapping[str, EffectParameter]:
    """What a verdict says of an effect; nothing of one that it does not name."""
    return said[name].parameters if name in said else {}


def _with(figures: Measured, **values: Any) -> Measured:
    return replace(figures, **values)


def _rows(true_model: TrueModel) -> int:
    return int(2 * true_model.real.judged.sum() + 3 * len(true_model.on_real.pose_counted))


def _over_floor(diagnosis: Diagnosis) -> float | None:
    """Held-out error with what is named, over the floor of the signal that shows it."""
    if diagnosis.verdict not in ("missing_physics", "ambiguous") or not diagnosis.effects:
        return None
    first = diagnosis.effects[0]
    floor = diagnosis.fit.noise_floor
    if first.domain == "pose":
        floor = math.nan if diagnosis.pose_fit is None else diagnosis.pose_fit.noise_floor
    return first.heldout_rmse_after / floor if floor > 0.0 else None


def _hints(problem: Problem, diagnosis: Diagnosis) -> list[Fit]:
    """What the diagnosis fitted, as starts."""
    return [
        Fit(
            each.effects,
            each.theta,
            problem.columns_of(each.effects),
            problem.residual(each.theta, each.effects),
        )
        for each in diagnosis.explanations
    ]


def _nearest_rival(true_model: TrueModel, ideal: Fit, diagnosis: Diagnosis) -> tuple[str, float | None]:
    """Which other effect comes nearest to a single concealed one, and by how much it misses."""
    if len(true_model.names) != 1:
        return "", None
    problem = true_model.on_clean
    ranked = [entry.names[0] for entry in diagnosis.ranking if len(entry.names) == 1]
    rivals = [name for name in dict.fromkeys(ranked) if name != true_model.names[0]][:_RIVALS]
    if not rivals:
        return "", None
    base = true_model.base(problem)
    found = Search.from_baseline(problem, base, rivals, 1).extend(base, _RIVALS) or [base]
    nearest = min(found, key=lambda one: one.cost)
    name = nearest.effects[0] if nearest.effects else "baseline"
    true = true_model.fitted(problem, true_model.names, [ideal])
    return name, math.sqrt(max(nearest.cost - true.cost, 0.0))


def _intervals(
    true_model: TrueModel, ideal: Fit, diagnosis: Diagnosis
) -> tuple[dict[str, float], dict[str, tuple[float, float]], dict[str, bool]]:
    """Effective parameters, the intervals of rightly named effects, and which of these hold them."""
    intervals: dict[str, tuple[float, float]] = {}
    effective: dict[str, float] = {}
    inside: dict[str, bool] = {}
    said = {effect.name: effect for effect in diagnosis.effects if effect.explanation == 0}
    for name in true_model.names:
        idle = idle_parameters(ideal, name)
        for key, value in true_model.on_clean.simulator.report(name, ideal.theta).items():
            if key in idle:
                continue
            effective[f"{name}.{key}"] = value
            if diagnosis.verdict != "missing_physics" or key not in _parameters(said, name):
                continue
            low, high = said[name].parameters[key].ci95
            intervals[f"{name}.{key}"] = (float(low), float(high))
            slack = 1e-6 * max(abs(value), 1e-3)
            inside[f"{name}.{key}"] = bool(low - slack <= value <= high + slack)
    return effective, intervals, inside


def _in_pose(true_model: TrueModel) -> bool:
    """Whether what is concealed shows in the pose alone."""
    return bool(true_model.names) and all(ALL[name].domain == "pose" for name in true_model.names)


def _error(true_model: TrueModel, theta: FloatArray, effects: tuple[str, ...]) -> float:
    if _in_pose(true_model):
        return true_model.pose_error(theta, effects)
    return true_model.speed_error(theta, effects)


def _fitted_error(true_model: TrueModel, diagnosis: Diagnosis) -> float | None:
    """Error of the model that the verdict stands for."""
    if diagnosis.verdict == "consistent":
        return _error(true_model, true_model.simulator.start(), ())
    if not diagnosis.explanations:
        return None
    model = diagnosis.explanations[0]
    return _error(true_model, model.theta, model.effects)


def _harm(true_model: TrueModel, diagnosis: Diagnosis) -> float | None:
    fitted = _fitted_error(true_model, diagnosis)
    given = _error(true_model, true_model.simulator.start(), ())
    return None if fitted is None or not given > 0.0 else fitted / given


def _gaps(
    true_model: TrueModel, diagnosis: Diagnosis, ceiling: Fit
) -> tuple[float | None, float | None, float | None]:
    fitted = _fitted_error(true_model, diagnosis)
    if fitted is None:
        return None, None, None
    given = _error(true_model, true_model.simulator.start(), ())
    best = _error(true_model, ceiling.theta, ceiling.effects)
    refitted = _error(true_model, true_model.base(true_model.on_real).theta, ())
    return _closed(given, fitted, best), _closed(refitted, fitted, best), fitted / given


def _closed(before: float, after: float, best: float) -> float | None:
    gap = before - best
    return (before - after) / gap if gap > _MIN_GAP * before else None


def _opinion_gaps(true_model: TrueModel, opinions: dict[str, Opinion], ceiling: Fit) -> dict[str, float]:
    """The gap that other methods close, where they have a model to simulate."""
    out: dict[str, float] = {}
    given = _error(true_model, true_model.simulator.start(), ())
    best = _error(true_model, ceiling.theta, ceiling.effects)
    for name, opinion in opinions.items():
        if not opinion.numbers:
            continue
        layout = true_model.simulator.layout
        theta = true_model.simulator.start().copy()
        effects: set[str] = set()
        for key, value in opinion.numbers.items():
            at = layout.index(key)
            theta[at] = float(np.clip(value / layout.scale[at], layout.lower[at], layout.upper[at]))
            if "." in key:
                effects.add(key.split(".")[0])
        closed = _closed(given, _error(true_model, theta, tuple(sorted(effects))), best)
        if closed is not None and math.isfinite(closed):
            out[name] = closed
    return out


def _places(true_model: TrueModel, diagnosis: Diagnosis) -> tuple[float | None, float | None, float | None]:
    """Share of the effect's energy in the spans, and of the spans that is the effect."""
    if not true_model.names or not diagnosis.mismatch:
        missed = bool(true_model.names) and diagnosis.verdict == "unexplained"
        return (0.0 if missed else None), None, None
    if _in_pose(true_model):
        return _pose_places(true_model, diagnosis.mismatch)
    return _speed_places(true_model, diagnosis.mismatch)


def _speed_places(
    true_model: TrueModel, spans: tuple[MismatchSpan, ...]
) -> tuple[float | None, float | None, float | None]:
    data, truth = true_model.real, true_model.truth
    at = true_model.truth_rows(data)
    effect = (truth.recorded - truth.plain_recorded)[at] ** 2
    effect[~data.judged] = 0.0
    noise = (data.speed_mps - true_model.clean.speed_mps) ** 2
    return _shares(effect, noise, _cells(true_model, spans))


def _left_places(
    true_model: TrueModel, diagnosis: Diagnosis
) -> tuple[float | None, float | None, float | None]:
    """The places beside what the refitted baseline leaves of noise-free output."""
    if not true_model.names or not diagnosis.mismatch:
        return None, None, None
    left = (true_model.clean.speed_mps - true_model.base(true_model.on_clean).residual.speeds) ** 2
    left[~true_model.clean.judged] = 0.0
    noise = (true_model.real.speed_mps - true_model.clean.speed_mps) ** 2
    return _shares(left, noise, _cells(true_model, diagnosis.mismatch))


def _cells(true_model: TrueModel, spans: tuple[MismatchSpan, ...]) -> BoolArray:
    """Rows by wheel that lie in spans, shape (n, 2)."""
    data = true_model.real
    inside = np.zeros(data.speed_mps.shape, dtype=bool)
    for span in spans:
        if span.signal in SPEED_SIGNALS and span.run in data.names:
            rows = (data.run_of_row == data.names.index(span.run)) & data.judged
            rows &= (data.t_s > span.t_start_s - 1e-9) & (data.t_s <= span.t_end_s + 1e-9)
            inside[rows, SPEED_SIGNALS.index(span.signal)] = True
    return inside


def _pose_places(
    true_model: TrueModel, spans: tuple[MismatchSpan, ...]
) -> tuple[float | None, float | None, float | None]:
    """The same for windows of the pose, each component in standard deviations of its measurement."""
    windows = true_model.simulator.windows(true_model.horizon_s)
    if not len(windows):
        return None, None, None
    data, truth = true_model.real, true_model.truth
    at = true_model.truth_rows(data)
    sigma = true_model.pose_sigma()
    effect = ((_moves(truth.pose, at, windows) - _moves(truth.plain_pose, at, windows)) / sigma) ** 2
    # A measuring error moves no robot: what differs is the pose predicted from the wheels' travel.
    wheels = (truth.recorded - truth.plain_recorded)[at] * data.dt_s[:, None]
    wheels[~data.judged] = 0.0
    summed = np.vstack([np.zeros((1, 2)), np.cumsum(wheels, axis=0)])
    moved = summed[windows.last + 1] - summed[windows.first + 1]
    base = data.baseline.wheelbase_m or 0.3
    seeming = np.column_stack([moved.mean(axis=1), 0.0 * moved[:, 0], (moved[:, 1] - moved[:, 0]) / base])
    effect = effect + (seeming / sigma) ** 2
    measured = np.nan_to_num(windows.measured - _moves(truth.pose, at, windows))
    noise = (measured / sigma) ** 2
    inside = np.zeros_like(effect, dtype=bool)
    names = np.array(data.names)[windows.run]
    for span in spans:
        if span.signal in TRUTH_COLUMNS:
            rows = (names == span.run) & (data.t_s[windows.first] >= span.t_start_s - 1e-9)
            rows &= data.t_s[windows.last] <= span.t_end_s + 1e-9
            inside[rows, TRUTH_COLUMNS.index(span.signal)] = True
    return _shares(effect, noise, inside)


def _moves(pose: FloatArray, at: IntArray, windows: object) -> FloatArray:
    """Displacement over windows in the frame of their beginnings, shape (m, 3)."""
    first, last = pose[at[windows.first]], pose[at[windows.last]]  # type: ignore[attr-defined]
    step = last - first
    c, s = np.cos(first[:, 2]), np.sin(first[:, 2])
    return np.column_stack([c * step[:, 0] + s * step[:, 1], c * step[:, 1] - s * step[:, 0], step[:, 2]])


def _shares(
    effect: FloatArray, noise: FloatArray, inside: BoolArray
) -> tuple[float | None, float | None, float | None]:
    """Share of the effect in the spans, and of the spans that is the effect: by cells, by energy."""
    total = float(effect.sum())
    if total <= 0.0 or not inside.any():
        return (0.0 if total > 0.0 else None), None, None
    in_spans = float(effect[inside].sum())
    ordered = np.sort(effect, axis=None)[::-1]
    threshold = ordered[int(np.searchsorted(np.cumsum(ordered), WHERE_IT_IS * total))]
    there = float(np.mean(effect[inside] >= threshold))
    return in_spans / total, there, in_spans / (in_spans + float(noise[inside].sum()))
