"""The page of an engine's campaign: figures with bounds and bars, by effect, and every trial."""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from truing.trial.engines.engine import Engine
from truing.trial.score import Score

WANTED_TRIALS = 300
FULL = 1.0
_WIDTH = 128
_ABOUT = (
    "The robots, their motors and contacts and what is hidden in them are the engine's "
    "(`host/truing/trial/engines`). The answer is sealed before the robot moves and opened after the "
    "verdict, and the diagnosis reads only the recordings. Its faults were looked for in campaigns of seeds "
    "1, 2 and 3, not in those of other seeds."
)
_SETS = (
    "Each set has eight runs of about six seconds (steps, reversals, ramps, turns, one wheel, headings, "
    "creeping, random), in effort mode, in velocity mode or run by run in turn, at 20, 50 or 200 rows a "
    "second. Encoders count whole counts, a small random torque disturbs the axles, and the baseline's "
    "numbers are up to 8 % off. S is the RMS that an effect leaves in speeds over 50 ms when gain and "
    "time constant are refitted, over that noise: full strength is 1 to 8, weak 0.3 to 1."
)
# Normal quantile of 95 % bounds.
_Z = 1.959964


def wilson(hits: int, trials: int) -> tuple[float, float]:
    """95 % bounds of a share (Wilson 1927, score interval)."""
    if trials == 0:
        return 0.0, 1.0
    share, z2 = hits / trials, _Z * _Z
    middle = (share + z2 / (2.0 * trials)) / (1.0 + z2 / trials)
    half = _Z * math.sqrt(share * (1.0 - share) / trials + z2 / (4.0 * trials**2)) / (1.0 + z2 / trials)
    # At no hits and at hits alone the interval ends at 0 and 1; rounding must not pass them.
    return (0.0 if hits == 0 else middle - half), (1.0 if hits == trials else middle + half)


@dataclass(frozen=True)
class Share:
    """A share of trials beside its bar; with `is_max` the bar must not be exceeded."""

    title: str
    hits: int
    trials: int
    bar: float | None = None
    is_max: bool = False

    @property
    def met(self) -> bool | None:
        """Whether the share itself is at its bar; None without a bar or without trials."""
        if self.bar is None or self.trials == 0:
            return None
        value = self.hits / self.trials
        return value <= self.bar if self.is_max else value >= self.bar

    def row(self) -> str:
        """As a line of the page's table."""
        if self.trials == 0:
            return f"| {self.title} | - | - | 0 | {self._bar} | - |"
        low, high = wilson(self.hits, self.trials)
        met = {None: "", True: "yes", False: "**no**"}[self.met]
        value = f"{100.0 * self.hits / self.trials:.0f} %"
        bounds = f"{100.0 * low:.0f} to {100.0 * high:.0f} %"
        return f"| {self.title} | {value} | {bounds} | {self.hits} of {self.trials} | {self._bar} | {met} |"

    @property
    def _bar(self) -> str:
        if self.bar is None:
            return ""
        return f"at {'most' if self.is_max else 'least'} {100.0 * self.bar:.0f} %"


Pick = Callable[[Score], bool]


def _share(
    title: str, scores: Sequence[Score], hit: Pick, bar: float | None = None, *, is_max: bool = False
) -> Share:
    return Share(title, sum(hit(each) for each in scores), len(scores), bar, is_max)


def shares(scores: Sequence[Score]) -> list[Share]:
    """The figures of a campaign, in the order of their bars."""
    one, two, null, outside = (
        [each for each in scores if each.family == family] for family in ("one", "two", "null", "outside")
    )
    full, weak = [e for e in one if e.strength >= FULL], [e for e in one if e.strength < FULL]
    follows = [each for each in null if each.measured["engine_names"]]
    return [
        _share("one effect, full strength: named, alone or among three", full, lambda e: e.named, 0.97),
        _share("one effect, weak: the same", weak, lambda e: e.named, 0.90),
        _share("one effect, full strength: named alone", full, lambda e: e.named_alone),
        _share("one effect, weak: named alone", weak, lambda e: e.named_alone),
        _share("two effects: both named, one other at most", two, lambda e: e.named, 0.85),
        _share("two effects: exactly these named", two, lambda e: e.named_alone),
        _share("nothing missing: no effect named", null, lambda e: e.right, 0.98),
        _share("of these, damping or ballast added: the same", follows, lambda e: e.right),
        _share(
            "outside the catalogue: `unexplained` or `partly_explained`", outside, lambda e: e.right, 0.95
        ),
        _share(
            "outside: that, or an honest `ambiguous`",
            outside,
            lambda e: e.right or e.verdict == "ambiguous",
        ),
        _share("confidently wrong", scores, lambda e: e.confidently_wrong, 0.01, is_max=True),
        *_parameter_shares(one),
    ]


