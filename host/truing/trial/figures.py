"""A campaign's figures, each with its bar and its 95 % bounds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from truing.trial.score import HARM, NO_EFFECT_NAMED, Score

# Two explanations whose predictions differ by this whitened norm are nearly always distinguished.
SEPARABLE = 4.0
# Beyond this S an effect has full strength.
FULL = 1.0
# Beyond this S an effect that acts for some time only must not be missed, nor gear backlash.
STRONG = 2.0


def bounds(hits: int, trials: int) -> tuple[float, float]:
    """95 % bounds of a share (Clopper & Pearson 1934)."""
    from scipy import stats

    if trials == 0:
        return 0.0, 1.0
    low = float(stats.beta.ppf(0.025, hits, trials - hits + 1)) if hits > 0 else 0.0
    high = float(stats.beta.ppf(0.975, hits + 1, trials - hits)) if hits < trials else 1.0
    return low, high


def median_bounds(values: Sequence[float]) -> tuple[float, float]:
    """95 % bounds of a median, from the order of the values."""
    from scipy import stats

    ordered = np.sort(np.asarray(values))
    n = len(ordered)
    if n < 6:
        return (float(ordered[0]), float(ordered[-1])) if n else (math.nan, math.nan)
    at = int(stats.binom.ppf(0.025, n, 0.5))
    return float(ordered[max(at - 1, 0)]), float(ordered[min(n - at, n - 1)])


@dataclass(frozen=True)
class Figure:
    """A share of trials or a median beside its bar.

    Attributes
    ----------
    value : the share, or the median.
    low, high : its 95 % bounds.
    number : how many trials (or values) it rests on.
    bar : limit that `value` must reach, or with `is_max` must not exceed; None: no limit.
    """

    title: str
    value: float
    low: float
    high: float
    number: int
    bar: float | None = None
    is_max: bool = False
    share: bool = True
    upper_bar: float | None = None

    @property
    def met(self) -> bool | None:
        """Whether the bar is met; None without a bar or without trials."""
        if self.bar is None or self.number == 0:
            return None
        good = self.value <= self.bar if self.is_max else self.value >= self.bar
        return good and (self.upper_bar is None or self.value <= self.upper_bar)


def share_of(
    title: str, hits: Sequence[bool], bar: float | None, *, is_max: bool = False, upper: float | None = None
) -> Figure:
    """A share."""
    number, count = len(hits), sum(hits)
    low, high = bounds(count, number)
    return Figure(title, count / number if number else math.nan, low, high, number, bar, is_max, True, upper)


def median_of(title: str, values: Sequence[float], bar: float | None, *, is_max: bool = False) -> Figure:
    """A median."""
    finite = [value for value in values if math.isfinite(value)]
    low, high = median_bounds(finite)
    middle = float(np.median(finite)) if finite else math.nan
    return Figure(title, middle, low, high, len(finite), bar, is_max, False)


def _value(scores: Sequence[Score], name: str) -> list[float]:
    return [float(each.measured[name]) for each in scores if each.measured.get(name) is not None]


def is_full(score: Score) -> bool:
    """Whether everything concealed has full strength."""
    return score.strength >= FULL


def separable(score: Score) -> bool:
    """Whether the best rival, refitted, is further from the concealed effect than the noise covers."""
    distance = score.measured.get("rival_distance")
    return distance is None or float(distance) >= SEPARABLE


def figures(scores: Sequence[Score]) -> list[Figure]:
    """All figures of a campaign, in the order of their bars."""
    one, two, several, null, outside, intermittent = (
        [each for each in scores if each.family == name]
        for name in ("one", "two", "several", "null", "outside", "intermittent")
    )
    within = one + two + several
    full = [each for each in one if is_full(each)]
    weak = [each for each in one if not is_full(each)]
    inside = [held for each in within for held in each.measured.get("inside", {}).values()]
    named = [each for each in within if each.named]
    resolved_ambiguities = [each.resolved for each in scores if each.resolved is not None]
    rights = [each for each in named if each.verdict == "missing_physics"]
    return [
        share_of("one effect, full strength: named", [e.named for e in full], 0.95),
        share_of("one effect, weak: named", [e.named for e in weak], 0.85),
        share_of("one, full, best rival distinguishable: alone", _alone(full), 0.85),
        share_of("one, weak, best rival distinguishable: alone", _alone(weak), 0.70),
        share_of("one, full: alone, of all", [e.named_alone for e in full], None),
        share_of("one, weak: alone, of all", [e.named_alone for e in weak], None),
        share_of("one effect: verdict `ambiguous`", [e.verdict == "ambiguous" for e in one], None),
        share_of("all trials: verdict `ambiguous`", [e.verdict == "ambiguous" for e in scores], None),
        share_of("two effects: both named, one extra at most", [e.named for e in two], 0.75),
        share_of("three or four effects: all named, at most as many extra", [e.named for e in several], 0.60),
        share_of("three or four: no false positive", [not e.confidently_wrong for e in several], 0.95),
        share_of("nothing concealed: no false positive", [e.right for e in null], 0.98),
        share_of("confidently wrong", [e.confidently_wrong for e in scores], 0.02, is_max=True),
        share_of("outside the catalogue: `unexplained`", [e.right for e in outside], None),
        share_of(
            "outside: `unexplained`, place right", [e.right and bool(e.place_right) for e in outside], 0.80
        ),
        *_intermittent(intermittent),
        share_of("gear backlash, S >= 2: named", [e.named for e in one if _strong_backlash(e)], 0.95),
        median_of("outside: spans' share of what no refit takes away", _value(outside, "left_covered"), None),
        median_of("outside: share of the spans that is that", _value(outside, "left_share"), None),
        share_of("effective parameter inside its 95 % interval", inside, 0.90, upper=0.99),
        median_of("gap closed, other excitation", _value(within, "gap_closed"), 0.9),
        median_of("gap closed from the refitted baseline", _value(within, "gap_closed_refitted"), None),
        share_of("no harm on other excitation", [h <= HARM for h in _value(scores, "harm")], 0.99),
        median_of("held-out error over noise floor", _value(named, "over_floor"), 1.15, is_max=True),
        median_of("noise floor over the true noise", _value(scores, "true_over_floor"), None),
        share_of("`ambiguous`, truth among them: resolved by two runs at most", resolved_ambiguities, 0.85),
        median_of("spans: share of the effect's energy", _value(rights, "covered"), 0.8),
        median_of("spans: share of them that is effect", _value(rights, "effect_share"), 0.8),
        median_of("spans: the same by energy beside noise", _value(rights, "effect_energy"), None),
        median_of("verdict, CPU seconds (one thread)", [e.cpu_s for e in scores], None),
        median_of("verdict, CPU seconds over 2 cores", [0.5 * e.cpu_s for e in scores], 20.0, is_max=True),
        median_of("building the recordings, CPU seconds", [e.building_cpu_s for e in scores], None),
    ]


def _intermittent(scores: Sequence[Score]) -> list[Figure]:
    """Figures of effects outside the catalogue that act for some time only."""
    strong = [each for each in scores if each.strength >= STRONG]
    return [
        share_of(
            "intermittent, S >= 2: `unexplained` or `partly_explained`", [e.right for e in strong], 0.95
        ),
        share_of(
            "intermittent: not `consistent` nor `parameters_only`",
            [e.verdict not in NO_EFFECT_NAMED for e in scores],
            1.0,
        ),
        share_of(
            "intermittent: right, and place right", [e.right and bool(e.place_right) for e in scores], None
        ),
    ]


def _strong_backlash(score: Score) -> bool:
    return score.hidden == ("gear_backlash",) and score.strength >= STRONG


def _alone(scores: Sequence[Score]) -> list[bool]:
    return [each.named_alone for each in scores if separable(each)]


Pick = Callable[[Score], bool]


def by_method(scores: Sequence[Score]) -> dict[str, list[tuple[str, int, int]]]:
    """For each method, hits and trials of each kind of trial."""
    groups: list[tuple[str, Pick, bool]] = [
        ("one, full", lambda s: s.family == "one" and is_full(s), False),
        ("one, weak", lambda s: s.family == "one" and not is_full(s), False),
        ("two", lambda s: s.family == "two", False),
        ("three or four", lambda s: s.family == "several", False),
        ("nothing concealed", lambda s: s.family == "null", False),
        ("outside", lambda s: s.family == "outside", False),
        ("intermittent", lambda s: s.family == "intermittent", False),
        ("confidently wrong", lambda _: True, True),
    ]
    methods = list(dict.fromkeys(name for each in scores for name in each.methods))
    out: dict[str, list[tuple[str, int, int]]] = {}
    for label, ours in (("truing, named alone or in a set of 3", False), ("truing, named alone", True)):
        out[label] = [
            (title, sum(_ours(s, wrong=wrong, alone=ours) for s in scores if pick(s)), _count(scores, pick))
            for title, pick, wrong in groups
        ]
    for name in methods:
        out[name] = [
            (title, sum(s.methods[name][int(wrong)] for s in scores if pick(s) and name in s.methods),
             sum(pick(s) and name in s.methods for s in scores))
            for title, pick, wrong in groups
        ]  # fmt: skip
    return out


def _count(scores: Sequence[Score], pick: Pick) -> int:
    return sum(pick(each) for each in scores)


def _ours(score: Score, *, wrong: bool, alone: bool) -> bool:
    if wrong:
        return score.confidently_wrong
    return score.named_alone if alone and score.family == "one" else score.right