def _parameter_shares(one: Sequence[Score]) -> list[Share]:
    kept = [entry["within"] for each in one for entry in each.measured.get("parameters", {}).values()]
    return [Share("parameters of a named single effect: within their factor", sum(kept), len(kept))]


def to_json(scores: Sequence[Score]) -> dict[str, Any]:
    """The campaign as JSON."""
    figures = [
        asdict(each) | {"bounds": wilson(each.hits, each.trials), "met": each.met} for each in shares(scores)
    ]
    return {"schema": 1, "figures": figures, "trials": [each.to_json() for each in scores]}


def to_markdown(engine: Engine[Any], scores: Sequence[Score], *, trials: int, seed: int, table: str) -> str:
    """The campaign as a page."""
    versions = ", ".join(sorted({str(each.measured["engine"]) for each in scores})) or engine.name
    command = f"./run truing trial --engine {engine.name} --campaign {trials} --seed {seed} --table {table}"
    short = len(scores) < WANTED_TRIALS
    caution = (
        f"**{WANTED_TRIALS} trials are wanted; this page rests on {len(scores)}.** "
        "Its bounds say what that is worth."
    )
    return "\n".join(
        [
            "# Proof on physics that this project did not write",
            "",
            _wrapped(f"{len(scores)} concealed trials in {versions}. {_ABOUT}"),
            *(["", caution] if short else []),
            "",
            "```",
            command,
            "```",
            "",
            _wrapped(
                "makes this page again (it goes on where it was stopped); "
                f"`./run truing trial --engine {engine.name} --effect E --seed S --mode M --rate R` with a "
                "line of the last table makes one of them (with `--strength`, where it has one)."
            ),
            "",
            _wrapped(_SETS),
            "",
            "## Figures",
            "",
            "Bounds are 95 % (Wilson). `met` holds the share itself against its bar.",
            "",
            "| figure | share | 95 % bounds | trials | bar | met |",
            "| --- | --- | --- | --- | --- | --- |",
            *(each.row() for each in shares(scores)),
            "",
            *_closeness(scores),
            "## Single effects by mode and by rate",
            "",
            "| driven or recorded | named | 95 % bounds | trials | | |",
            "| --- | --- | --- | --- | --- | --- |",
            *_by_way(scores),
            "",
            "## By what was hidden",
            "",
            "| hidden | means | catalogue | trials | right | verdicts |",
            "| --- | --- | --- | --- | --- | --- |",
            *_by_effect(engine, scores),
            "",
            *_parameter_table(scores),
            *_not_right(scores),
            "## Every trial",
            "",
            "| E | S | M | R | strength | hidden (S) | verdict | right |",
            "| --- | --- | --- | --- | --- | --- | --- | --- |",
            *(_trial_row(each) for each in scores),
            "",
        ]
    )


def _closeness(scores: Sequence[Score]) -> list[str]:
    if not scores:
        return []
    errors = np.array([each.measured["healthy_mps"] for each in scores]) * 1e3
    parts = np.array([each.measured["healthy_share"] for each in scores]) * 100.0
    over = np.array([each.measured["healthy_mps"] / each.measured["noise_mps"] for each in scores])
    return [
        _wrapped(
            "The healthy robots are close to the baseline's form: the free-run error of the first-order "
            f"model that fits each best, without noise, is {np.median(errors):.2f} mm/s (median; "
            f"{errors.max():.2f} at worst), {np.median(parts):.3f} % of full speed ({parts.max():.3f} %) and "
            f"{np.median(over):.2f} of the noise ({over.max():.2f})."
        ),
        "",
    ]


def _by_way(scores: Sequence[Score]) -> list[str]:
    one = [each for each in scores if each.family == "one"]
    ways = sorted({part for each in one for part in _ways(each)}, key=_way_order)
    groups = [(way, [each for each in one if way in _ways(each)]) for way in ways]
    return [_share(way, group, lambda e: e.named).row() for way, group in groups]


def _ways(score: Score) -> tuple[str, str]:
    mode, rate = score.driving.split(" ", 1)
    return f"{mode} mode", rate


def _way_order(way: str) -> tuple[bool, float, str]:
    rate = way.split(" ")[0]
    return rate.isdigit(), float(rate) if rate.isdigit() else 0.0, way


def _by_effect(engine: Engine[Any], scores: Sequence[Score]) -> list[str]:
    groups: dict[str, list[Score]] = {}
    for each in scores:
        names = each.measured["engine_names"]
        title = "two effects" if len(names) == 2 else names[0] if names else "nothing"
        groups.setdefault(title, []).append(each)
    rows = []
    for name, group in sorted(groups.items()):
        means, known = _means(engine, name)
        right = sum(one.right for one in group)
        head = f"| {name} | {means} | {known} | {len(group)} | {right} | "
        rows.append(f"{head}{_verdicts(group, _WIDTH - len(head))} |")
    return rows


def _verdicts(group: Sequence[Score], width: int) -> str:
    """How often each verdict was given; those that are rarest count together where the line ends."""
    counts = Counter(one.verdict for one in group).most_common()
    parts = [f"{kind} {number}" for kind, number in counts]
    for kept in range(len(parts), 0, -1):
        rest = sum(number for _, number in counts[kept:])
        text = ", ".join(parts[:kept] + ([f"others {rest}"] if rest else []))
        if len(text) <= width - 2:
            break
    return text


def _means(engine: Engine[Any], name: str) -> tuple[str, str]:
    """The engine's means, and what the catalogue calls it."""
    effect = engine.effects.get(name)
    if effect is None:
        return "", ""
    return effect.means, {"catalogue": effect.catalogue, "form": "nothing missing", "outside": "-"}[
        effect.kind
    ]


def _parameter_table(scores: Sequence[Score]) -> list[str]:
    """Found over expected, of single effects that are named."""
    ratios: dict[str, list[tuple[float, bool]]] = {}
    for each in scores:
        if each.family == "one":
            for key, entry in each.measured.get("parameters", {}).items():
                names = each.measured["engine_names"]
                ratio = float(entry["found"]) / float(entry["expected"]) if entry["expected"] else math.nan
                ratios.setdefault(f"{names[0]} | {key}", []).append((ratio, bool(entry["within"])))
    if not ratios:
        return []
    rows = [
        f"| {key} | {len(values)} | {np.median([ratio for ratio, _ in values]):.2f} "
        f"({min(values)[0]:.2f} to {max(values)[0]:.2f}) | {sum(good for _, good in values)} |"
        for key, values in sorted(ratios.items())
    ]
    return [
        "## Parameters",
        "",
        "Found over what the engine was given, converted to the catalogue's parameter. The equations are not",
        "the engine's, so that a factor is allowed (1.3; 1.5 where its law is another, 1.02 for sizes).",
        "",
        "| hidden | parameter | estimates | found over given: median (range) | within |",
        "| --- | --- | --- | --- | --- |",
        *rows,
        "",
    ]


def _not_right(scores: Sequence[Score]) -> list[str]:
    wrong = [each for each in scores if not each.right or each.confidently_wrong]
    if not wrong:
        return []
    lines = [f"- seed {each.seed}, {each.driving}: {_outcome_text(each)}" for each in wrong]
    return ["## Not right", "", *(_wrapped(line, indent="  ") for line in lines), ""]


def _wrapped(text: str, indent: str = "") -> str:
    return textwrap.fill(text, _WIDTH, subsequent_indent=indent, break_on_hyphens=False)


def _hidden(each: Score) -> str:
    names = each.measured["engine_names"]
    if not each.strengths:
        return ", ".join(names) or "nothing"
    return ", ".join(f"{name} ({size:.2f})" for name, size in zip(names, each.strengths, strict=True))


def _outcome_text(each: Score) -> str:
    sure = ", confidently wrong" if each.confidently_wrong else ""
    return f"{_hidden(each)} got {each.verdict}: {', '.join(each.said) or '-'}{sure}"


def _trial_row(each: Score) -> str:
    mode, rate, _ = each.driving.split(" ")
    strength = {None: "", True: "weak", False: "full"}[each.weak]
    cells = [each.effect, str(each.seed), mode, rate, strength, _hidden(each)]
    said = list(each.said)
    while True:
        more = len(each.said) - len(said)
        names = ", ".join(said) + (f" and {more} more" if more else "")
        verdict = f"{each.verdict}: {names or '-'}"
        row = "| " + " | ".join([*cells, verdict, "yes" if each.right else "no"]) + " |"
        if len(row) <= _WIDTH or not said:
            return row
        said.pop()
